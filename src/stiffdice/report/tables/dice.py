"""Tables of how the faces of a die answer to its shape and load."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.number_format import scene_of

_WORDS = {
    "as_measured": "as measured",
    "half_step": "half the step",
    "double_step": "twice the step",
    "fourfold_step": "four times the step",
    "half_contact_time": "half the contact time, half the step",
    "double_contact_time": "twice the contact time",
    "half_size": "half the stretch, half the offset",
    "square": "two square boxes and the cube between",
}
_COLUMNS = ["χ", "±", "G", "±", "ψ", "±", "unsettled"]


def _cells(found: xr.Dataset) -> list[str]:
    """Return the coefficients of one place with their errors, and the part that did not settle."""
    names = ("chi", "curvature", "psi")
    cells = [
        f"{float(found[name]):.{digits}f}" for k in names for name in (k, f"{k}_error") for digits in (_digits(k),)
    ]
    return [cell.replace("-", "−") if cell != "nan" else "" for cell in cells] + [f"{float(found.unsettled):.2%}"]


def _digits(name: str) -> int:
    return 3 if name == "chi" else 2


def response(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each way of throwing and each ground."""
    rows = [
        [name, f"{e:g}", f"{mu:g}", *_cells(found.sel(restitution=e, friction=mu))]
        for name, found in experiments.items()
        for e in found.restitution.values
        for mu in found.friction.values
    ]
    note = (
        "χ = d ln p(end pair)/d ln(c/a) of a square box at the cube; p(pair k) ∝ exp(3/2 χ y_k + G y_k²), y_k the "
        "logarithm of axis k over the mean; ψ = d ln(p(face)/p(opposite))/d(offset of the centre of mass/side); ±: "
        "standard errors."
    )
    return rendered(title, ["throw", "e", "μ", *_COLUMNS], rows, note)


def checks(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each thing that was changed, the first without any change."""
    (found,) = experiments.values()
    rows = [[_WORDS[name], *_cells(found.isel(check=k))] for k, name in enumerate(meanings_of(found.check))]
    step, contact = scene_of(found)["duration"] / int(found.attrs["steps"]), float(found.attrs["contact_time"])
    note = (
        f"e = {found.attrs['restitution']:g}, μ = {found.attrs['friction']:g}; as measured: steps of "
        f"{1e3 * step:.3g} ms, contact time {1e3 * contact:g} ms; "
        f"{int(found.attrs['throws']):,} throws of each body; ±: standard errors."
    )
    return rendered(title, ["changed", *_COLUMNS], rows, note)

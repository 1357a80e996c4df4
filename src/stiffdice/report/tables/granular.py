"""Tables of the steps of spheres in contact: theory, rules of granular codes, and what was measured."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.number_format import readable


def steps(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each packing: its longest stable step by theory, measured under either force, and by rules."""
    (found,) = experiments.values()
    rows = []
    for k, name in enumerate(meanings_of(found.packing)):
        row = found.isel(packing=k)
        numbers = [row.theory, *row.measured, row.yade, row.exadem]
        beyond = float(row.exadem / row.theory)
        rows.append([name.replace("_", " "), *(readable(float(number), 4) for number in numbers), f"{beyond:.2f}"])
    columns = ["packing", "2/ω", *(f"measured, {force}" for force in meanings_of(found.force)), "YADE", "exaDEM"]
    note = (
        "Longest steps over √(m/k), k the slope of the force. Undamped; measured: nudges to the packing under pressure "
        "grow in longer steps. Last column: how far exaDEM's rule is beyond the stable step."
    )
    return rendered(title, [*columns, "exaDEM over 2/ω"], rows, note)


def beads(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each modulus and speed: LIGGGHTS' times, and the stable step over them."""
    (found,) = experiments.values()
    rows = []
    for young in found.young.values:
        for speed in found.speed.values:
            row = found.sel(young=young, speed=speed)
            shown = [readable(float(value), 3) for value in (young, speed, row.depth / row.attrs["radius"])]
            times = [readable(float(value), 3) for value in (row.rayleigh, row.hertz)]
            parts = [f"{float(row.stable_face_centred / time):.2f}" for time in (row.rayleigh, row.hertz)]
            rows.append([*shown, *times, *parts])
    columns = ["E [Pa]", "v [m/s]", "overlap over R", "Rayleigh time [s]", "Hertz time [s]"]
    columns += ["stable over Rayleigh", "stable over Hertz"]
    told = found.attrs
    note = (
        f"Spheres of {readable(1e3 * told['radius'])} mm, {readable(told['density'])} kg/m³, "
        f"ν = {readable(told['poisson'])}. "
        "Stable: the longest step of a packing with 12 neighbours each, at the overlap of the impact."
    )
    return rendered(title, columns, rows, note)

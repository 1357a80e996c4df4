"""What was run, in one line under a figure, from the attributes of its file."""

from __future__ import annotations

import json
import math

import xarray as xr

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def readable(value: float) -> str:
    """Return a number as a person writes it: 10⁶, 2.5×10⁴, 0.075."""
    if value == 0 or 1e-3 <= abs(value) < 1e4:
        return f"{value:g}"
    exponent = math.floor(math.log10(abs(value)))
    mantissa = f"{value / 10.0**exponent:.3g}"
    power = "10" + str(exponent).translate(_SUPERSCRIPTS)
    return power if mantissa == "1" else f"{mantissa}×{power}"


def describe(run: xr.Dataset, *, law: bool = False) -> str:
    """Return model, scheme, steps and ground of a run, and its contact law if asked, in one line with units."""
    ground = json.loads(run.attrs["scene"])["ground"]
    contact = f", {ground['contact']}" if law else ""
    return (
        f"{run.attrs['model']}, {run.attrs['scheme'].replace('_', ' ')}, {int(run.attrs['steps']):,} steps "
        f"(ωh = {run.attrs['omega_h']:.3g}); S = {readable(ground['stiffness'])} kg/s², "
        f"D = {readable(ground['damping'])} kg/s, μ = {readable(ground['friction'])}{contact}"
    )

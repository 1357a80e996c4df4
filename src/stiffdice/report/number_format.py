"""Numbers as a person writes them, and what was run, in one line under a figure."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_GROUND = {"stiffness": "S = {} kg/s²", "damping": "D = {} kg/s", "friction": "μ = {}"}
_TIMES = {"years": 365.25 * 86400, "days": 86400, "h": 3600, "min": 60, "s": 1, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}


def readable(value: float, digits: int | None = None) -> str:
    """Return a number as a person writes it: 10⁶, 2.5×10⁴, 0.075; rounded first, if digits are given."""
    value = value if digits is None else float(f"{value:.{digits}g}")
    if value == 0 or 1e-3 <= abs(value) < 1e4 or not math.isfinite(value):
        return f"{value:g}"
    exponent = math.floor(math.log10(abs(value)))
    mantissa = f"{value / 10.0**exponent:.3g}"
    power = "10" + str(exponent).translate(_SUPERSCRIPTS)
    return power if mantissa == "1" else f"{mantissa}×{power}"


def duration(seconds: float, digits: int = 3) -> str:
    """Return a time in the unit that suits it, from ns to years."""
    unit = next((name for name, size in _TIMES.items() if seconds >= size), "ns")
    return f"{readable(seconds / _TIMES[unit], digits)} {unit}"


def finite(value: float) -> float | None:
    """Return a number, or none where it is not one that JSON has."""
    return value if math.isfinite(value) else None


def scene_of(found: xr.Dataset) -> dict[str, Any]:
    """Return the scene of a dataset, as plain data."""
    return dict(json.loads(found.attrs["scene"]))


def ground_words(**numbers: float) -> str:
    """Return numbers of a ground with their letters and units: S = 10⁶ kg/s², D = 0.1 kg/s, μ = 0.1."""
    return ", ".join(_GROUND[name].format(readable(value)) for name, value in numbers.items())


def describe(run: xr.Dataset, *, law: bool = False) -> str:
    """Return model, scheme, steps and ground of a run, and its contact law if asked, in one line with units."""
    ground = scene_of(run)["ground"]
    contact = f", {ground['contact']}" if law else ""
    return (
        f"{run.attrs['model']}, {run.attrs['scheme'].replace('_', ' ')}, {int(run.attrs['steps']):,} steps "
        f"(ωh = {run.attrs['omega_h']:.3g}); {ground_words(**{name: ground[name] for name in _GROUND})}{contact}"
    )

"""What tosses of a file say, for people and for programs."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stiffdice.report.markdown_table import aligned
from stiffdice.report.number_format import finite

if TYPE_CHECKING:
    from stiffdice.experiments.tosses.fit import Told
    from stiffdice.experiments.tosses.summary import Summary

_SOURCES = {"sample": "from its first sample", "flight": "from the fit to its flight"}
# Ends of the keys for programs, of what has a dimension.
_UNITS = {
    "fall": "_m_per_s2",
    "fall_error": "_m_per_s2",
    "position": "_m",
    "orientation": "_rad",
    "velocity": "_m_per_s",
    "angular_velocity": "_rad_per_s",
}
_NORMAL = 1.96  # half of a 95 % interval, in standard errors


def as_text(path: str, found: Summary) -> str:
    """Return the page."""
    tosses, unit, tracker, fit = found.tosses, found.unit, found.tracker, found.fit
    seconds = (tosses.counts - 1).mean() / tosses.rate
    count = len(tosses.counts)
    lines = [
        f"{path}: {count} tosses of a cube of {1e3 * tosses.side:g} mm and {tosses.mass:g} kg, {tosses.rate:g} Hz, "
        f"{seconds:.2f} s on average",
        f"lengths are {unit.length:.4f} ± {unit.length_error:.4f} times those stored: the cube at rest is half its "
        "width high",
        f"flights then fall at {unit.fall:.3f} ± {unit.fall_error:.3f} m/s²; the tracker's error is "
        f"{1e3 * tracker.position:.2g} mm and {math.degrees(tracker.orientation):.2g}°",
        "",
        f"fitted on {found.fitted} random tosses, contact time {1e3 * found.physics.contact_time:g} ms:",
        *aligned(
            [
                ["restitution e", f"{fit.restitution:.3f}", _span(fit.restitution_interval)],
                ["friction μ", f"{fit.friction:.3f}", _span(fit.friction_interval)],
            ]
        ),
        "",
        f"told on the other {count - found.fitted}, a toss replayed",
    ]
    heads = ["", "path [% of the side]", "orientation [°]", "right final face [%]"]
    rows = [[_SOURCES[source], *_shares(told)] for source, told in found.told.items()]
    kept = ["if it kept its first face", "", "", f"{100 * found.kept:.1f}"]
    return "\n".join([*lines, *aligned([heads, *rows, kept]), "", "intervals: 95 %; errors: means over time"])


def _span(interval: tuple[float, float]) -> str:
    return f"({interval[0]:.3f} to {interval[1]:.3f})"


def _shares(told: Told) -> list[str]:
    factors = 100.0, 180 / math.pi, 100.0
    pairs = [(factor * values.mean(), factor * _half(values)) for values, factor in zip(told, factors, strict=True)]
    return [f"{mean:.1f} ± {half:.1f}" for mean, half in pairs]


def _half(values: np.ndarray[Any, Any]) -> float:
    return _NORMAL * float(values.std()) / math.sqrt(len(values))


def _key(error: str) -> str:
    return f"{error}{'_sides' if error == 'path' else _UNITS.get(error, '')}"


def _interval(values: np.ndarray[Any, Any]) -> dict[str, float | None]:
    return {"mean": finite(float(values.mean())), "half_interval": finite(_half(values))}


def _with_units(values: NamedTuple) -> dict[str, float | None]:
    return {f"{name}{_UNITS.get(name, '')}": finite(value) for name, value in values._asdict().items()}


def as_json(path: str, found: Summary) -> str:
    """Return the same for programs: units in the keys, path in sides, shares from 0 to 1."""
    fit = found.fit
    told = {
        source: {_key(name): _interval(values) for name, values in each._asdict().items()}
        for source, each in found.told.items()
    }
    data = {
        "file": path,
        "tosses": len(found.tosses.counts),
        "fitted": found.fitted,
        "side_m": found.tosses.side,
        "unit": _with_units(found.unit),
        "tracker": _with_units(found.tracker),
        "contact_time_s": found.physics.contact_time,
        "restitution": {"best": fit.restitution, "interval": fit.restitution_interval},
        "friction": {"best": fit.friction, "interval": fit.friction_interval},
        "kept_face": found.kept,
        "told": told,
    }
    return json.dumps(data, indent=2)

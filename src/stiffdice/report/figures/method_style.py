"""How a method looks in every figure; apart from `style`, as a changed engine has all drawn again that imports this."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from matplotlib.lines import Line2D

from stiffdice.report.figures import style
from stiffdice.report.methods import name_of
from stiffdice.simulation.engines.registry import PEERS

# Of a method: colour and mark.
_LOOKS: dict[str, dict[str, Any]] = {
    "symplectic_euler": {"color": style.BLUE, "marker": "o"},
    "forward_euler": {"color": style.ORANGE, "marker": "v"},
    "velocity_verlet": {"color": "#56B4E9", "marker": "s"},
    "rk4": {"color": style.PURPLE, "marker": "D"},
    "implicit_euler": {"color": "#997700", "marker": "^"},
    "exact": {"color": style.GREEN, "marker": "*"},
    "event": {"color": style.VERMILION, "marker": "P"},
    "scipy_dop853": {"color": style.QUIET, "marker": "<"},
    "scipy_lsoda": {"color": style.INK, "marker": ">"},
    "scipy_radau": {"color": "#a9a9a9", "marker": "x"},
    "mujoco": {"color": style.BLUE, "marker": "d"},
    "pybullet": {"color": style.ORANGE, "marker": "h"},
    "drake": {"color": style.PURPLE, "marker": "p"},
    "scipy": {"color": style.INK, "marker": ">"},
    "octave": {"color": style.GREEN, "marker": "X"},
    "numpy": {"color": style.VERMILION, "marker": "+"},
}


def look(method: str) -> dict[str, Any]:
    """Return colour, mark and line of a method: our schemes full, engines and solvers dashed."""
    dashes = "--" if method in PEERS else "-"
    mark = _LOOKS.get(method, {"color": style.QUIET, "marker": "."})
    return mark | {"linestyle": dashes, "linewidth": 1.0, "markersize": 6 if method == "exact" else 4}


def handles(methods: Iterable[str]) -> list[Line2D]:
    """Return a legend's lines."""
    return [style.line(name_of(method), **look(method)) for method in methods]

"""What measuring takes: options checked, values to try, a function over a grid as variables, and these as a result."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import STATE, Array, States
from stiffdice.errors import InputError
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset, progress
from stiffdice.simulation.run import Run

# What xarray takes for a variable: dimensions, values, attributes.
Variable = tuple[str | Sequence[str], Any, dict[str, Any]]

# Coordinates that files of runs and sweeps have, too.
_KNOWN = dataset.CELL_ATTRIBUTES | {"axis": dataset.AXIS_ATTRIBUTES}
# Meaning and unit of the others, where the name does not say it; one whose values are words is an enum.
_COORDINATES = {
    "angle": ("turn of a box", "rad"),
    "aspect": ("length of a square box over its width, c/a", "1"),
    "approximation": ("model without rotation: with friction, and without", "1"),
    "bounce": ("number of the bounce", "1"),
    "bound": ("bound of the floor", "1"),
    "check": ("what was changed of how the coefficients are measured", "1"),
    "damping": ("ground damping", "kg s-1"),
    "depth": ("depth of a cube in another, over its side", "1"),
    "duration": ("duration of the runs", "s"),
    "face": ("pips of the face", "1"),
    "body": ("which cube", "1"),
    "case": ("how two cubes meet", "1"),
    "offset": ("distance of the centres across the motion, over the side", "1"),
    "step_count": ("steps", "1"),
    "stretch": ("part of the motion", "1"),
    "force": ("force by overlap", "1"),
    "friction": ("friction coefficient", "1"),
    "hop_height": ("height from which rebounds count", "m"),
    "inertia": ("moment of inertia of the cube", "1"),
    "launch": ("orientation of the launch, 0 the scene's", "1"),
    "measure": ("error", "1"),
    "mode": ("contact mode", "1"),
    "nudge": ("nudge to a cube at rest on its face", "1"),
    "nudge_zeta": ("damping ratio of the nudged motion", "1"),
    "omega_h_relative": ("omega h of the nudged motion over its limit by theory", "1"),
    "packing": ("packing of spheres", "1"),
    "part": ("step over the duration of the impact", "1"),
    "path_omega_h": ("omega h of the fastest contact, of paths", "1"),
    "phase": ("fraction of the step before the nodes meet the ground", "1"),
    "piece": ("piece of the full model that the scene does not need", "1"),
    "pose": ("how two boxes are put", "1"),
    "quantile": ("quantile over the throws", "1"),
    "rest": ("how a throw ended", "1"),
    "restitution": ("speed up over speed down of a flat landing", "1"),
    "role": ("model with the piece, or without", "1"),
    "source": ("reference", "1"),
    "specimen": ("number of the measured box", "1"),
    "speed": ("mean speed of the launch along the ground", "m s-1"),
    "spin": ("standard deviation of each component of the launch's angular velocity", "rad s-1"),
    "step_size": ("step size", "s"),
    "time": ("time since the launch", "s"),
    "tolerance": ("tolerance of the scheme event", "1"),
    "turn": ("how a box is turned", "1"),
    "twist": ("turn of the upper box about the vertical", "rad"),
    "value": ("value of the number that is changed", "1"),
    "young": ("Young's modulus", "Pa"),
    "zeta": ("damping ratio of the mode itself, (D/S) omega/2", "1"),
}


def numbers(key: str, values: Sequence[float], unit: str, **bounds: Any) -> list[float]:
    """Return finite numbers; bounds: `above` or `at_least`. Raises InputError for one out of range."""
    return [validation.number(key, value, unit, **bounds) for value in values]


def span(values: Sequence[float], lowest: float = 0.0, below: float = math.inf) -> tuple[float, float]:
    """Return both ends of a span of ωh, `lowest` <= low < high < `below`, and 0 < low.

    Raises InputError for anything else.
    """
    ends = numbers("omega_h", values, "1")
    if len(ends) != 2 or not (0 < ends[0] < ends[1] < below and lowest <= ends[0]):
        bound = f"{lowest:g} <= " if lowest else "0 < "
        most = f" < {below:g}" if below < math.inf else ""
        shown = validation.shown(list(values))
        raise InputError(f"omega_h = {shown}: allowed are two numbers, {bound}low < high{most} [1]")
    return ends[0], ends[1]


def scan(low: float, high: float, count: int, special: Sequence[float]) -> Array:
    """Return values of ωh, ascending: `count` evenly in their logarithm, and those special ones that are between."""
    inside = [value for value in special if low <= value <= high]
    # The exact ends: geomspace's may differ in the last digit.
    return np.unique([low, *np.geomspace(low, high, count)[1:-1], high, *inside])


def bisected(
    holds: Callable[[float], bool], low: float, high: float, *, relative: float = 0.0, logarithmic: bool = False
) -> tuple[float, float]:
    """Return the last number at which `holds` is true and the first at which it is not, between low and high.

    holds: true at low, false at high, and changes once, as passing in a sweep does not. relative: how far apart the two
    may be, over the larger; 0 takes neighbouring doubles. logarithmic: whether halves are those of the logarithm.
    """
    while high - low > relative * high:
        middle = math.sqrt(low) * math.sqrt(high) if logarithmic else (low + high) / 2
        if not low < middle < high:
            break
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low, high


def states_of(run: Run, parts: int) -> States:
    """Return the states of a run at the launch and after equal parts of the duration, shape (parts + 1,).

    run: with a trajectory that has all of them; those after its end are not-a-number.
    """
    found = run.trajectory
    assert found is not None
    states = np.full(parts + 1, np.nan, STATE)
    known = found.state[found.step % (run.steps // parts) == 0]
    states[: len(known)] = known
    return states


def quantity(dimensions: str | Sequence[str], values: Any, meaning: str, unit: str = "1") -> Variable:
    """Return a variable of numbers."""
    return dimensions, values, {"long_name": meaning, "units": unit}


def coordinates(**axes: Iterable[Any]) -> dict[str, Variable]:
    """Return coordinates by name; words become an enum, whose value k means the k-th of them.

    Raises InputError for one without values.
    """
    found: dict[str, Variable] = {}
    for name, values in axes.items():
        listed = list(values)
        if not listed:
            raise InputError(f"{name} = []: allowed is at least one value")
        words = isinstance(listed[0], str)
        data = np.arange(len(listed), dtype=np.int8) if words else np.array(listed)
        if name in _KNOWN:
            attributes = _KNOWN[name]
        else:
            meaning, unit = _COORDINATES.get(name, (name, "1"))
            attributes = enum_attributes(meaning, listed) if words else {"long_name": meaning, "units": unit}
        found[name] = name, data, attributes
    return found


def mapped(
    function: Callable[..., Sequence[Any]], described: Mapping[str, Sequence[Any]], **axes: Iterable[Any]
) -> dict[str, Variable]:
    """Return what a function returns for each combination of coordinates as variables, and the coordinates.

    function: of one value of each axis; returns the values of all variables, numbers or arrays. described: by variable,
    its meaning, unit and, if it is an array, the dimensions that follow those of the axes.
    Raises InputError for an axis without values.
    """
    lists = {name: list(values) for name, values in axes.items()}
    variables = coordinates(**lists)
    places = progress.each([*itertools.product(*lists.values())])
    columns = zip(*(function(*place) for place in places), strict=True)
    for (name, (meaning, unit, *inner)), column in zip(described.items(), columns, strict=True):
        data = np.array(column)
        shape = *map(len, lists.values()), *data.shape[1:]
        variables[name] = quantity((*lists, *inner), data.reshape(shape), meaning, unit)
    return variables


def result(
    variables: Mapping[str, Variable], title: str, scene: Scene, model: str, scheme: str, code: str, **told: Any
) -> xr.Dataset:
    """Return variables with what says what made them: `dataset.provenance_attributes`, and other attributes."""
    return xr.Dataset(variables, attrs=dataset.provenance_attributes(title, scene, model, scheme, code) | told)

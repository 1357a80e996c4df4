"""The response of a die's faces to shape and load as numbers: measured before, by ground and by way of throwing.

From a facts file, of which one comes with the package, or from files of the experiment `face-response`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from stiffdice.errors import InputError
from stiffdice.experiments.dice.axes import Array
from stiffdice.io import reader, yaml_loader
from stiffdice.scene import validation

# What `make shapes` gave.
SHIPPED = Path(__file__).with_name("response.yaml")

COEFFICIENTS = ("chi", "curvature", "psi")
_GRIDS = tuple(name for coefficient in COEFFICIENTS for name in (coefficient, f"{coefficient}_error"))


@dataclass(frozen=True)
class Table:
    """Coefficients on a grid of restitutions and friction coefficients, ascending, for one way of throwing.

    values: by name, as of `response`, each with its `_error`, shape (restitution, friction). stretch [1]: up to which
    shapes were thrown, in the logarithm of an axis. Raises InputError for what is no such table.
    """

    throw: str
    restitution: Array
    friction: Array
    values: Mapping[str, Array]
    stretch: float

    def __post_init__(self) -> None:
        for key in ("restitution", "friction"):
            if not (getattr(self, key).ndim == 1 and (np.diff(getattr(self, key)) > 0).all()):
                raise InputError(f"{self.throw}.{key}: allowed are numbers in ascending order [1]")
        shape = len(self.restitution), len(self.friction)
        for name in _GRIDS:
            values = self.values[name]
            if values.shape != shape or not np.isfinite(values).all():
                raise InputError(f"{self.throw}.{name}: allowed are {shape[0]} rows of {shape[1]} finite numbers")
            if name.endswith("_error") and not (values >= 0).all():
                raise InputError(f"{self.throw}.{name}: allowed are numbers >= 0")
        for name in ("chi", "psi"):
            if not (self.values[name] < 0).all():
                raise InputError(f"{self.throw}.{name}: allowed are numbers < 0; others say nothing of a shape")

    def at(self, restitution: Array, friction: Array) -> dict[str, Array]:
        """Return every coefficient and error on grounds of the grid's range, linear between; arrays of one shape."""
        i, left = _place(self.restitution, restitution)
        j, below = _place(self.friction, friction)
        corners = [
            *((i, j, left * below), (i + 1, j, (1 - left) * below)),
            *((i, j + 1, left * (1 - below)), (i + 1, j + 1, (1 - left) * (1 - below))),
        ]
        last = np.array(self.values["chi"].shape) - 1
        return {
            name: np.asarray(sum(part * grid[np.minimum(a, last[0]), np.minimum(b, last[1])] for a, b, part in corners))
            for name, grid in self.values.items()
        }


def _place(grid: Array, value: Array) -> tuple[Any, Array]:
    """Return the index of the grid's number below a value, and the weight of that number."""
    if len(grid) == 1:
        return np.zeros(np.shape(value), dtype=int), np.ones(np.shape(value))
    k = np.clip(np.searchsorted(grid, value, side="right") - 1, 0, len(grid) - 2)
    return k, (grid[k + 1] - value) / (grid[k + 1] - grid[k])


def load(path: str | Path) -> list[Table]:
    """Return the tables in a facts file, one for each way of throwing.

    Raises InputError naming the file, the key and what is allowed.
    """
    data = yaml_loader.load(path)
    try:
        top = validation.known_keys("", data, ("stretch", "restitution", "friction", "throws"))
        for key in ("stretch", "restitution", "friction", "throws"):
            if key not in top:
                raise InputError(f"{key} is missing")
        throws = top["throws"]
        if not isinstance(throws, Mapping) or not throws:
            raise InputError(
                f"throws = {validation.shown(throws)}: allowed are ways of throwing, each with its numbers"
            )
        return [_table(name, top, throws[name]) for name in throws]
    except InputError as error:
        raise error.within(str(path)) from None


def _table(name: str, top: Mapping[str, Any], given: object) -> Table:
    keys = validation.known_keys(f"throws.{name}", given, ("launch", *_GRIDS))
    for key in _GRIDS:
        if key not in keys:
            raise InputError(f"throws.{name}.{key} is missing")
    grids = {key: _numbers(f"throws.{name}.{key}", keys[key]) for key in _GRIDS}
    stretch = validation.number("stretch", top["stretch"], "1", above=0)
    return Table(
        name, _numbers("restitution", top["restitution"]), _numbers("friction", top["friction"]), grids, stretch
    )


def _numbers(key: str, given: object) -> Array:
    try:
        return np.array(given, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{key} = {validation.shown(given)}: allowed are numbers") from None


def measured(paths: Sequence[str]) -> list[Table]:
    """Return the tables in files of the experiment `face-response`, one of each; raises InputError, naming the file."""
    tables = []
    for path in paths:
        found = reader.open_results(path)
        there = all(name in found.variables for name in (*_GRIDS, "restitution", "friction"))
        if not there or "stretch" not in found.attrs or found["chi"].dims != ("restitution", "friction"):
            raise InputError(f"{path}: no file of the experiment face-response: allowed is one (make shapes)")
        grids = {name: np.asarray(found[name].values) for name in _GRIDS}
        restitution, friction = (np.asarray(found[name].values) for name in ("restitution", "friction"))
        try:
            tables.append(Table(Path(path).stem, restitution, friction, grids, float(found.attrs["stretch"])))
        except InputError as error:
            raise error.within(path) from None
    return tables

"""What an experiment returns: a dataset whose every variable has a meaning and a unit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from stiffdice.dynamics.contact import LAWS
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.simulation import dataset

# What xarray takes for a variable: dimensions, values, attributes.
Variable = tuple[str | Sequence[str], Any, dict[str, Any]]

CONTACT: Variable = ("contact", np.arange(len(LAWS), dtype=np.int8), dataset.CONTACT_ATTRIBUTES)
# What every run has that is on a method's ladder: meaning and unit.
EFFORT_GRID = ("stiffness", "method", "effort")
EFFORTS = {
    "steps": ("number of time steps, 0 where the method takes its own", "1"),
    "tolerance": ("tolerance of a method that controls its own error", "1"),
}

AXIS: Variable = ("axis", np.arange(3, dtype=np.int8), dataset.AXIS_ATTRIBUTES)


def quantity(dimensions: str | Sequence[str], values: Any, meaning: str, unit: str = "1") -> Variable:
    """Return a variable of numbers."""
    return dimensions, values, {"long_name": meaning, "units": unit}


def enum(dimension: str, words: Sequence[str], meaning: str) -> Variable:
    """Return a coordinate whose value k means words[k]."""
    return dimension, np.arange(len(words), dtype=np.int8), enum_attributes(meaning, list(words))


def method_axis(names: Sequence[str]) -> Variable:
    """Return the coordinate of schemes and engines."""
    return enum("method", names, "method")


def of_cells(name: str, values: Any, dimensions: str | Sequence[str] = "") -> Variable:
    """Return a number that cells of sweeps have too: stiffness, steps or omega_h; by default as a coordinate."""
    return dimensions or name, values, dataset.CELL_ATTRIBUTES[name]

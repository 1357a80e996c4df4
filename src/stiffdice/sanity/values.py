"""What holds of every file: labels that name one thing each, and enums that mean something."""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.sanity.bounds import outside


def problems(dataset: xr.Dataset) -> list[str]:
    """Return a line for every label that is not finite or not unique, and every enum with a value without meaning."""
    found: list[str] = []
    for key, variable in dataset.variables.items():
        name, given = str(key), variable.values
        if variable.dims == (key,) and np.issubdtype(given.dtype, np.number):
            found += outside(name, given, np.isfinite(given), "a number that is finite")
            found += outside(name, given, _first_of_its_kind(given), "a label that no other has")
        if "flag_values" in variable.attrs:
            meant = np.atleast_1d(variable.attrs["flag_values"])
            found += outside(name, given, np.isin(given, meant), f"one of {', '.join(map(str, meant))}")
            if len(meant) != len(str(variable.attrs.get("flag_meanings", "")).split()):
                found.append(f"{name}: {len(meant)} flag_values; allowed are as many as flag_meanings")
    return found


def _first_of_its_kind(given: np.ndarray) -> np.ndarray:
    first = np.zeros(given.shape, bool)
    first[np.unique(given, return_index=True)[1]] = True
    return first

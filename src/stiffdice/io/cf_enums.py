"""Enums in files: bytes with CF `flag_values` and `flag_meanings`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

    from stiffdice.io.plain_dataset import PlainVariable

_FLAGS = ("flag_values", "flag_meanings")


def enum_attributes(long_name: str, meanings: Sequence[str]) -> dict[str, Any]:
    """Return the CF attributes of an int8 variable whose value k means meanings[k]."""
    return {
        "long_name": long_name,
        "units": "1",
        "flag_values": np.arange(len(meanings), dtype=np.int8),
        "flag_meanings": " ".join(meanings),
    }


def meanings_of(variable: xr.DataArray | xr.Variable | PlainVariable) -> list[str]:
    """Return what the values 0, 1, ... of an enum mean."""
    return str(variable.attrs["flag_meanings"]).split()


def labelled(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with every enum as words, to select by.

    So `sel(axis="z")` of a run, `sel(contact="gated")` of a frontier, and of a sweep, for all cells of that law.
    """
    words = {}
    for name, part in dataset.variables.items():
        if _FLAGS[1] in part.attrs:
            attributes = {key: value for key, value in part.attrs.items() if key not in _FLAGS}
            words[str(name)] = part.dims, np.array(meanings_of(part))[part.values], attributes
    return dataset.assign(words)

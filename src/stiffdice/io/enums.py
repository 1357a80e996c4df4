"""Enums in files: bytes with CF `flag_values` and `flag_meanings`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr


def enum_attributes(long_name: str, meanings: Sequence[str]) -> dict[str, Any]:
    """Return the CF attributes of an int8 variable whose value k means meanings[k]."""
    return {
        "long_name": long_name,
        "units": "1",
        "flag_values": np.arange(len(meanings), dtype=np.int8),
        "flag_meanings": " ".join(meanings),
    }


def meanings_of(variable: xr.DataArray | xr.Variable) -> list[str]:
    """Return what the values 0, 1, ... of an enum mean."""
    return str(variable.attrs["flag_meanings"]).split()

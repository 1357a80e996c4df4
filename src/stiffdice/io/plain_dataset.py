"""A dataset as a file holds it, without xarray: importing that takes longer than most commands work."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt


class PlainVariable(NamedTuple):
    """A variable: names of its dimensions, values, attributes; xarray takes it as it is."""

    dims: tuple[str, ...]
    values: npt.NDArray[Any]
    attrs: Mapping[str, Any]


class PlainDataset(NamedTuple):
    """A dataset: variables and coordinates by name, attributes; `xarray.Dataset(*plain)` is the same of xarray's."""

    data_vars: Mapping[str, PlainVariable]
    coords: Mapping[str, PlainVariable]
    attrs: Mapping[str, Any]

    def assign(self, variables: Mapping[str, PlainVariable]) -> PlainDataset:
        """Return the dataset with more variables."""
        return self._replace(data_vars={**self.data_vars, **variables})

    @property
    def variables(self) -> dict[str, PlainVariable]:
        """All variables, coordinates after the others."""
        return {**self.data_vars, **self.coords}

    @property
    def sizes(self) -> dict[str, int]:
        """The lengths of the dimensions."""
        shapes = ((variable.dims, np.shape(variable.values)) for variable in self.variables.values())
        return {name: length for dims, shape in shapes for name, length in zip(dims, shape, strict=True)}

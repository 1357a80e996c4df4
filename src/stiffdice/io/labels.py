"""Enums as words, for people: a file has them as CF flags, small and the same for every reader."""

from __future__ import annotations

from os import PathLike

import numpy as np
import xarray as xr

from stiffdice.io import quarantine
from stiffdice.io.enums import meanings_of
from stiffdice.io.read import open_file

_FLAGS = ("flag_values", "flag_meanings")


def open_results(path: str | PathLike[str]) -> xr.Dataset:
    """Return the dataset in a file of stiffdice, loaded, with enums as words: `sel(contact="gated")`, `sel(axis="z")`.

    `xarray.open_dataset` opens the same file with the enums as the numbers that are stored. Raises
    stiffdice.errors.InputError, naming the file, if it cannot be read or trusted (docs/trust.md).
    """
    name = str(path)
    quarantine.admit(name)
    return labelled(open_file(name))


def labelled(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with every enum as words, to select by.

    So `sel(axis="z")` of a run, `sel(contact="gated")` of a frontier, and of a sweep, for all cells of that law.
    """
    words = {str(name): _words(part) for name, part in dataset.variables.items() if _FLAGS[1] in part.attrs}
    return dataset.assign(words)


def _words(variable: xr.Variable) -> xr.Variable:
    texts = np.array(meanings_of(variable))[variable.values]
    attributes = {name: value for name, value in variable.attrs.items() if name not in _FLAGS}
    return xr.Variable(variable.dims, texts, attributes)

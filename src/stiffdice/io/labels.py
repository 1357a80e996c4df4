"""Enums as words, for people: a file has them as CF flags, small and the same for every reader."""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.io.enums import meanings_of

_FLAGS = ("flag_values", "flag_meanings")


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

"""Enums as words, for people: a file has them as CF flags, small and the same for every reader."""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.io.enums import meanings_of

_FLAGS = ("flag_values", "flag_meanings")


def labelled(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset with every enum as text; what has one dimension and is a coordinate can be selected by word.

    So `sel(axis="z")` of a run, `sel(contact="gated")` of a frontier, and of the cells of a sweep.
    """
    words = {str(name): _words(part) for name, part in dataset.variables.items() if _FLAGS[1] in part.attrs}
    found = dataset.drop_indexes([name for name in words if name in dataset.indexes]).assign_coords(
        {name: variable for name, variable in words.items() if name in dataset.coords}
    )
    found = found.assign({name: variable for name, variable in words.items() if name not in dataset.coords})
    for name in words:
        if name in found.coords and found[name].ndim == 1 and name not in found.xindexes:
            found = found.set_xindex(name)
    return found


def _words(variable: xr.Variable) -> xr.Variable:
    texts = np.array(meanings_of(variable))[variable.values]
    attributes = {name: value for name, value in variable.attrs.items() if name not in _FLAGS}
    return xr.Variable(variable.dims, texts, attributes)

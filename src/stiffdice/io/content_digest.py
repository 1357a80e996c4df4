"""The runs of a sweep as one SHA-256, however its cells are dealt to files; and attributes as every reader has them.

Of each cell are hashed the names, dimensions, types and values of its variables, each with its length before it, in
sorted order. Chunks, compression, the order of variables and byte order leave the digest as it is. A number counts by
its bits: 0.0 and -0.0 differ; NaN is one value, whatever its sign and payload.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

# What a cell of a sweep is known by, whichever shard holds it.
CELL = ("contact", "stiffness", "steps")

# The SHA-256 of each of some cells, shape (cell,).
DIGEST = np.dtype("V32")
Digests = npt.NDArray[np.void]

_LENGTH = 8  # bytes of the number that says how long a piece is
_BLOCK = 1 << 22  # bytes of cells to put in rows at a time

Plain = str | int | float | tuple[Any, ...]


def runs_digest(parts: Iterable[Digests]) -> str:
    """Return one SHA-256 of all cells whose digests these are, dealt to parts in whatever way and order.

    A cell that is there twice counts twice.
    """
    cells = np.concatenate([np.empty(0, DIGEST), *parts])
    cells.sort()
    whole = hashlib.sha256(b"stiffdice runs 1\n")
    whole.update(cells.view(np.uint8).data)
    return whole.hexdigest()


def cell_digests(part: xr.Dataset) -> Digests:
    """Return for each cell the SHA-256 of its contact law, stiffness, steps, and of the values of all its members.

    part: a shard, or some of its cells (`io.reader.parts`). Hashed are all variables of dimension cell, by name, with
    their types and what other dimensions they have; no attributes. Raises TypeError for types not in our shards, text
    among them.
    """
    head = [b"stiffdice cell 1"]
    values = []
    for name in sorted(str(name) for name, variable in part.variables.items() if "cell" in variable.dims):
        variable = part.variables[name].transpose("cell", ...)
        if variable.dtype.kind not in "biuf":
            raise TypeError(f"a variable of cells of type {variable.dtype}")
        others = " ".join(f"{dimension}={size}" for dimension, size in list(variable.sizes.items())[1:])
        head += [name.encode(), others.encode(), type_of(variable.dtype).encode()]
        values.append(variable.values)
    start = hashlib.sha256(b"".join(_length(len(piece)).tobytes() + piece for piece in head))
    count = part.sizes["cell"]
    width = sum(array.nbytes for array in values) // max(1, count)
    step = max(1, _BLOCK // max(1, width))
    digests = []
    for first in range(0, count, step):
        for row in _rows([array[first : first + step] for array in values]):
            digest = start.copy()
            digest.update(row.data)
            digests.append(digest.digest())
    return np.frombuffer(b"".join(digests), DIGEST)


def _rows(values: list[npt.NDArray[Any]]) -> npt.NDArray[np.uint8]:
    """Return in one row for each cell its pieces one after another, each with its length before it: what is hashed.

    One call for a cell instead of two for each of its variables: a sweep may have millions of cells of one member.
    """
    columns = []
    for array in values:
        image = _canonical(array).reshape(len(array), -1).view(np.uint8)
        columns += [np.broadcast_to(_length(image.shape[1]), (len(array), _LENGTH)), image]
    return np.concatenate(columns, axis=1)


def _length(count: int) -> npt.NDArray[np.uint8]:
    return np.frombuffer(count.to_bytes(_LENGTH, "little"), np.uint8)


def _canonical(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return numbers in one piece, little endian, with one NaN."""
    image = np.array(values, values.dtype.newbyteorder("<"), order="C")
    if image.dtype.kind == "f":
        image[np.isnan(image)] = np.nan
    return image


def plain(value: Any) -> Plain:
    """Return an attribute as text, a number, or a tuple of them, the same from every reader.

    Readers do not agree on the width of its numbers, and on whether a single one is an array. Raises TypeError for what
    no netCDF attribute can be.
    """
    if isinstance(value, bytes | np.bytes_):
        return bytes(value).decode("utf-8", "surrogateescape")
    if isinstance(value, str):
        return str(value)
    if isinstance(value, np.ndarray | list | tuple):
        parts = tuple(plain(part) for part in np.asarray(value).ravel().tolist())
        return parts[0] if len(parts) == 1 else parts
    if isinstance(value, bool | int | np.integer | np.bool_):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value)
    raise TypeError(f"an attribute of type {type(value).__name__}")


def type_of(dtype: np.dtype[Any]) -> str:
    """Return the kind and width of a variable's type: f8, i1."""
    return f"{dtype.kind}{dtype.itemsize}"

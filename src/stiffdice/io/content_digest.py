"""The runs of a sweep as one SHA-256, however its cells are dealt to files; and attributes as every reader has them.

Of each cell are hashed the names, dimensions, types and values of its variables, each with its length before it, in
sorted order. Chunks, compression, the order of variables and byte order leave the digest as it is. A number counts by
its bits: 0.0 and -0.0 differ; NaN is one value, whatever its sign and payload.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    import xarray as xr

# What a cell of a sweep is known by, whichever shard holds it.
CELL = ("contact", "stiffness", "steps")

# The SHA-256 of each of some cells, shape (cell,).
DIGEST = np.dtype("V32")
Digests = npt.NDArray[np.void]

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
    head, columns = [b"stiffdice cell 1"], []
    for name in sorted(str(name) for name, variable in part.variables.items() if "cell" in variable.dims):
        variable = part.variables[name].transpose("cell", ...)
        if variable.dtype.kind not in "biuf":
            raise TypeError(f"a variable of cells of type {variable.dtype}")
        others = " ".join(f"{dimension}={size}" for dimension, size in list(variable.sizes.items())[1:])
        head += [name.encode(), others.encode(), type_of(variable.dtype).encode()]
        image = np.array(variable.values, variable.dtype.newbyteorder("<"), order="C")
        if image.dtype.kind == "f":
            image[np.isnan(image)] = np.nan
        image = image.reshape(len(image), math.prod(image.shape[1:])).view(np.uint8)
        length = np.frombuffer(_length(image.shape[1]), np.uint8)
        columns += [np.broadcast_to(length, (len(image), len(length))), image]
    start = hashlib.sha256(b"".join(_length(len(piece)) + piece for piece in head))
    digests = []
    # In one row for each cell its pieces: one call for it instead of two for each of its variables, as a sweep may have
    # millions of cells of one member.
    for row in np.concatenate(columns, axis=1):
        digest = start.copy()
        digest.update(row.data)
        digests.append(digest.digest())
    return np.frombuffer(b"".join(digests), DIGEST)


def _length(count: int) -> bytes:
    return count.to_bytes(8, "little")


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

"""What a dataset says, as one SHA-256, however it is stored.

Hashed are names, dimensions, types, values and attributes, each with its length before it, in sorted order. Chunks,
compression, the order of variables, byte order and the library that read them leave the digest as it is.

- A number counts by its bits: 0.0 and -0.0 differ. NaN is one value, whatever its sign and payload.
- The type of a variable is its kind and width (`f8`, `i1`); text of any length is one type.
- An attribute is text, a whole number, a fraction, or an array of them. Of what width its numbers were stored, and
  whether a single one was stored as an array of one, is not asked: readers do not agree on it.
- Which variables are coordinates is not asked either: it is told in an attribute that readers keep to themselves.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Hashable, Iterable, Mapping, Sequence
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


def data_digest(dataset: xr.Dataset) -> str:
    """Return the SHA-256 of what a dataset says, in hexadecimal digits; raises TypeError for types not in our files."""
    digest = _Digest("stiffdice data 1")
    _put_attributes(digest, dataset.attrs)
    for name in sorted(map(str, dataset.variables)):
        variable = dataset.variables[name]
        digest.put(name)
        _put_dimensions(digest, variable.dims, variable.shape)
        digest.put(type_of(variable.dtype))
        digest.put(_image(variable.values))
        _put_attributes(digest, variable.attrs)
    return digest.hexdigest()


def runs_digest(parts: Iterable[xr.Dataset]) -> str:
    """Return one SHA-256 of all runs of a sweep, however its cells are dealt to shards, and in whatever order.

    parts: shards, or some cells of one at a time (`io.reader.parts`), dimension cell: in memory is one part, and 32
    bytes for each cell before it. A cell that is there twice counts twice. Attributes do not count.
    """
    return digest_of_cells(map(cell_digests, parts))


def digest_of_cells(parts: Iterable[Digests]) -> str:
    """Return the one SHA-256 of all cells whose digests these are, dealt to parts in whatever way and order."""
    cells = np.concatenate([np.empty(0, DIGEST), *parts])
    cells.sort()
    whole = hashlib.sha256(b"stiffdice runs 1\n")
    whole.update(cells.view(np.uint8).data)
    return whole.hexdigest()


def cell_digests(part: xr.Dataset) -> Digests:
    """Return for each cell the SHA-256 of its contact law, stiffness, steps, and of the values of all its members.

    Hashed are all variables of dimension cell, by name, with their types and what other dimensions they have. Raises
    TypeError for types not in our shards, text among them.
    """
    head = _Digest("stiffdice cell 1")
    values = []
    for name in sorted(str(name) for name, variable in part.variables.items() if "cell" in variable.dims):
        variable = part.variables[name].transpose("cell", ...)
        if variable.dtype.kind not in "biuf":
            raise TypeError(f"a variable of cells of type {variable.dtype}")
        head.put(name)
        _put_dimensions(head, variable.dims[1:], variable.shape[1:])
        head.put(type_of(variable.dtype))
        values.append(variable.values)
    count = part.sizes["cell"]
    width = sum(array.nbytes for array in values) // max(1, count)
    step = max(1, _BLOCK // max(1, width))
    digests = [
        head.copy().put_raw(row).digest()
        for first in range(0, count, step)
        for row in _pieces([array[first : first + step] for array in values])
    ]
    return np.frombuffer(b"".join(digests), DIGEST)


def _pieces(values: Sequence[npt.NDArray[Any]]) -> npt.NDArray[np.uint8]:
    """Return in one row for each cell its pieces one after another, each with its length before it: what is hashed.

    One call for a cell instead of two for each of its variables: a sweep may have millions of cells of one member.
    """
    columns = []
    for array in values:
        image = _canonical(array).reshape(len(array), -1).view(np.uint8)
        columns += [np.broadcast_to(_length(image.shape[1]), (len(array), _LENGTH)), image]
    return np.concatenate(columns, axis=1)


def plain(value: Any) -> Plain:
    """Return an attribute as text, a number, or a tuple of them, the same from every reader.

    Raises TypeError for what no netCDF attribute can be.
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
    """Return the kind and width of a variable's type, `text` for any text; raises TypeError for others."""
    if dtype.kind in "OUST":
        return "text"
    if dtype.kind in "biuf":
        return f"{dtype.kind}{dtype.itemsize}"
    raise TypeError(f"a variable of type {dtype}")


class _Digest:
    """A SHA-256 of pieces, each with its length before it, so that no two lists of them are the same bytes."""

    def __init__(self, title: str) -> None:
        self._hash = hashlib.sha256()
        self.put(title)

    def put(self, piece: str | bytes | memoryview) -> None:
        data = piece.encode("utf-8", "surrogateescape") if isinstance(piece, str) else piece
        self._hash.update(len(data).to_bytes(_LENGTH, "little"))
        self._hash.update(data)

    def put_raw(self, pieces: npt.NDArray[np.uint8]) -> _Digest:
        """Add pieces that have their lengths before them, and return the digest."""
        self._hash.update(pieces.data)
        return self

    def copy(self) -> _Digest:
        other = object.__new__(_Digest)
        other._hash = self._hash.copy()
        return other

    def digest(self) -> bytes:
        return self._hash.digest()

    def hexdigest(self) -> str:
        return self._hash.hexdigest()


def _length(count: int) -> npt.NDArray[np.uint8]:
    return np.frombuffer(count.to_bytes(_LENGTH, "little"), np.uint8)


def _put_dimensions(digest: _Digest, names: Iterable[Hashable], shape: Iterable[int]) -> None:
    digest.put(" ".join(f"{name}={size}" for name, size in zip(names, shape, strict=True)))


def _put_attributes(digest: _Digest, attributes: Mapping[Any, Any]) -> None:
    digest.put(str(len(attributes)))
    for name in sorted(map(str, attributes)):
        digest.put(name)
        _put_plain(digest, plain(attributes[name]))


def _put_plain(digest: _Digest, value: Plain) -> None:
    if isinstance(value, str):
        digest.put("text")
        digest.put(value)
    elif isinstance(value, tuple):
        digest.put(f"array {len(value)}")
        for part in value:
            _put_plain(digest, part)
    elif isinstance(value, int):
        digest.put("whole")
        digest.put(str(value))
    else:
        digest.put("fraction")
        digest.put(struct.pack("<d", np.nan if np.isnan(value) else value))


def _image(values: npt.NDArray[Any]) -> memoryview | bytes:
    """Return values as bytes: numbers little endian, NaN the same everywhere; each text with its length before it."""
    if values.dtype.kind in "OUST":
        texts = [str(plain(value)).encode("utf-8", "surrogateescape") for value in values.ravel().tolist()]
        return b"".join(len(text).to_bytes(8, "little") + text for text in texts)
    return _canonical(values).reshape(-1).view(np.uint8).data


def _canonical(values: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return numbers in one piece, little endian, with one NaN."""
    image = np.ascontiguousarray(values, values.dtype.newbyteorder("<"))
    if image.dtype.kind == "f":
        holes = np.isnan(image)
        if holes.any():
            image = np.where(holes, np.array(np.nan, image.dtype), image).astype(image.dtype, copy=False)
    return image

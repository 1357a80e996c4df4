"""What a file of ours is made of: checked with h5py alone, before a value is read, and without following a link.

Nothing is said of physics here: variables at the top of the file, of plain numbers, with what netCDF-4 needs to read
them, all of it inside the file, none of it missing, and no more in all than a file of its size may hold.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import h5py
import numpy as np

from stiffdice.errors import RefusedError
from stiffdice.io import attribute_check

MOST_VARIABLES = 1000  # the project's own files have up to 60
MOST_DIMENSIONS = 8  # of one variable; up to 4
MOST_CHUNKS = 50_000  # of a variable; the HDF5 library takes up to 7 kB of memory for each, however small
LARGEST_PIECE = 2 << 20  # bytes of a chunk, or of a variable without chunks; h5py's own choice is 1 MiB at most
MOST_BYTES = 1 << 34  # of all values of a file
# Values in memory come to so many bytes for one of the file, or to so many in all: trajectories at rest pack well.
MOST_RATIO, ALWAYS_ALLOWED = 100, 1 << 29
MOST_TEXT = 10_000_000  # characters of all attributes; many may share one text in the file

_NAME = re.compile("[A-Za-z][A-Za-z0-9_]*")
# h5netcdf takes this away wherever it finds it in a name; two variables could get one name.
_TAKEN_AWAY = "_nc4_non_coord_"
# What h5netcdf and netCDF write in NAME of a dimension that has no values.
_BARE = "This is a netCDF dimension but not a netCDF variable"

_FILTERS = {
    h5py.h5z.FILTER_SHUFFLE: "shuffle",
    h5py.h5z.FILTER_DEFLATE: "gzip",
    h5py.h5z.FILTER_FLETCHER32: "fletcher32",
}


class Contents(NamedTuple):
    """What a checked file holds; dimensions that have no values of their own are no variables.

    coordinates: the names of the variables that say where the others are. meanings: how many values an enum may have,
    by its name. sizes: bytes of a variable, by its name. dimensions: names of its axes, by its name. attributes: what
    it says of itself, by its name; those of the file itself by none (""). What netCDF-4 keeps for itself is left out.
    """

    coordinates: frozenset[str]
    meanings: Mapping[str, int]
    sizes: Mapping[str, int]
    dimensions: Mapping[str, tuple[str, ...]]
    attributes: Mapping[str, Mapping[str, Any]]


def check(file: h5py.File, length: int) -> Contents:
    """Return what an open file of so many bytes holds; raises RefusedError naming the variable if it is not ours."""
    if file.userblock_size:
        raise RefusedError(f"has {file.userblock_size} bytes before its HDF5 content; our files have none")
    about = attribute_check.check_all("the file", file)
    items = _items(file)
    sizes = {name: _size_of(name, item.dataset) for name, item in items.items()}
    total, most = sum(sizes.values()), min(MOST_BYTES, max(ALWAYS_ALLOWED, MOST_RATIO * length))
    if total > most:
        raise RefusedError(f"holds {_shown(total)} in a file of {_shown(length)}: allowed are {_shown(most)}")
    for name, item in items.items():
        _check_storage(name, item, sizes[name])
    dimensions = _dimensions(file, items)
    variables = {name: item for name, item in items.items() if not item.is_bare}
    meanings = {}
    for name, item in variables.items():
        attribute_check.check_description(name, item.about)
        meanings[name] = attribute_check.check_enum(name, item.about, item.dataset.dtype.kind == "i")
    return Contents(
        frozenset(_coordinates(file, variables)),
        {name: count for name, count in meanings.items() if count},
        {name: sizes[name] for name in variables},
        {name: dimensions[name] for name in variables},
        {"": _told(about), **{name: _told(item.about) for name, item in variables.items()}},
    )


class _Item(NamedTuple):
    """A dataset and its attributes."""

    dataset: h5py.Dataset
    about: Mapping[str, Any]

    @property
    def is_scale(self) -> bool:
        """Whether it is a dimension: with its values, or bare."""
        return "CLASS" in self.about

    @property
    def is_bare(self) -> bool:
        """Whether it only stands for a dimension and has no values."""
        return self.is_scale and _BARE in self.about.get("NAME", "")


def _items(file: h5py.File) -> dict[str, _Item]:
    """Return every dataset with its attributes, by name; raises RefusedError where their text is too long in all."""
    items, text = {}, 0
    for name, dataset in _datasets(file).items():
        items[name] = _Item(dataset, attribute_check.check_all(name, dataset))
        text += sum(len(value) for value in items[name].about.values() if isinstance(value, str))
        if text > MOST_TEXT:
            raise RefusedError(f"{name}: more than {MOST_TEXT} characters in the attributes of a file")
    return items


def _datasets(file: h5py.File) -> dict[str, h5py.Dataset]:
    """Return everything in a file, by name; raises RefusedError at what is not a dataset of its own."""
    count = file.id.get_num_objs()
    if count > MOST_VARIABLES:
        raise RefusedError(f"holds {count} variables: allowed are {MOST_VARIABLES}")
    datasets, places = {}, set()
    for raw in file.id:
        name = _name(raw)
        if file.id.links.get_info(raw).type != h5py.h5l.TYPE_HARD:
            raise RefusedError(f"{name}: a link that points elsewhere; our files have none")
        about = h5py.h5o.get_info(file.id, raw)
        if about.type != h5py.h5o.TYPE_DATASET:
            kind = "a group" if about.type == h5py.h5o.TYPE_GROUP else "a named type"
            raise RefusedError(f"{name}: {kind}; our files have variables alone")
        if about.rc != 1 or about.addr in places:
            raise RefusedError(f"{name}: one variable under two names; our files have one name for each")
        places.add(about.addr)
        datasets[name] = h5py.Dataset(h5py.h5d.open(file.id, raw))
    return datasets


def _name(raw: bytes) -> str:
    name = raw.decode("utf-8", "replace")
    if not _NAME.fullmatch(name) or _TAKEN_AWAY in name:
        raise RefusedError(f"{attribute_check.shown(name)}: allowed in a name are letters, digits and underscores")
    return name


def _size_of(name: str, dataset: h5py.Dataset) -> int:
    """Return how many bytes a variable is said to have; raises RefusedError unless it is numbers, and not too many."""
    if not attribute_check.is_number(dataset.id.get_type()):
        raise RefusedError(f"{name}: type {_type_of(dataset)}: allowed are {', '.join(attribute_check.NUMBERS)}")
    if dataset.id.get_space().get_simple_extent_type() == h5py.h5s.NULL:
        raise RefusedError(f"{name}: has no shape; our variables have one")
    shape = dataset.shape
    if len(shape) > MOST_DIMENSIONS:
        raise RefusedError(f"{name}: has {len(shape)} dimensions: allowed are {MOST_DIMENSIONS}")
    size = math.prod(shape) * dataset.dtype.itemsize
    if size > MOST_BYTES or max(shape, default=0) > MOST_BYTES:
        told = " × ".join(map(str, shape))
        raise RefusedError(f"{name}: is {told} numbers ({_shown(size)}): allowed are {_shown(MOST_BYTES)}")
    return size


def _check_storage(name: str, item: _Item, size: int) -> None:
    """Raise RefusedError unless a variable's values are in the file, all of them."""
    dataset = item.dataset
    plan = dataset.id.get_create_plist()
    layout = plan.get_layout()
    if plan.get_external_count() or layout == h5py.h5d.VIRTUAL:
        raise RefusedError(f"{name}: keeps its data outside of this file")
    filters = [plan.get_filter(k)[0] for k in range(plan.get_nfilters())]
    if len(set(filters)) < len(filters) or not set(filters) <= set(_FILTERS):
        raise RefusedError(f"{name}: filters {filters}: allowed are {', '.join(_FILTERS.values())}, each once")
    if layout == h5py.h5d.CHUNKED:
        _check_chunks(name, item)
    elif layout == h5py.h5d.CONTIGUOUS:
        _check_block(name, item, size)
    else:
        raise RefusedError(f"{name}: allowed are values in chunks or in one block")


def _type_of(dataset: h5py.Dataset) -> str:
    try:
        return str(dataset.dtype)
    except (TypeError, ValueError):
        return "unknown"


def _check_chunks(name: str, item: _Item) -> None:
    dataset = item.dataset
    piece = math.prod(dataset.chunks) * dataset.dtype.itemsize
    if piece > LARGEST_PIECE:
        raise RefusedError(f"{name}: chunks of {_shown(piece)}: allowed are {_shown(LARGEST_PIECE)}")
    expected = math.prod(-(-size // chunk) for size, chunk in zip(dataset.shape, dataset.chunks, strict=True))
    if expected > MOST_CHUNKS and not item.is_bare:
        raise RefusedError(f"{name}: is in {expected} chunks: allowed are {MOST_CHUNKS}")
    found = dataset.id.get_num_chunks() if dataset.id.get_space_status() != h5py.h5d.SPACE_STATUS_NOT_ALLOCATED else 0
    if found != expected and not (item.is_bare and found == 0):
        raise RefusedError(f"{name}: {found} of its {expected} chunks are there; its values are not whole")
    places = set()
    for chunk in _chunks(dataset) if found else ():
        places.add(chunk.chunk_offset)
        grid = zip(chunk.chunk_offset, dataset.shape, dataset.chunks, strict=True)
        if any(offset >= size or offset % step for offset, size, step in grid):
            raise RefusedError(f"{name}: a chunk at {chunk.chunk_offset}, where none of its values are")
        if chunk.filter_mask:
            raise RefusedError(f"{name}: a chunk without its filters; its checksum would not be checked")
    if len(places) < found:
        raise RefusedError(f"{name}: two chunks for the same values")


def _chunks(dataset: h5py.Dataset) -> list[h5py.h5d.StoreInfo]:
    chunks: list[h5py.h5d.StoreInfo] = []
    dataset.id.chunk_iter(chunks.append)
    return chunks


def _check_block(name: str, item: _Item, size: int) -> None:
    if size > LARGEST_PIECE:
        raise RefusedError(f"{name}: {_shown(size)} in one block: allowed are {_shown(LARGEST_PIECE)}")
    if size and not item.is_bare and item.dataset.id.get_offset() is None:
        raise RefusedError(f"{name}: has no values; our variables have them")


def _dimensions(file: h5py.File, items: Mapping[str, _Item]) -> dict[str, tuple[str, ...]]:
    """Return the names of the axes; raises RefusedError unless each is a dimension of the file, and as long."""
    scales, names, numbers = {}, {}, set()
    for name, item in items.items():
        if not item.is_scale:
            continue
        number = item.about.get("_Netcdf4Dimid")
        if item.dataset.ndim != 1 or not isinstance(number, np.integer) or number in numbers:
            raise RefusedError(f"{name}: a dimension has one axis, and a number (_Netcdf4Dimid) of its own")
        if np.atleast_1d(item.about.get("_Netcdf4Coordinates", number)).tolist() != [number]:
            raise RefusedError(f"{name}: _Netcdf4Coordinates names another dimension than its own")
        if "DIMENSION_LIST" in item.about:
            raise RefusedError(f"{name}: a dimension that has dimensions (DIMENSION_LIST)")
        numbers.add(number)
        place = h5py.h5o.get_info(item.dataset.id).addr
        scales[place], names[place] = item.dataset.shape[0], name
    dimensions: dict[str, tuple[str, ...]] = {name: (name,) for name in names.values()}
    for name, item in items.items():
        if item.is_scale:
            continue
        found = list(_scales_of(file, name, item))
        if [scales.get(place) for place in found] != list(item.dataset.shape):
            raise RefusedError(f"{name}: DIMENSION_LIST: allowed is a dimension of this file for each axis, as long")
        if len(set(found)) < len(found):
            raise RefusedError(f"{name}: DIMENSION_LIST names a dimension twice")
        dimensions[name] = tuple(names[place] for place in found)
    return dimensions


def _scales_of(file: h5py.File, name: str, item: _Item) -> Iterator[int]:
    """Yield where in the file the dimension of each axis is."""
    for references in item.dataset.attrs["DIMENSION_LIST"] if "DIMENSION_LIST" in item.about else ():
        if len(references) != 1 or not references[0]:
            raise RefusedError(f"{name}: DIMENSION_LIST: allowed is one dimension for each axis")
        yield h5py.h5o.get_info(h5py.h5r.dereference(references[0], file.id)).addr


def _coordinates(file: h5py.File, variables: Mapping[str, _Item]) -> Iterator[str]:
    """Yield the names of the variables that say where others are, as CF has it."""
    yield from (name for name, item in variables.items() if item.is_scale)
    for named in (
        file.attrs.get("coordinates", ""),
        *(item.about.get("coordinates", "") for item in variables.values()),
    ):
        yield from (word for word in str(named).split() if word in variables)


# What netCDF-4 keeps for itself, and which variables are coordinates, which is told apart.
_ITS_OWN = frozenset(
    (
        *("CLASS", "NAME", "DIMENSION_LIST", "REFERENCE_LIST", "_Netcdf4Dimid", "_Netcdf4Coordinates", "coordinates"),
        *("_NCProperties", "_nc3_strict"),
    )
)


def _told(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is said of a file or variable to those that read it: a list of one value is a value."""
    kept = {key: value for key, value in about.items() if key not in _ITS_OWN}
    return {key: value[0] if np.shape(value) == (1,) else value for key, value in kept.items()}


def _shown(size: int) -> str:
    """Return a number of bytes for people."""
    for unit in ("bytes", "kB", "MB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000  # type: ignore[assignment]
    return f"{size:.3g} GB"

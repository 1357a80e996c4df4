"""A file opened as HDF5, once seal, version and structure are ours: checked with h5py alone, before a value is read.

No link is followed. Ours have variables at the top, of plain numbers that are stored in the file, and attributes of
plain text and plain numbers.
What is broken deeper in a file ends the process that reads it first (`io.isolation`).
"""

from __future__ import annotations

import hashlib
import json
import math
import re
import stat
import unicodedata
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from stiffdice.errors import InputError, RefusedError, printable
from stiffdice.io import seal

# Of the HDF5 files; the part before the dot changes when an older reader could not understand them.
FORMAT_VERSION = "1.3"

# Values in memory come to so many bytes for one of the file, or to so many in all: trajectories at rest pack well.
MOST_RATIO, ALWAYS_ALLOWED = 100, 1 << 29

_NAME = re.compile("[A-Za-z][A-Za-z0-9_]*")
_VERSION = re.compile(r"(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)")
# Versions of the format whose files had no seal.
_UNSEALED = ("1.0", "1.1")

_NUMBERS = ("int8", "int16", "int32", "int64", "float32", "float64")
_KINDS = ("STD_I8", "STD_I16", "STD_I32", "STD_I64", "IEEE_F32", "IEEE_F64")
_TYPES = [getattr(h5py.h5t, kind + order) for kind in _KINDS for order in ("LE", "BE")]
_FILTERS = {
    h5py.h5z.FILTER_SHUFFLE: "shuffle",
    h5py.h5z.FILTER_DEFLATE: "gzip",
    h5py.h5z.FILTER_FLETCHER32: "fletcher32",
}

# Which dimensions a variable has, and which variables a dimension: references, read apart or not at all.
_REFERENCES = ("DIMENSION_LIST", "REFERENCE_LIST")
# What netCDF-4 keeps for itself, and which variables are coordinates.
_ITS_OWN = frozenset(
    ("CLASS", "NAME", "_Netcdf4Dimid", "_Netcdf4Coordinates", "coordinates", "_NCProperties", "_nc3_strict")
)
# What h5netcdf and netCDF write in NAME of a dimension that has no values.
_BARE = "This is a netCDF dimension but not a netCDF variable"
# With these, readers change the numbers while they read them (CF, section 8.1, and xarray); our files have none.
_CHANGING = ("_FillValue", "missing_value", "scale_factor", "add_offset", "_Unsigned", "_Encoding", "dtype")


class Variable(NamedTuple):
    """A variable of a checked file: names of its axes, bytes of its values, its attributes.

    words: how many values it may have as an enum, 0 of what is none. is_coordinate: whether it says where others are.
    """

    dimensions: tuple[str, ...]
    size: int
    words: int
    is_coordinate: bool
    attributes: Mapping[str, Any]


class Contents(NamedTuple):
    """What a checked file holds: its attributes without what netCDF-4 keeps for itself, and its variables by name.

    Dimensions that have no values of their own are no variables.
    """

    attributes: Mapping[str, Any]
    variables: Mapping[str, Variable]


def check_version(file: h5py.File, sealed: bool) -> None:
    """Raise RefusedError unless a file is of a version of the format that this code can read.

    Of the same first number all can be read, those of later programs, too: a file of a later version has more in it
    than this code knows of, and nothing that means something else. From 1.2 on a file has a seal.
    """
    _demand("format_version" in file.attrs, "has no format_version; not a file of stiffdice")
    version, first = file.attrs["format_version"], FORMAT_VERSION.split(".", maxsplit=1)[0]
    known = isinstance(version, str) and _VERSION.fullmatch(version) and version.split(".")[0] == first
    _demand(known, f"format_version = {shown(version)}: allowed is {first}.x")
    sealed = sealed or version in _UNSEALED
    _demand(sealed, "damaged: has no seal at its end; it is cut short, or was changed by another program")


def _demand(holds: object, told: str) -> None:
    """Raise RefusedError unless something holds."""
    if not holds:
        raise RefusedError(told)


def check(file: h5py.File, length: int) -> Contents:
    """Return what an open file of so many bytes holds; raises RefusedError naming the variable if it is not ours."""
    about = _attributes("the file", file)
    _check_scene(about)
    datasets = dict(plain_datasets(file))
    owns = {name: _attributes(name, dataset) for name, dataset in datasets.items()}
    scales = {name for name, own in owns.items() if own.get("CLASS") == "DIMENSION_SCALE"}
    names = [name for name in datasets if name not in scales or _BARE not in str(owns[name].get("NAME"))]
    sizes = {name: math.prod(datasets[name].shape) * datasets[name].dtype.itemsize for name in names}
    check_size(sum(sizes.values()), length)
    dimensions = _dimensions(file, datasets, scales)
    listed = scales.union(*(str(own.get("coordinates", "")).split() for own in (about, *owns.values())))
    variables = {}
    for name in names:
        words, own = _words(name, datasets[name], owns[name]), _public(owns[name])
        variables[name] = Variable(dimensions[name], sizes[name], words, name in listed, own)
    return Contents(_public(about), variables)


def check_size(total: int, length: int) -> None:
    """Raise RefusedError for values of more bytes in memory than a file of so many should hold."""
    most = max(ALWAYS_ALLOWED, MOST_RATIO * length)
    told = f"holds {total / 1e6:.4g} MB in a file of {length / 1e6:.4g} MB: allowed are {most / 1e6:.4g} MB"
    _demand(total <= most, told)


def plain_datasets(file: h5py.File) -> Iterator[tuple[str, h5py.Dataset]]:
    """Yield everything in a file with its name; raises RefusedError at what is not plain numbers stored in it."""
    for raw in file.id:
        name = raw.decode("utf-8", "replace")
        _demand(_NAME.fullmatch(name), f"{shown(name)}: allowed in a name are letters, digits and underscores")
        is_here = file.id.links.get_info(raw).type == h5py.h5l.TYPE_HARD
        _demand(is_here, f"{name}: a link that points elsewhere; our files have none")
        is_variable = h5py.h5o.get_info(file.id, raw).type == h5py.h5o.TYPE_DATASET
        _demand(is_variable, f"{name}: a group or a named type; our files have variables alone")
        dataset = h5py.Dataset(h5py.h5d.open(file.id, raw))
        _demand(_is_number(dataset.id.get_type()), f"{name}: its type: allowed are {', '.join(_NUMBERS)}")
        _demand(dataset.shape is not None, f"{name}: has no shape; our variables have one")
        plan = dataset.id.get_create_plist()
        elsewhere = plan.get_external_count() or plan.get_layout() == h5py.h5d.VIRTUAL
        _demand(not elsewhere, f"{name}: keeps its data outside of this file")
        filters = [plan.get_filter(k)[0] for k in range(plan.get_nfilters())]
        known = len(set(filters)) == len(filters) and set(filters) <= set(_FILTERS)
        _demand(known, f"{name}: filters {filters}: allowed are {', '.join(_FILTERS.values())}, each once")
        yield name, dataset


def _is_number(kind: h5py.h5t.TypeID) -> bool:
    return not kind.committed() and any(kind.equal(known) for known in _TYPES)


def _dimensions(
    file: h5py.File, datasets: Mapping[str, h5py.Dataset], scales: Collection[str]
) -> dict[str, tuple[str, ...]]:
    """Return the names of the axes; raises RefusedError unless each is a dimension of the file, and as long."""
    places = {h5py.h5o.get_info(datasets[name].id).addr: name for name in scales}
    dimensions: dict[str, tuple[str, ...]] = {name: (name,) for name in scales}
    for name in scales:
        _demand(datasets[name].ndim == 1, f"{name}: a dimension has one axis")
    for name in [name for name in datasets if name not in scales]:
        dataset = datasets[name]
        found = [
            places.get(h5py.h5o.get_info(h5py.h5r.dereference(reference, file.id)).addr)
            for references in dataset.attrs.get("DIMENSION_LIST", ())
            for reference in references
        ]
        known = tuple(scale for scale in dict.fromkeys(found) if scale)
        fits = len(known) == len(found) and dataset.shape == tuple(len(datasets[scale]) for scale in known)
        _demand(fits, f"{name}: DIMENSION_LIST: allowed is a dimension of this file for each axis, as long")
        dimensions[name] = known
    return dimensions


def _attributes(where: str, item: h5py.File | h5py.Dataset) -> dict[str, Any]:
    """Return the attributes of a file or variable; raises RefusedError at one that is not plain text or numbers."""
    about = {name: _value(where, item, name) for name in item.attrs if name not in _REFERENCES}
    for name in _CHANGING:
        _demand(name not in about, f"{where}: attribute {name}: makes readers change the numbers; our files have none")
    return about


def _value(where: str, item: h5py.File | h5py.Dataset, name: str | bytes) -> Any:
    """Return an attribute's value, once its type is known."""
    place = f"{where}: attribute {shown(name)}"
    if not isinstance(name, str) or not name.isprintable():  # h5py gives bytes that are no text as they are
        raise RefusedError(f"{place}: allowed is a name in plain text")
    attribute = h5py.h5a.open(item.id, name.encode("utf-8"))
    kind, is_null = attribute.get_type(), attribute.get_space().get_simple_extent_type() == h5py.h5s.NULL
    is_text = kind.get_class() == h5py.h5t.STRING
    _demand(is_text or _is_number(kind), f"{place}: allowed are plain text and plain numbers")
    short = not is_null and len(attribute.shape) <= (0 if is_text else 1)
    _demand(short, f"{place}: allowed is one text, one number, or a list of numbers")
    value = item.attrs[name]
    if not is_text:
        return value
    try:
        text = value.decode("utf-8") if isinstance(value, bytes) else str(value)
        text.encode("utf-8")
    except UnicodeError:
        raise RefusedError(f"{place}: is not UTF-8 text") from None
    controls = any(unicodedata.category(sign) == "Cc" and sign not in "\n\t" for sign in text)
    _demand(not controls, f"{place}: has control characters in its text")
    return text


def _public(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the attributes that are not netCDF-4's own; a list of one number is a number."""
    found = {key: value for key, value in about.items() if key not in _ITS_OWN}
    return {key: value[0] if np.shape(value) == (1,) else value for key, value in found.items()}


def _words(name: str, dataset: h5py.Dataset, about: Mapping[str, Any]) -> int:
    """Return how many values an enum has, 0 of what is none.

    Raises RefusedError unless a variable has a name and a unit, and an enum a word for each value.
    """
    for key in ("units", "long_name"):
        said = isinstance(about.get(key), str) and about[key].strip()
        _demand(said, f"{name}: has no {key}; every variable of ours has")
    if "flag_values" not in about and "flag_meanings" not in about:
        return 0
    values, words = np.atleast_1d(about.get("flag_values", ())), str(about.get("flag_meanings", "")).split()
    each = values.tolist() == list(range(len(words))) and 0 < len(words) == len(set(words))
    told = f"{name}: an enum is whole numbers, with flag_values 0, 1, … and a word for each in flag_meanings"
    _demand(each and dataset.dtype.kind == "i", told)
    return len(words)


def _check_scene(about: Mapping[str, Any]) -> None:
    """Raise RefusedError unless the scene in a file is the one whose digest is beside it (`Scene.digest`)."""
    if "scene" not in about:
        return
    try:
        mapping = json.loads(str(about["scene"]))
        text = json.dumps(mapping, sort_keys=True, separators=(",", ":"), allow_nan=False)
    except (ValueError, RecursionError):
        raise RefusedError("the file: attribute scene: allowed is a scene as JSON") from None
    same = isinstance(mapping, dict) and hashlib.sha256(text.encode()).hexdigest() == about.get("scene_digest")
    _demand(same, "the file: attribute scene: is not the scene that scene_digest was made of")


def shown(text: object) -> str:
    """Return what a file says, `printable`, cut to a readable length."""
    plain = printable(text)
    return plain if len(plain) <= 60 else plain[:57] + "..."


@contextmanager
def opened(path: str | Path) -> Iterator[tuple[h5py.File, Contents]]:
    """Give a file of ours and what it holds; raises InputError, not naming the file, if it cannot be trusted."""
    place = Path(path)
    length = length_of(place)
    sealed = seal.check(place)
    with h5py.File(place, "r") as file:
        check_version(file, sealed)
        yield file, check(file, length)


def length_of(path: Path) -> int:
    """Return the bytes of a file; raises InputError, not naming it, for a pipe, which would be waited for."""
    about = path.stat()
    if not stat.S_ISREG(about.st_mode) and not stat.S_ISDIR(about.st_mode):
        raise InputError("is not a regular file")
    return about.st_size


@contextmanager
def told(path: str | Path) -> Iterator[None]:
    """Say in one line, with the file's name, what goes wrong while reading it."""
    try:
        yield
    except InputError as error:
        raise error.within(str(path)) from None
    except MemoryError:
        raise RefusedError(f"{path}: needs more memory than there is") from None
    except (OSError, LookupError, ValueError, RuntimeError, TypeError, ArithmeticError) as error:
        if isinstance(error, OSError) and error.strerror:
            raise InputError(f"{path}: {error.strerror}") from None
        reason = shown(str(error).splitlines()[0] if str(error) else type(error).__name__)
        raise RefusedError(f"{path}: not a readable HDF5 file ({reason})") from None


def check_values(name: str, variable: Variable, values: np.ndarray[Any, Any]) -> None:
    """Raise RefusedError at a coordinate that is not finite, and at an enum's value that has no word.

    Results may well be NaN or infinite: runs blow up.
    """
    if variable.is_coordinate and values.dtype.kind == "f" and not np.isfinite(values).all():
        raise RefusedError(f"{name}: a coordinate that is not finite")
    if variable.words and (wrong := values[(values < 0) | (values >= variable.words)]).size:
        raise RefusedError(
            f"{name} = {wrong.flat[0]}: allowed is 0 to {variable.words - 1}, which have a word in flag_meanings"
        )

"""What variables and files say of themselves: plain text and plain numbers, and all that the format demands."""

from __future__ import annotations

import hashlib
import itertools
import json
import re
import unicodedata
from collections.abc import Mapping
from typing import Any, NoReturn

import h5py
import numpy as np

from stiffdice.errors import RefusedError, printable

# Of the HDF5 files; the part before the dot changes when an older reader could not understand them.
FORMAT_VERSION = "1.3"

MOST_ATTRIBUTES = 200  # of a variable, or of the file; the project's own files have up to 25
MOST_NUMBERS = 1000  # in one attribute
DEEPEST_SCENE = 10  # mappings and lists in one another
LONGEST_TEXT = 100_000  # characters; the longest of ours, a scene, has under a thousand

# The types of numbers in our files.
NUMBERS = {
    "int8": (h5py.h5t.STD_I8LE, h5py.h5t.STD_I8BE),
    "int16": (h5py.h5t.STD_I16LE, h5py.h5t.STD_I16BE),
    "int32": (h5py.h5t.STD_I32LE, h5py.h5t.STD_I32BE),
    "int64": (h5py.h5t.STD_I64LE, h5py.h5t.STD_I64BE),
    "float32": (h5py.h5t.IEEE_F32LE, h5py.h5t.IEEE_F32BE),
    "float64": (h5py.h5t.IEEE_F64LE, h5py.h5t.IEEE_F64BE),
}

# Written by netCDF-4 itself, each of a type of its own.
_REFERENCES = {"DIMENSION_LIST": h5py.h5t.VLEN, "REFERENCE_LIST": h5py.h5t.COMPOUND}
_SCALE = ("CLASS", "NAME")
# With these, readers change the numbers while they read them (CF, section 8.1, and xarray); our files have none.
_CHANGING = ("_FillValue", "missing_value", "scale_factor", "add_offset", "_Unsigned", "_Encoding", "dtype")

_VERSION = re.compile(r"(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)")
# Versions of the format whose files had no seal.
_UNSEALED = ("1.0", "1.1")


def check_version(file: h5py.File, sealed: bool) -> None:
    """Raise RefusedError unless a file is of a version of the format that this code can read.

    Of the same first number all can be read, those of later programs, too: a file of a later version has more in it
    than this code knows of, and nothing that means something else. From 1.2 on a file has a seal.
    """
    version = _value("the file", file, "format_version") if "format_version" in file.attrs else None
    if version is None:
        raise RefusedError("has no format_version; not a file of stiffdice")
    allowed = FORMAT_VERSION.split(".", maxsplit=1)[0]
    if not isinstance(version, str) or not _VERSION.fullmatch(version) or version.split(".")[0] != allowed:
        raise RefusedError(f"format_version = {shown(version)}: allowed is {allowed}.x")
    if not sealed and version not in _UNSEALED:
        raise RefusedError("damaged: has no seal at its end; it is cut short, or was changed by another program")


def check_all(where: str, item: h5py.File | h5py.Dataset) -> dict[str, Any]:
    """Return the attributes of a file or variable; raises RefusedError at one that is not plain text or numbers."""
    count = h5py.h5a.get_num_attrs(item.id)
    if count > MOST_ATTRIBUTES:
        raise RefusedError(f"{where}: has {count} attributes: allowed are {MOST_ATTRIBUTES}")
    found = {name: _value(where, item, name) for name in item.attrs}
    for name in _CHANGING:
        if name in found:
            raise RefusedError(f"{where}: attribute {name}: makes readers change the numbers; our files have none")
    if found.get("CLASS", "DIMENSION_SCALE") != "DIMENSION_SCALE":
        raise RefusedError(f"{where}: attribute CLASS = {shown(found['CLASS'])}: allowed is DIMENSION_SCALE")
    if "scene" in found:
        _check_scene(found["scene"], found.get("scene_digest"))
    return found


def _value(where: str, item: h5py.File | h5py.Dataset, name: str | bytes) -> Any:
    """Return an attribute's value, once its type and size are known; none of those that netCDF-4 keeps for itself."""

    def refuse(reason: str) -> NoReturn:
        raise RefusedError(f"{where}: attribute {shown(name)}: {reason}")

    if not isinstance(name, str) or not name.isprintable():  # h5py gives bytes that are no text as they are
        refuse("allowed is a name in plain text")
    attribute = h5py.h5a.open(item.id, name.encode("utf-8"))
    kind, shape = attribute.get_type(), attribute.shape
    if attribute.get_space().get_simple_extent_type() == h5py.h5s.NULL or len(shape) > 1:
        refuse("allowed is one value, or a list of numbers")
    if name in _REFERENCES:
        _check_references(kind, name, refuse)
        return None
    if shape and shape[0] > MOST_NUMBERS:
        refuse(f"{shape[0]} values: allowed are {MOST_NUMBERS}")
    if kind.get_class() == h5py.h5t.STRING:
        if shape or kind.get_size() > LONGEST_TEXT:
            refuse(f"allowed is one text of up to {LONGEST_TEXT} characters")
        if name in _SCALE and kind.is_variable_str():
            refuse("is of another type than netCDF-4 gives it")
        return _text(item.attrs[name], refuse)
    if not is_number(kind):
        refuse("allowed are plain text and plain numbers")
    return item.attrs[name]


def is_number(kind: h5py.h5t.TypeID) -> bool:
    """Return whether a type is one of NUMBERS, in either order of its bytes."""
    return not kind.committed() and any(kind.equal(known) for pair in NUMBERS.values() for known in pair)


def _check_references(kind: h5py.h5t.TypeID, name: str, refuse: Any) -> None:
    """Raise RefusedError unless what netCDF-4 keeps for itself is of the type that it has."""
    if kind.get_class() != _REFERENCES[name]:
        refuse("is of another type than netCDF-4 gives it")
    inner = kind.get_super() if name == "DIMENSION_LIST" else kind.get_member_type(0)
    if not inner.equal(h5py.h5t.STD_REF_OBJ):
        refuse("is of another type than netCDF-4 gives it")


def _text(value: Any, refuse: Any) -> str:
    try:
        text = value.decode("utf-8") if isinstance(value, bytes) else str(value)
        text.encode("utf-8")
    except UnicodeError:
        refuse("is not UTF-8 text")
    if len(text) > LONGEST_TEXT:
        refuse(f"{len(text)} characters: allowed are {LONGEST_TEXT}")
    if any(unicodedata.category(sign) == "Cc" and sign not in "\n\t" for sign in text):
        refuse("has control characters in its text")
    return text


def check_description(where: str, about: Mapping[str, Any]) -> None:
    """Raise RefusedError unless a variable says what it is, and in which unit."""
    for name in ("units", "long_name"):
        if not isinstance(about.get(name), str) or not about[name].strip():
            raise RefusedError(f"{where}: has no {name}; every variable of ours has")


def check_enum(where: str, about: Mapping[str, Any], whole: bool) -> int:
    """Return how many values an enum has, 0 of what is none; raises RefusedError unless its words are in order.

    whole: whether the variable holds whole numbers.
    """
    if "flag_values" not in about and "flag_meanings" not in about:
        return 0
    values, words = np.atleast_1d(about.get("flag_values", ())), about.get("flag_meanings")
    words = words.split() if isinstance(words, str) else []
    if not whole or not words or len(set(words)) < len(words) or values.tolist() != list(range(len(words))):
        raise RefusedError(
            f"{where}: an enum is whole numbers, with flag_values 0, 1, … and a word for each in flag_meanings"
        )
    return len(words)


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of a scene")


def _check_scene(scene: object, digest: object) -> None:
    """Raise RefusedError unless the scene in a file is the one whose digest is beside it (`Scene.digest`)."""
    deep = itertools.accumulate((sign in "[{") - (sign in "]}") for sign in str(scene))
    try:
        if max(deep, default=0) > DEEPEST_SCENE:
            raise ValueError
        mapping = json.loads(str(scene), parse_constant=_no_constant)
        text = json.dumps(mapping, sort_keys=True, separators=(",", ":"))
    except ValueError:
        raise RefusedError("the file: attribute scene: allowed is a scene as JSON") from None
    if not isinstance(mapping, dict) or hashlib.sha256(text.encode()).hexdigest() != digest:
        raise RefusedError("the file: attribute scene: is not the scene that scene_digest was made of")


def shown(text: object) -> str:
    """Return what a file says, `printable`, cut to a readable length."""
    plain = printable(text)
    return plain if len(plain) <= 60 else plain[:57] + "..."

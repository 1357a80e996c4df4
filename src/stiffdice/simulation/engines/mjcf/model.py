"""Reading a MuJoCo model that may be anything: its XML is checked before MuJoCo sees it, and errors are one line."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.parsers import expat

from stiffdice.errors import InputError, NotInstalledError
from stiffdice.io.text_file import text_of

if TYPE_CHECKING:
    import mujoco

LARGEST_FILE = 10_000_000  # bytes of XML; the largest model tried has 0.3 MB
_OTHERS = {"robot": "a URDF", "sdf": "an SDF", "mujocoinclude": "a part that models include"}


@dataclass(frozen=True)
class Tag:
    """A start tag of an XML file: its name, its attributes, the names of what it is in, and its bytes [start, end)."""

    name: str
    attributes: dict[str, str]
    parents: tuple[str, ...]
    start: int
    end: int


@dataclass(frozen=True)
class Model:
    """A model that MuJoCo compiled: its file, the text of it, and the tags in it (not those of included files)."""

    path: Path
    text: str
    tags: tuple[Tag, ...]
    compiled: mujoco.MjModel = field(repr=False)


def load(path: Path) -> Model:
    """Return a model; raises InputError for what is not MJCF or does not compile, NotInstalledError without MuJoCo."""
    text = text_of(path, LARGEST_FILE)
    tags = tags_of(text, str(path))
    _check_kind(tags[0].name, str(path))
    return Model(path, text, tags, compiled(path))


def compiled(path: Path) -> mujoco.MjModel:
    """Return what MuJoCo makes of a file."""
    try:
        import mujoco
    except ImportError:
        told = "needs the package mujoco, which is not installed; make install-engines"
        raise NotInstalledError(f"{path}: {told}") from None
    try:
        with silence():
            return mujoco.MjModel.from_xml_path(str(path))
    except (ValueError, mujoco.FatalError) as error:
        told = "; ".join(filter(None, map(str.strip, str(error).splitlines())))
        raise InputError(f"{path}: MuJoCo does not take it: {told}") from None


def _check_kind(root: str, path: str) -> None:
    if root != "mujoco":
        told = _OTHERS.get(root, f"a file of <{root}>")
        raise InputError(f"{path}: is {told}; allowed is a model in MuJoCo's MJCF, <mujoco>")


@contextmanager
def silence() -> Iterator[None]:
    """Keep MuJoCo's warnings from the terminal, and from a file MUJOCO_LOG.TXT in the folder one is in."""
    import mujoco

    former = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(former)


def tags_of(text: str, path: str) -> tuple[Tag, ...]:
    """Return the start tags of an XML text, in order; raises InputError, naming the path, if it is none."""
    raw = text.encode()
    found: list[Tag] = []
    inside: list[str] = []
    parser = expat.ParserCreate()

    def start(name: str, attributes: dict[str, str]) -> None:
        place = parser.CurrentByteIndex
        found.append(Tag(name, attributes, tuple(inside), place, _end_of_tag(raw, place)))
        inside.append(name)

    def refuse(*_: Any) -> None:
        raise InputError(f"{path}: declares entities; allowed is XML without them")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: inside.pop()
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(raw, True)
    except expat.ExpatError as error:
        raise InputError(f"{path}: not an XML file ({error})") from None
    return tuple(found)


def _end_of_tag(raw: bytes, start: int) -> int:
    """Return where the tag at `start` ends: after the first > that is in no quotes."""
    match = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""").match(raw, start)
    return match.end() if match else start

"""A scene of two boxes above one ground. Read from YAML, frozen, checked."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from stiffdice.errors import InputError, told_within
from stiffdice.io import yaml_loader
from stiffdice.scene import scene as scenes
from stiffdice.scene import validation
from stiffdice.scene.cube import Cube
from stiffdice.scene.scene import Ground, Launch, Scene

_TOP_KEYS = ("cubes", "ground", "gravity", "duration")
_CUBE_KEYS = ("cube", "launch")

# What a scene of two boxes takes unless it says otherwise: the paper's contact as section 4.2 means it.
_DEFAULTS = {"ground": {"contact": "gated"}, "cube": {"geometry": "exact"}, "launch": {"node_velocity": "rigid"}}


@dataclass(frozen=True)
class PairScene:
    """Two boxes, each with its launch, that meet each other and the ground; its stiffness and damping are theirs, too.

    parts: each box on the ground as if it were alone, with the same ground, gravity and duration.

    Raises InputError where they differ in those, and for a contact law that is not gated.
    """

    parts: tuple[Scene, Scene]

    def __post_init__(self) -> None:
        a, b = self.parts
        if (a.ground, a.gravity, a.duration) != (b.ground, b.gravity, b.duration):
            raise InputError("cubes: allowed are two on the same ground, with the same gravity and duration")
        if a.ground.contact != "gated":
            raise InputError(
                f"ground.contact = {a.ground.contact}: allowed is gated for two cubes, as cubes that are apart feel "
                "nothing of each other"
            )

    @property
    def cubes(self) -> tuple[Cube, Cube]:
        """The two boxes."""
        return self.parts[0].cube, self.parts[1].cube

    @property
    def launches(self) -> tuple[Launch, Launch]:
        """How each starts."""
        return self.parts[0].launch, self.parts[1].launch

    @property
    def ground(self) -> Ground:
        """What both fall on, with the constants of their contact."""
        return self.parts[0].ground

    @property
    def gravity(self) -> float:
        """Along −z [m/s²]."""
        return self.parts[0].gravity

    @property
    def duration(self) -> float:
        """Of the motion [s]."""
        return self.parts[0].duration

    @property
    def derived(self) -> tuple[str, ...]:
        """Which values follow from others that were given, a line for each."""
        told = (
            f"cubes.{number}.{line}" if line.startswith("cube.") else line
            for number, part in enumerate(self.parts)
            for line in part.derived
        )
        return tuple(dict.fromkeys(told))

    def as_mapping(self) -> dict[str, Any]:
        """Return the scene as plain data, every key resolved; `from_mapping` gives the same scene back."""
        a, b = (part.as_mapping() for part in self.parts)
        cubes = [{key: part[key] for key in _CUBE_KEYS} for part in (a, b)]
        return {"cubes": cubes, "ground": a["ground"], "gravity": a["gravity"], "duration": a["duration"]}

    @property
    def digest(self) -> str:
        """SHA-256 of the scene's canonical JSON: equal scenes, equal digests."""
        text = json.dumps(self.as_mapping(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


def from_mapping(mapping: object) -> PairScene:
    """Return the scene of two boxes that plain data describe.

    mapping: `cubes`, two of {cube: …, launch: …} with the keys of those sections of a scene; ground, gravity and
    duration as in a scene (docs/reference/scene.md lists all).

    Raises InputError naming the key, the value and what is allowed.
    """
    top = validation.known_keys("", mapping, _TOP_KEYS)
    cubes = _two(top.get("cubes"))
    shared = {key: top[key] for key in ("gravity", "duration") if key in top}
    a, b = (_part(f"cubes.{k}", part, shared, top.get("ground")) for k, part in enumerate(cubes))
    if a.ground != b.ground:
        raise InputError(
            "ground.restitution: asks for another damping under each of two cubes that differ in mass; allowed is "
            "ground.damping"
        )
    return PairScene((a, b))


def _two(cubes: object) -> list[Any]:
    if not isinstance(cubes, list) or len(cubes) != 2:
        raise InputError(f"cubes = {validation.shown(cubes)}: allowed is a list of two, each with cube and launch")
    return cubes


def _part(where: str, mapping: object, shared: Mapping[str, Any], ground: object) -> Scene:
    """Return one box on the ground as if it were alone."""
    given = validation.known_keys(where, mapping, _CUBE_KEYS)
    sections = {"ground": ground, **given}
    whole = {name: _with_defaults(name, sections.get(name)) for name in _DEFAULTS}
    try:
        return scenes.from_mapping({**shared, **whole})
    except InputError as error:
        shared_key = str(error).startswith(("ground", "gravity", "duration"))
        raise error if shared_key else InputError(f"{where}.{error}") from None


def _with_defaults(name: str, section: object) -> object:
    if section is None:
        return _DEFAULTS[name]
    return {**_DEFAULTS[name], **section} if isinstance(section, Mapping) else section


def is_pair(mapping: object) -> bool:
    """Return whether plain data are of a scene of two boxes, by their key."""
    return isinstance(mapping, Mapping) and "cubes" in mapping


def load(path: str | Path, overrides: Sequence[str] = ()) -> PairScene:
    """Return the scene of two boxes in a YAML file.

    path: of the file; docs/reference/scene.md lists its keys. overrides: single keys to change, each as
    "ground.stiffness=1e6" or "cubes.0.launch.velocity=[1, 0, 0]"; the cubes are 0 and 1.

    Raises InputError naming the file, the key, the value and what is allowed.
    """
    data = yaml_loader.load(path)
    with told_within(str(path)):
        return changed(data, overrides)


def changed(mapping: object, overrides: Sequence[str] = ()) -> PairScene:
    """Return the scene that plain data describe, with `key.path=value` overrides; raises InputError."""
    for override in overrides:
        mapping = _overridden(mapping, override)
    return from_mapping(mapping)


def _overridden(mapping: object, text: str) -> dict[str, Any]:
    """Return plain data with one `key.path=value` set."""
    top = dict(validation.known_keys("", mapping, _TOP_KEYS))
    keys, value, told = *scenes.change_of(text), f"--set {text}"
    if keys[0] != "cubes":
        shared = {key: part for key, part in top.items() if key != "cubes"}
        return {**top, **scenes.set_in(shared, keys, value, told=told)}
    if len(keys) == 1:
        return {**top, "cubes": value}
    if len(keys) == 2 or keys[1] not in ("0", "1"):
        raise InputError(f"{told}: allowed are cubes.0 and cubes.1, as in cubes.1.launch.velocity=[1, 0, 0]")
    cubes, number = list(_two(top.get("cubes"))), int(keys[1])
    cubes[number] = scenes.set_in(cubes[number], keys[2:], value, told=told, where=f"cubes.{number}.")
    return {**top, "cubes": cubes}

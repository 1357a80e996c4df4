"""The scene: the physical problem, and nothing of the numerics. Read from YAML, frozen, checked."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from stiffdice.errors import InputError, told_within
from stiffdice.io import yaml_loader
from stiffdice.scene import derived_parameters, validation
from stiffdice.scene.cube import Cube
from stiffdice.scene.flat_landing import CONTACT_LAWS

NODE_VELOCITIES = ("translation", "rigid")

# Three readings of the paper. `corrected` leaves the inertia to the scene, which has to state it: the paper
# places its masses at the corners (m s²/2) and prints the inertia of a solid cube (m s²/6).
_PRESET_KEYS = ("ground.contact", "cube.geometry", "cube.inertia", "launch.node_velocity")
_PRESET_VALUES = {
    "as_listed": ("ungated", "printed", "solid", "translation"),
    "as_written": ("gated", "printed", "solid", "rigid"),
    "corrected": ("gated", "exact", None, "rigid"),
}
PRESETS: Mapping[str, Mapping[str, str | None]] = {
    name: dict(zip(_PRESET_KEYS, values, strict=True)) for name, values in _PRESET_VALUES.items()
}


@dataclass(frozen=True)
class Ground:
    """The ground of section 2.2: an elastic plane through the origin that pushes back.

    stiffness [kg/s²]: S, per node. damping [kg/s]: D, per node. friction [1]: mu, regularised below 10⁻⁶ r of
    tangential speed, as in the listings. contact: under `ungated` damping and friction act on every node, in the air,
    too, as the listings compute it; under `gated` only on nodes below the ground, as section 4.2 says. normal [1]:
    the direction out of the ground; any length but zero, stored with length one.

    Raises InputError for values out of range.
    """

    stiffness: float = 1.0e4
    damping: float = 0.2
    friction: float = 0.075
    contact: str = "ungated"
    normal: validation.Vector = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for key, unit in (("stiffness", "kg/s²"), ("damping", "kg/s"), ("friction", "1")):
            value = validation.number(f"ground.{key}", getattr(self, key), unit, at_least=0)
            object.__setattr__(self, key, value)
        validation.choice("ground.contact", self.contact, CONTACT_LAWS)
        normal = validation.vector("ground.normal", self.normal, "1")
        largest = max(abs(part) for part in normal)
        if largest == 0:
            raise InputError("ground.normal = [0, 0, 0]: allowed is any direction but zero (normalised to length 1)")
        # Scaling by a power of two keeps the squares in range and changes no digit.
        exponent = math.frexp(largest)[1]
        x, y, z = (math.ldexp(part, -exponent) for part in normal)
        length = math.sqrt(x * x + y * y + z * z)
        if abs(math.ldexp(length, exponent) - 1) >= 4e-16:  # else as it is, so that storing is idempotent
            normal = x / length + 0.0, y / length + 0.0, z / length + 0.0  # as validation.number: no -0
        object.__setattr__(self, "normal", normal)


@dataclass(frozen=True)
class RandomSpin:
    """A random start of the spin: each part of L uniform in [low, high) [kg m²/s], from a seed.

    The default range is the throw listing's: rand(3,1)*0.75 + 10^-6.
    """

    seed: int
    low: float = 1.0e-6
    high: float = 0.75 + 1.0e-6

    def __post_init__(self) -> None:
        where = "launch.angular_momentum"
        object.__setattr__(self, "seed", validation.count(f"{where}.seed", self.seed, at_least=0))
        for key in ("low", "high"):
            object.__setattr__(self, key, validation.number(f"{where}.{key}", getattr(self, key), "kg m²/s"))
        if self.high < self.low:
            raise InputError(f"{where}.high = {self.high:g}: allowed is a number >= low = {self.low:g} [kg m²/s]")

    def draw(self) -> validation.Vector:
        """Return the three components this seed stands for [kg m²/s]."""
        x, y, z = self.low + (self.high - self.low) * np.random.default_rng(self.seed).random(3)
        return float(x), float(y), float(z)


@dataclass(frozen=True)
class Launch:
    """How the cube starts.

    position [m]: of the centre. velocity [m/s]: of the centre. angular_momentum [kg m²/s]: three numbers, or
    {seed: 7} for the listing's random spin, each part uniform in [`low`, `high`), by default rand*0.75 + 10^-6.
    orientation [rad]: rotation vector from the upright cube of cube.m. node_velocity: what the nodes' velocities are in
    the very first step: `translation` is the centre's, as in the throw listing; `rigid` is with ω × X, equation 5.

    Raises InputError for values out of range.
    """

    position: validation.Vector = (0.0, 0.0, 3.0)
    velocity: validation.Vector = (5.0, 0.0, 5.0)
    angular_momentum: validation.Vector | RandomSpin = (0.0, 0.0, 0.0)
    orientation: validation.Vector = (0.0, 0.0, 0.0)
    node_velocity: str = "translation"

    def __post_init__(self) -> None:
        for key, unit in (("position", "m"), ("velocity", "m/s"), ("orientation", "rad")):
            object.__setattr__(self, key, validation.vector(f"launch.{key}", getattr(self, key), unit))
        if not isinstance(self.angular_momentum, RandomSpin):
            spin = validation.vector("launch.angular_momentum", self.angular_momentum, "kg m²/s")
            object.__setattr__(self, "angular_momentum", spin)
        validation.choice("launch.node_velocity", self.node_velocity, NODE_VELOCITIES)

    @property
    def spin(self) -> validation.Vector:
        """The angular momentum at the start [kg m²/s], drawn if it is a RandomSpin."""
        if isinstance(self.angular_momentum, RandomSpin):
            return self.angular_momentum.draw()
        return self.angular_momentum


@dataclass(frozen=True)
class Scene:
    """The physical problem, and nothing of the numerics.

    cube: side, mass and inertia. ground: stiffness, damping, friction, contact law and slope. launch: place, velocity,
    spin and orientation. gravity [m/s²]: along −z. duration [s]: of the motion. derived: which values follow from
    others that were given (a radius from a side, say), a line for each. It is no part of the scene: two scenes of the
    same values are equal and have one digest, however they were given.

    Raises InputError for values out of range.
    """

    cube: Cube = field(default_factory=Cube)
    ground: Ground = field(default_factory=Ground)
    launch: Launch = field(default_factory=Launch)
    gravity: float = 9.8
    duration: float = 10.0
    derived: tuple[str, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "gravity", validation.number("gravity", self.gravity, "m/s²", at_least=0))
        object.__setattr__(self, "duration", validation.number("duration", self.duration, "s", above=0))

    def as_mapping(self) -> dict[str, Any]:
        """Return the scene as plain data, every key resolved; `from_mapping` gives the same scene back."""
        # A round trip through JSON turns the tuples into the lists that YAML has.
        mapping: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(self)))
        del mapping["derived"]
        # Digests of scenes are as they were before cubes had these keys.
        mapping["cube"] = {key: value for key, value in mapping["cube"].items() if value is not None}
        return mapping

    @property
    def digest(self) -> str:
        """SHA-256 of the scene's canonical JSON: equal scenes, equal digests."""
        text = json.dumps(self.as_mapping(), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()

    def with_ground(self, **values: Any) -> Scene:
        """Return the same scene on another ground: with_ground(stiffness=1e6, contact="gated").

        values: fields of the ground, in SI units; raises InputError for one out of range.
        """
        kept = tuple(line for line in self.derived if not line.startswith("ground."))
        return dataclasses.replace(self, ground=dataclasses.replace(self.ground, **values), derived=kept)


_SECTIONS: dict[str, Any] = {"cube": Cube, "ground": Ground, "launch": Launch}
_TOP_KEYS = ("preset", *_SECTIONS, "gravity", "duration")
_KEYS = {
    name: [*(part.name for part in dataclasses.fields(cls)), *derived_parameters.INSTEAD.get(name, ())]
    for name, cls in _SECTIONS.items()
}


def from_mapping(mapping: object, preset: str | None = None) -> Scene:
    """Return the scene that plain data describe.

    mapping: what a scene's YAML file holds (docs/reference/scene.md lists the keys): numbers in SI units, or values
    with units as "16 mm". preset: as_listed, as_written or corrected, in place of the mapping's own `preset`; single
    keys go before both.

    Raises InputError naming the key, the value and what is allowed.
    """
    if isinstance(mapping, Mapping) and "cubes" in mapping:
        raise InputError("cubes: allowed here is a scene of one cube; stiffdice run takes two")
    top = validation.known_keys("", _given(mapping), _TOP_KEYS)
    sections = {name: dict(validation.known_keys(name, _given(top.get(name)), _KEYS[name])) for name in _SECTIONS}
    chosen = preset if preset is not None else top.get("preset")
    if "side" in sections["cube"]:
        sections["cube"].setdefault("geometry", derived_parameters.GEOMETRY)
    for path, value in PRESETS[validation.choice("preset", chosen, PRESETS)].items() if chosen is not None else ():
        section, key = path.split(".")
        if value is not None:
            sections[section].setdefault(key, value)
        elif key not in sections[section]:
            raise InputError(
                f"preset = {chosen}: state {path}, too: solid (m s²/6, the paper's formula) or corners "
                "(m s²/2, the paper's eight corner masses)"
            )
    keys, derived = derived_parameters.cube(sections["cube"])
    cube = Cube(**keys)
    keys, of_ground = derived_parameters.ground(sections["ground"], cube, Ground.stiffness)
    launch = derived_parameters.launch(sections["launch"], cube)
    where, spin = "launch.angular_momentum", launch.get("angular_momentum")
    if isinstance(spin, Mapping):
        if "seed" not in validation.known_keys(where, spin, ["seed", "low", "high"]):
            raise InputError(f"{where}.seed is missing: allowed is a whole number >= 0")
        launch["angular_momentum"] = RandomSpin(**spin)
    rest = {key: top[key] for key in ("gravity", "duration") if key in top}
    return Scene(cube, Ground(**keys), Launch(**launch), **rest, derived=derived + of_ground)


# `[x, y, z] unit`, which is no YAML without quotes around it.
_ONE_UNIT = re.compile(r"\s*\[[^][{}]*\]\s*[^\s\]#][^\]#]*")


def _given(mapping: object) -> object:
    """Return a section as given; one with nothing in it has no keys."""
    return {} if mapping is None else mapping


def load(path: str | Path, overrides: Sequence[str] = (), preset: str | None = None) -> Scene:
    """Return the scene in a YAML file.

    path: of the file; docs/reference/scene.md lists its keys. overrides: single keys to change, each as
    "ground.stiffness=1e6". preset: as_listed, as_written or corrected, in place of the file's own `preset`.

    Raises InputError naming the file, the key, the value and what is allowed.
    """
    data = yaml_loader.load(path)
    with told_within(str(path)):
        return changed(data, overrides, preset)


def changed(mapping: object, overrides: Sequence[str] = (), preset: str | None = None) -> Scene:
    """Return the scene that plain data describe, with `key.path=value` overrides; raises InputError."""
    for override in overrides:
        mapping = set_in(mapping, *change_of(override), told=f"--set {override}")
    return from_mapping(mapping, preset)


def change_of(text: str) -> tuple[list[str], Any]:
    """Return the keys and the value of a change `key.path=value`; the value is read as YAML."""
    path, equals, raw = text.partition("=")
    keys = path.strip().split(".")
    if not equals or not all(keys):
        raise InputError(f"--set {text}: allowed is key.path=value, such as ground.stiffness=1e6")
    try:
        return keys, raw if _ONE_UNIT.fullmatch(raw) else yaml_loader.parse(raw)
    except InputError as error:
        raise error.within(f"--set {text}") from None


def set_in(data: Any, keys: list[str], value: Any, *, told: str, where: str = "") -> dict[str, Any]:
    """Return plain data of a scene with the value of one key set.

    told: how the change was asked for. where: of what the data are a part, `cubes.0.` of the first of two cubes.
    """
    section, *rest = keys
    result = dict(validation.known_keys("", _given(data), _TOP_KEYS))
    if not rest:
        if section in _SECTIONS:
            validation.known_keys(f"{where}{section}", value, _KEYS[section])
        return result | {section: value}
    if section not in _SECTIONS or len(keys) > 3 or (len(keys) == 3 and keys[:2] != ["launch", "angular_momentum"]):
        known = [f"{where}{name}.{key}" for name, inner in _KEYS.items() for key in inner]
        raise InputError(f"{told}: no such key{validation.meant(where + '.'.join(keys), known)}")
    given = validation.known_keys(f"{where}{section}", _given(result.get(section)), _KEYS[section])
    if len(keys) == 3:
        spin = given.get(rest[0])
        value = {**(spin if isinstance(spin, dict) else {}), rest[1]: value}
    left_out = derived_parameters.excluded(section, rest[0])
    kept = {key: part for key, part in given.items() if key not in left_out}
    return result | {section: kept | {rest[0]: value}}

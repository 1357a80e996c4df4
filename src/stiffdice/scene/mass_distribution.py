"""Where the mass of a box is: its total, its centre, and its inertia tensor, along the edges of the upright box.

The tensor of point masses and the parallel-axis theorem: Goldstein, Classical Mechanics, sections 5.3 and 5.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.errors import InputError
from stiffdice.scene import die, validation

Array = npt.NDArray[np.float64]

# By place: how many faces meet there, and the faces of a load that names none.
_MEETING = {"face": 1, "edge": 2, "corner": 3}


class MassDistribution(NamedTuple):
    """mass [kg]; centre [m], of mass from that of the box, shape (3,); tensor [kg m²] about it, shape (3, 3)."""

    mass: float
    centre: Array
    tensor: Array

    @property
    def is_isotropic(self) -> bool:
        """Whether the centre of mass is that of the box and every axis has one moment of inertia, to round-off."""
        moment = self.tensor[0, 0]
        spread = np.abs(self.tensor - moment * np.eye(3)).max()
        offset = np.abs(self.centre).max() * np.sqrt(self.mass)
        return bool(spread <= 1e-12 * moment and offset <= 1e-12 * np.sqrt(moment))


@dataclass(frozen=True)
class Load:
    """A point mass on the surface of a box, part of its mass.

    at: `corner`, `edge` (the middle of one) or `face` (its centre). mass [kg]. faces: those that meet there, as numbers
    of pips; 1, 2, 3 in this order where none are named. Raises InputError for values out of range.
    """

    at: str
    mass: float
    faces: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        count = _MEETING[validation.choice("cube.load.at", self.at, _MEETING)]
        object.__setattr__(self, "mass", validation.number("cube.load.mass", self.mass, "kg", above=0))
        faces = self.faces or die.FACES[:count]
        numbers = isinstance(faces, (list, tuple)) and all(type(face) is int and face in die.FACES for face in faces)
        pairs = {min(face, die.opposite(face)) for face in faces} if numbers else set()
        if not numbers or len(pairs) != count or len(faces) != count:
            raise InputError(
                f"cube.load.faces = {validation.shown(faces)}: allowed at a {self.at} are {count} of the faces 1 to 6, "
                f"no two of them opposite, as {list(die.FACES[:count])}"
            )
        object.__setattr__(self, "faces", tuple(faces))

    @classmethod
    def of(cls, given: object) -> Load:
        """Return a load from plain data; raises InputError."""
        if isinstance(given, cls):
            return given
        keys = dict(validation.known_keys("cube.load", given, ("at", "mass", "faces")))
        for key in ("at", "mass"):
            if key not in keys:
                raise InputError(f"cube.load.{key} is missing: allowed is {{at: corner, edge or face, mass: … [kg]}}")
        return cls(**keys)

    def position(self, half_sides: Array) -> Array:
        """Return where it is [m], relative to the centre of a box, shape (3,)."""
        return np.asarray(half_sides * sum(die.NORMALS[face - 1] for face in self.faces))


def of_points(masses: Array, places: Array) -> MassDistribution:
    """Return that of point masses [kg], shape (K,), at places [m], shape (K, 3)."""
    mass = float(masses.sum())
    centre = masses @ places / mass
    arms = places - centre
    squares = (arms**2).sum(axis=1)
    tensor = np.diag(np.full(3, masses @ squares)) - np.einsum("k,ki,kj->ij", masses, arms, arms)
    return MassDistribution(mass, centre, tensor)


def of_box(mass: float, half_sides: Array, inertia: str) -> MassDistribution:
    """Return that of a box whose mass fills it (`solid`) or is at its eight corners (`corners`)."""
    a, b, c = half_sides**2
    share = 1 / 3 if inertia == "solid" else 1.0
    return MassDistribution(mass, np.zeros(3), share * mass * np.diag([b + c, c + a, a + b]))


def loaded(box: MassDistribution, load: Load, half_sides: Array) -> MassDistribution:
    """Return a box, of which `box.mass` is the total, with a part of that mass in a load."""
    rest = box.mass - load.mass
    place = load.position(half_sides)
    centre = load.mass / box.mass * place
    reduced = rest * load.mass / box.mass
    point = reduced * (place @ place * np.eye(3) - np.outer(place, place))
    return MassDistribution(box.mass, centre, rest / box.mass * box.tensor + point)


def checked_moments(given: object) -> validation.Vector:
    """Return moments of inertia about the edges' directions [kg m²]; raises InputError where no body has them."""
    moments = validation.vector("cube.moments", given, "kg m²")
    low, middle, high = sorted(moments)
    if not low > 0 or high > (low + middle) * (1 + 1e-12):
        raise InputError(
            f"cube.moments = {validation.shown(list(moments))}: no body has these; allowed are three numbers > 0, none "
            "greater than the sum of the others [kg m²]"
        )
    return moments


def checked_node_masses(given: object) -> tuple[float, ...]:
    """Return eight masses [kg]; raises InputError."""
    listed: Any = validation.listed(given)
    if not isinstance(listed, (list, tuple)) or len(listed) != 8:
        raise InputError(f"cube.node_masses = {validation.shown(given)}: allowed are eight numbers >= 0 [kg]")
    masses = (validation.number(f"cube.node_masses[{k}]", part, "kg", at_least=0) for k, part in enumerate(listed))
    return tuple(masses)


def checked_sides(given: object) -> validation.Vector:
    """Return the sides of a box [m]; raises InputError."""
    given = validation.listed(given)
    if not isinstance(given, (list, tuple)):
        raise InputError(
            f"cube.sides = {validation.shown(given)}: allowed are three numbers > 0, as [a, b, c] [m]; a cube has "
            "cube.side"
        )
    sides = validation.vector("cube.sides", given, "m")
    for axis, side in zip("xyz", sides, strict=True):
        validation.number(f"cube.sides[{axis}]", side, "m", above=0)
    return sides

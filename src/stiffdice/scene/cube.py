"""The cube of the paper, section 2.1 and listing cube.m: 8 nodes, 12 links, a mass, an inertia; and other boxes."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.errors import InputError
from stiffdice.scene import mass_distribution, validation
from stiffdice.scene.mass_distribution import Load, MassDistribution

GEOMETRIES = ("printed", "exact")
INERTIAS = ("solid", "corners")

# Order of the nodes and of the links as in cube.m (counted from 0 here).
SIGNS = np.array(
    [[1, 1, 1], [1, -1, 1], [-1, -1, 1], [-1, 1, 1], [1, 1, -1], [1, -1, -1], [-1, -1, -1], [-1, 1, -1]],
    dtype=np.float64,
)
LINKS = (
    *((0, 1), (1, 2), (2, 3), (3, 0)),
    *((4, 5), (5, 6), (6, 7), (7, 4)),
    *((0, 4), (1, 5), (2, 6), (3, 7)),
)


def radius_of(side: float, geometry: str) -> float:
    """Return the radius [m] at which a cube of this geometry has a side [m], to round-off: `Cube.side` solved for r."""
    if geometry == "printed":
        return math.sqrt(side) * math.sqrt(side + 2 * math.sqrt(2)) / 2
    return side * math.sqrt(3) / 2


@dataclass(frozen=True)
class Cube:
    """A rigid box, the paper's cube unless it is given sides or masses.

    radius [m]: centre to corner, as the paper means it. mass [kg]: in all, spread equally over the eight nodes.
    geometry: `printed` has the side −√2 + 2√(0.5 + r²), as section 2.1 prints it; `exact` has 2r/√3, a true cube.
    inertia: `solid` is m s²/6, the paper's; `corners` is m s²/2, eight masses at the corners. sides [m]: in place of
    `radius`, of a box along x, y, z of the upright one; half its diagonal is the radius. node_masses [kg]: in place of
    `mass`, at the nodes in their order; `inertia` is then `corners`. load: a part of `mass` that is a point on the
    surface, as {at: corner, mass: 1 g}, at a `corner`, at the middle of an `edge`, or of a `face`; `faces: [1, 2, 3]`
    says which, by the pips of the faces that meet there. moments [kg m²]: of inertia about the directions of the edges
    through the centre of mass, in place of those that follow from the masses; none greater than the sum of the others.

    Raises InputError for values out of range, and for a body that cannot be.
    """

    radius: float = 1.0
    mass: float = 1.0
    geometry: str = "printed"
    inertia: str = "solid"
    sides: validation.Vector | None = None
    node_masses: tuple[float, ...] | None = None
    load: Load | None = None
    moments: validation.Vector | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", validation.number("cube.radius", self.radius, "m", above=0))
        object.__setattr__(self, "mass", validation.number("cube.mass", self.mass, "kg", above=0))
        validation.choice("cube.geometry", self.geometry, GEOMETRIES)
        validation.choice("cube.inertia", self.inertia, INERTIAS)
        for key, checked in _OF_A_BODY.items():
            if getattr(self, key) is not None:
                object.__setattr__(self, key, checked(getattr(self, key)))
        self._check_together()
        if not (0 < min(self.half_sides) < math.inf and 0 < self.distribution.tensor[0, 0] < math.inf):
            moment = self.distribution.tensor[0, 0]
            raise InputError(
                f"cube.radius = {self.radius:g}, cube.mass = {self.mass:g}: double precision has no such cube with "
                f"the {self.geometry} geometry (side {2 * min(self.half_sides):g} m, inertia {moment:g} kg m²)"
            )

    def _check_together(self) -> None:
        """Raise InputError for keys that contradict each other."""
        fits = self.sides is None or _close(math.hypot(*self.sides) / 2, self.radius)
        if self.sides is not None and not (fits and self.geometry == "exact"):
            raise InputError(
                f"cube.sides = {list(self.sides)}: allowed beside it are cube.geometry = exact and no cube.radius but "
                "half the diagonal"
            )
        if self.node_masses is not None:
            if self.load is not None:
                raise InputError("cube.load and cube.node_masses are both given: allowed is one of them")
            if self.inertia != "corners" or not _close(sum(self.node_masses), self.mass):
                raise InputError(
                    f"cube.node_masses = {list(self.node_masses)}: allowed beside it are cube.inertia = corners and no "
                    "cube.mass but their sum"
                )
        if self.load is not None and not self.load.mass < self.mass:
            raise InputError(
                f"cube.load.mass = {self.load.mass:g}: allowed is a part of cube.mass = {self.mass:g} kg, less than all"
            )

    @property
    def is_box(self) -> bool:
        """Whether it has sides or masses of its own, unlike the paper's cube."""
        return any(getattr(self, key) is not None for key in _OF_A_BODY)

    @property
    def side(self) -> float:
        """Side length s [m]: −√2 + 2√(0.5 + r²) as printed in section 2.1, or 2r/√3 for a true cube.

        Raises InputError for a box that is no cube.
        """
        if self.sides is not None:
            raise InputError(f"cube.sides = {list(self.sides)}: allowed here is a cube, with one side")
        if self.geometry == "printed":
            return -math.sqrt(2) + 2 * math.sqrt(0.5 + self.radius * self.radius)
        return 2 * self.radius / math.sqrt(3)

    @property
    def half_sides(self) -> validation.Vector:
        """Half of each side [m]."""
        if self.sides is not None:
            return self.sides[0] / 2, self.sides[1] / 2, self.sides[2] / 2
        return self.side / 2, self.side / 2, self.side / 2

    @property
    def moment_of_inertia(self) -> float:
        """Moment of inertia about any axis through the centre [kg m²].

        Raises InputError for a body that does not have the same about all.
        """
        if self.is_box:
            if not self.distribution.is_isotropic:
                raise InputError(
                    "cube.sides, cube.node_masses, cube.load or cube.moments: allowed here is a cube that has the same "
                    "moment of inertia about every axis through its centre"
                )
            return float(self.distribution.tensor[0, 0])
        divisor = 6 if self.inertia == "solid" else 2
        return 1 / divisor * self.mass * (self.side * self.side)

    @property
    def least_moment(self) -> float:
        """The least moment of inertia about an axis through the centre of mass [kg m²]."""
        if self.distribution.is_isotropic:
            return self.moment_of_inertia
        return float(np.linalg.eigvalsh(self.distribution.tensor)[0])

    @cached_property
    def distribution(self) -> MassDistribution:
        """Where its mass is, along the edges of the upright box."""
        if not self.is_box:
            return MassDistribution(self.mass, np.zeros(3), self.moment_of_inertia * np.eye(3))
        half_sides = np.array(self.half_sides)
        if self.node_masses is not None:
            found = mass_distribution.of_points(np.array(self.node_masses), SIGNS * half_sides)
        else:
            found = mass_distribution.of_box(self.mass, half_sides, self.inertia)
            if self.load is not None:
                found = mass_distribution.loaded(found, self.load, half_sides)
        if self.moments is not None:
            found = found._replace(tensor=np.diag(self.moments))
        smallest = float(np.linalg.eigvalsh(found.tensor)[0])
        if not smallest > 1e-12 * found.tensor.max():
            raise InputError(
                f"cube.node_masses = {list(self.node_masses or ())}: they lie on one line, about which nothing turns; "
                "allowed are masses at three nodes or more that do not"
            )
        return found

    def node_offsets(self) -> npt.NDArray[np.float64]:
        """Node positions relative to the centre of mass [m], shape (8, 3), before any rotation (X_rel in cube.m)."""
        if self.is_box:
            return np.asarray(SIGNS * self.half_sides - self.distribution.centre)
        return SIGNS * self.side / 2


# The keys that make a cube another box, each with its check.
_OF_A_BODY: dict[str, Any] = {
    "sides": mass_distribution.checked_sides,
    "node_masses": mass_distribution.checked_node_masses,
    "load": Load.of,
    "moments": mass_distribution.checked_moments,
}


def _close(a: float, b: float) -> bool:
    return abs(a - b) <= 1e-12 * max(abs(a), abs(b))

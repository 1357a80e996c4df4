"""The cube of the paper, section 2.1 and listing cube.m: 8 nodes, 12 links, a mass, an inertia."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stiffdice.errors import InputError
from stiffdice.scene import validation

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
    """A rigid cube.

    radius [m]: centre to corner, as the paper means it. mass [kg]: total, divided equally among the nodes.
    geometry: `printed` takes the side from the paper's formula, `exact` from the radius.
    inertia: `solid` (m s²/6, the paper's) or `corners` (m s²/2, eight point masses).
    Raises InputError for values out of range.
    """

    radius: float = 1.0
    mass: float = 1.0
    geometry: str = "printed"
    inertia: str = "solid"

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", validation.number("cube.radius", self.radius, "m", above=0))
        object.__setattr__(self, "mass", validation.number("cube.mass", self.mass, "kg", above=0))
        validation.choice("cube.geometry", self.geometry, GEOMETRIES)
        validation.choice("cube.inertia", self.inertia, INERTIAS)
        if not (0 < self.side < math.inf and 0 < self.moment_of_inertia < math.inf):
            raise InputError(
                f"cube.radius = {self.radius:g}, cube.mass = {self.mass:g}: double precision has no such cube with "
                f"the {self.geometry} geometry (side {self.side:g} m, inertia {self.moment_of_inertia:g} kg m²)"
            )

    @property
    def side(self) -> float:
        """Side length s [m]: −√2 + 2√(0.5 + r²) as printed in section 2.1, or 2r/√3 for a true cube."""
        if self.geometry == "printed":
            return -math.sqrt(2) + 2 * math.sqrt(0.5 + self.radius * self.radius)
        return 2 * self.radius / math.sqrt(3)

    @property
    def moment_of_inertia(self) -> float:
        """Moment of inertia about any axis through the centre [kg m²]; isotropic for a cube."""
        divisor = 6 if self.inertia == "solid" else 2
        return 1 / divisor * self.mass * (self.side * self.side)

    def node_offsets(self) -> npt.NDArray[np.float64]:
        """Node positions relative to the centre [m], shape (8, 3), before any rotation (X_rel in cube.m)."""
        return SIGNS * self.side / 2

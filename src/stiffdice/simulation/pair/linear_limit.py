"""The fastest contact of two boxes stacked on the ground, and the steps that resolve it."""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import permutations, product
from typing import NamedTuple

import numpy as np

from stiffdice.dynamics.state import Array
from stiffdice.integrators import linear_stability
from stiffdice.integrators.linear_stability import Hardest
from stiffdice.scene.cube import Cube
from stiffdice.scene.pair import PairScene

_CORNERS = np.array(list(product((-1.0, 1.0), repeat=2)))


@lru_cache(maxsize=16)
def hardest(scene: PairScene) -> Hardest:
    """Return the fastest mode of the two boxes, one in the middle of the other's upper face, edges parallel.

    Four nodes stand on the ground and four springs at the corners of the patch between the boxes, each of stiffness S.
    Either box below, boxes of unequal sides on any face. ζ = (D/S) ω/2, as dashpots stand beside the springs. All zero
    without stiffness.
    """
    stiffness, damping = scene.ground.stiffness, scene.ground.damping
    if stiffness == 0:
        return Hardest(0.0, 0.0, "none")
    a, b = scene.cubes
    square = max(_fastest(lower, upper) for lower, upper in ((a, b), (b, a)))
    omega = math.sqrt(square) * math.sqrt(stiffness)
    return Hardest(omega, damping / stiffness * omega / 2, f"two stacked, ω = {omega:.3g} rad/s")


def fewest_steps(scene: PairScene, scheme: str) -> float:
    """Return the fewest steps [1], not rounded, that keep the stacked boxes within the scheme's linear limit."""
    omega, zeta, _ = hardest(scene)
    limit = linear_stability.stability_limit(scheme, zeta)
    return omega * scene.duration / limit if limit > 0 else math.inf


def _fastest(lower: Cube, upper: Cube) -> float:
    """Return the largest ω² [1/s²] at S = 1 kg/s² of one box on the other."""
    faces = {tuple(turn[2]): turn for turn in _turns(lower)}  # how it is twisted on the ground is no matter
    above = [_turned(upper, turn) for turn in _turns(upper)]
    return max(_fastest_as(_turned(lower, turn), other) for turn in faces.values() for other in above)


def _turns(cube: Cube) -> list[Array]:
    """Return rotation matrices, shape (3, 3), of the ways a box can lie that differ."""
    one = np.eye(3)
    if not cube.is_box:
        return [one]
    signs = [np.diag(part) for part in product((1.0, -1.0), repeat=3)]
    signed = (sign @ one[list(order)] for order in permutations(range(3)) for sign in signs)
    return [turn for turn in signed if np.linalg.det(turn) > 0]


class _Lying(NamedTuple):
    """A turned box: half-sides along x and y [m], centre of mass from the box's [m], tensor [kg m²], mass [kg]."""

    half: Array
    centre: Array
    tensor: Array
    mass: float


def _turned(cube: Cube, turn: Array) -> _Lying:
    mass = cube.distribution
    return _Lying(np.abs(turn @ cube.half_sides)[:2], turn @ mass.centre, turn @ mass.tensor @ turn.T, mass.mass)


def _fastest_as(lower: _Lying, upper: _Lying) -> float:
    wide = np.minimum(lower.half, upper.half)
    standing = _rows(lower, _CORNERS * lower.half)
    rows = np.block([[standing, np.zeros((4, 4))], [-_rows(lower, _CORNERS * wide), _rows(upper, _CORNERS * wide)]])
    return float(np.linalg.eigvalsh(rows.T @ rows)[-1])


def _rows(body: _Lying, places: Array) -> Array:
    """Return how springs along z at these places, shape (4, 2), from the box's middle, act on a body, shape (4, 4).

    The coordinates are the height and the turns about three axes, scaled to unit inertia.
    """
    x, y = (places - body.centre[:2]).T
    levers = np.column_stack([y, -x, np.zeros(len(x))]) @ np.linalg.cholesky(np.linalg.inv(body.tensor))
    return np.column_stack([np.full(len(x), body.mass**-0.5), levers])

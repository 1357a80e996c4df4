"""What the ground does to one node: the normal force by contact law, and friction (paper, section 4.2).

A contact law is a tag and two compiled functions: `normal_force`, and `reaches`, which says whether the law can act
at all on a body whose every node is at least `clearance` above the ground.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.compiled import choose, chosen_by_tag, njit

# (fx, fy, fz, torque_x, torque_y, torque_z)
Wrench = tuple[float, float, float, float, float, float]


class Ungated(NamedTuple):
    """The law of the listings: damping and friction act on every node, above the ground, too."""


class Gated(NamedTuple):
    """The law of section 4.2: only a node below the ground feels it."""


LAWS = {"ungated": Ungated(), "gated": Gated()}


@njit
def _ungated_force(depth: float, speed: float, stiffness: float, damping: float) -> float:
    """As the listings compute it: fn = max(0, S*max(0, depth) − D*un), in mid-air, too."""
    return max(0.0, stiffness * max(0.0, depth) - damping * speed)


@njit
def _ungated_reaches(clearance: float) -> bool:
    return True


@njit
def _gated_force(depth: float, speed: float, stiffness: float, damping: float) -> float:
    """As section 4.2 says: the same for a node below the ground, and nothing for any other."""
    if depth <= 0.0:
        return 0.0
    return max(0.0, stiffness * depth - damping * speed)


@njit
def _gated_reaches(clearance: float) -> bool:
    return clearance <= 0.0


_NORMAL_FORCES: dict[type, Any] = {Ungated: _ungated_force, Gated: _gated_force}
_REACHES: dict[type, Any] = {Ungated: _ungated_reaches, Gated: _gated_reaches}


def normal_force(law: Any, depth: float, speed: float, stiffness: float, damping: float) -> float:
    """Return the magnitude of the normal force on a node [N]; compiled code only.

    depth [m]: distance below the ground, negative above it. speed [m/s]: along the outward normal.
    """
    return _NORMAL_FORCES[type(law)](depth, speed, stiffness, damping)


@chosen_by_tag(normal_force)
def _normal_force(law: Any, depth: Any, speed: Any, stiffness: Any, damping: Any) -> Any:
    chosen = choose(_NORMAL_FORCES, law)
    return lambda law, depth, speed, stiffness, damping: chosen(depth, speed, stiffness, damping)


def reaches(law: Any, clearance: float) -> bool:
    """Return whether the law can act on a body with this clearance [m]; compiled code only."""
    return _REACHES[type(law)](clearance)


@chosen_by_tag(reaches)
def _reaches(law: Any, clearance: Any) -> Any:
    chosen = choose(_REACHES, law)
    return lambda law, clearance: chosen(clearance)


@njit
def node_force(law: Any, physics: Any, depth: float, ux: float, uy: float, uz: float) -> tuple[float, float, float]:
    """Return the force on one node [N]: its weight, the normal force and friction, added in the listings' order.

    Friction is regularised as in the listings: its direction is u_tan/(|u_tan| + cutoff).
    """
    speed = physics.nx * ux + physics.ny * uy + physics.nz * uz
    tx = ux - speed * physics.nx
    ty = uy - speed * physics.ny
    tz = uz - speed * physics.nz
    length = math.sqrt(tx * tx + ty * ty + tz * tz) + physics.cutoff
    fn = normal_force(law, depth, speed, physics.stiffness, physics.damping)
    grip = physics.friction * fn
    return (
        fn * physics.nx - grip * (tx / length),
        fn * physics.ny - grip * (ty / length),
        (fn * physics.nz - physics.node_weight) - grip * (tz / length),
    )

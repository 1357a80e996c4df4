"""What the ground does to one node: the normal force by contact law, and friction (paper, section 4.2).

A contact law is a tag and two compiled functions, chosen by it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import by_tag, njit

# (fx, fy, fz, torque_x, torque_y, torque_z)
Wrench = tuple[float, float, float, float, float, float]


class Ungated(NamedTuple):
    """The law of the listings: damping and friction act on every node, above the ground, too."""


class Gated(NamedTuple):
    """The law of section 4.2: only a node below the ground feels it."""


LAWS = {"ungated": Ungated(), "gated": Gated()}

# The force on a node, as files tell it.
FORMULA = (
    "node in the ground by d, leaving it at u_n: normal force f = max(0, S max(0, d) - D u_n), "
    "if gated only where d > 0; friction -mu f u_t/(|u_t| + 1e-6 r)"
)


@njit
def _ungated_force(depth: float, speed: float, stiffness: float, damping: float) -> float:
    """As the listings compute it: fn = max(0, S*max(0, depth) − D*un), in mid-air, too."""
    return max(0.0, stiffness * max(0.0, depth) - damping * speed)


@njit
def _ungated_slopes(depth: float, speed: float, stiffness: float, damping: float) -> tuple[float, float]:
    if not stiffness * max(0.0, depth) - damping * speed > 0.0:
        return 0.0, 0.0
    return (stiffness if depth > 0.0 else 0.0), -damping


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
def _gated_slopes(depth: float, speed: float, stiffness: float, damping: float) -> tuple[float, float]:
    if not (depth > 0.0 and stiffness * depth - damping * speed > 0.0):
        return 0.0, 0.0
    return stiffness, -damping


@njit
def _gated_reaches(clearance: float) -> bool:
    return clearance <= 0.0


# (law, depth, speed, stiffness, damping) -> the magnitude of the normal force on a node [N]. depth [m]: distance below
# the ground, negative above it. speed [m/s]: along the outward normal.
normal_force = by_tag({Ungated: _ungated_force, Gated: _gated_force})

# (law, depth, speed, stiffness, damping) -> by how much the normal force on a node grows with its depth [N/m] and its
# speed [kg/s]; none of either where it does not push.
normal_slopes = by_tag({Ungated: _ungated_slopes, Gated: _gated_slopes})

# (law, clearance) -> whether the law can act on a body whose every node is at least `clearance` [m] above the ground.
reaches = by_tag({Ungated: _ungated_reaches, Gated: _gated_reaches})


@njit
def height_of(physics: Any, state: Any) -> float:
    """Return the centre's height above the ground plane [m]."""
    return physics.nx * state.position[0] + physics.ny * state.position[1] + physics.nz * state.position[2]


@njit
def speed_of(physics: Any, state: Any) -> float:
    """Return the centre's speed away from the ground plane [m/s]."""
    return physics.nx * state.velocity[0] + physics.ny * state.velocity[1] + physics.nz * state.velocity[2]


@njit
def lowest_of(physics: Any, state: Any) -> float:
    """Return how far below the centre the lowest node is [m]."""
    lowest = physics.reach
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        lowest = min(lowest, physics.nx * nodes[k, 0] + physics.ny * nodes[k, 1] + physics.nz * nodes[k, 2])
    return -lowest


@njit
def room_of(physics: Any, state: Any) -> float:
    """Return how much higher than the four lowest nodes the others are [m]; 0 if those are not at one height."""
    lowest = -lowest_of(physics, state)
    flat = 1e-9 * physics.reach
    touching, others = 0, math.inf
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        above = physics.nx * nodes[k, 0] + physics.ny * nodes[k, 1] + physics.nz * nodes[k, 2] - lowest
        if above <= flat:
            touching += 1
        else:
            others = min(others, above)
    return others if touching == 4 else 0.0


@njit
def swing_square(omega: Any, h: Any, above_rest: Any, speed: Any) -> Any:
    """Return u² + ω²y² − hω²uy [m²/s²], which symplectic Euler keeps of a swing on the ground; y: above rest [m]."""
    oy = omega * above_rest
    return speed * speed + oy * oy - h * omega * speed * oy


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

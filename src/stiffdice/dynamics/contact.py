"""What the ground does to one node: the normal force by contact law, and friction (paper, section 4.2).

A contact law is a tag and a normal force, in `LAWS` and in `push`; its name, and how it damps what comes towards the
ground, are in `scene/flat_landing.py`. The force is linear in depth and speed wherever it is not zero. The closed forms
(`exact`, `event`, fast-forward, the flat bounce) take it for S d − D u there.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import by_tag, constant, njit
from stiffdice.dynamics.simd import where
from stiffdice.scene.flat_landing import APPROACH_DAMPING

# (fx, fy, fz, torque_x, torque_y, torque_z)
Wrench = tuple[float, float, float, float, float, float]


def _inlined(function: Any) -> Any:
    return njit(function, forceinline=True)


@_inlined
def _ungated_push(depth: Any, drag: Any, stiffness: float) -> Any:
    return max(0.0, stiffness * max(0.0, depth) - drag)


@_inlined
def _gated_push(depth: Any, drag: Any, stiffness: float) -> Any:
    return where(depth > 0.0, max(0.0, stiffness * depth - drag), 0.0)


class Ungated(NamedTuple):
    """The law of the listings, fn = max(0, S*max(0, d) − D*un): damping and friction act in mid-air, too."""


class Gated(NamedTuple):
    """The law of section 4.2: only a node below the ground feels it."""


LAWS = {"ungated": Ungated(), "gated": Gated()}

# The force on a node, as files tell it.
FORMULA = (
    "node in the ground by d, leaving it at u_n: normal force f = max(0, S max(0, d) - D u_n), "
    "if gated only where d > 0; friction -mu f u_t/(|u_t| + 1e-6 r)"
)

# (law, depth, drag, stiffness) -> the magnitude of the normal force on a node [N], or on each of a vector of nodes.
# depth [m]: distance below the ground, negative above it. drag [N]: damping × speed along the outward normal.
push = by_tag({Ungated: _ungated_push, Gated: _gated_push}, inlined=True)

# (law) -> how many times as strong the damping of a flat cube is on the way in as on the way out: where it is more than
# once, the four nodes above the ground are damped, too, while they fall.
approach_damping = by_tag({type(law): constant(APPROACH_DAMPING[name]) for name, law in LAWS.items()})


@njit
def drags(law: Any) -> bool:
    """Return whether the ground pushes a falling node above it, too."""
    return approach_damping(law) > 1.0


@njit
def reaches(law: Any, clearance: float) -> bool:
    """Return whether the law can act on a body whose every node is at least `clearance` [m] above the ground."""
    return drags(law) or clearance <= 0.0


@njit
def normal_force(law: Any, depth: float, speed: float, stiffness: float, damping: float) -> float:
    """Return the magnitude of the normal force on one node [N]; speed [m/s]: along the outward normal."""
    return push(law, depth, damping * speed, stiffness)


@njit
def normal_slopes(law: Any, depth: float, speed: float, stiffness: float, damping: float) -> tuple[float, float]:
    """Return by how much the normal force grows with depth [N/m] and speed [kg/s]; by nothing where there is none."""
    if not normal_force(law, depth, speed, stiffness, damping) > 0.0:
        return 0.0, 0.0
    return (push(law, 1.0, 0.0, stiffness) if depth > 0.0 else 0.0), -damping


@njit
def upward(physics: Any, x: float, y: float, z: float) -> float:
    """Return the part of a vector along the ground's normal."""
    return physics.nx * x + physics.ny * y + physics.nz * z


@njit
def split(physics: Any, ux: float, uy: float, uz: float) -> tuple[float, float, float, float]:
    """Return a velocity's part along the ground's normal, and the vector along the ground that is left."""
    speed = upward(physics, ux, uy, uz)
    return speed, ux - speed * physics.nx, uy - speed * physics.ny, uz - speed * physics.nz


@njit
def height_of(physics: Any, state: Any) -> float:
    """Return the centre's height above the ground plane [m]."""
    return upward(physics, state.position[0], state.position[1], state.position[2])


@njit
def speed_of(physics: Any, state: Any) -> float:
    """Return the centre's speed away from the ground plane [m/s]."""
    return upward(physics, state.velocity[0], state.velocity[1], state.velocity[2])


@njit
def node_velocity(state: Any, k: int) -> tuple[float, float, float]:
    """Return the velocity u + ω × r of node k [m/s]."""
    rx, ry, rz = state.node_offset[k, 0], state.node_offset[k, 1], state.node_offset[k, 2]
    wx, wy, wz = state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2]
    ux, uy, uz = state.velocity[0], state.velocity[1], state.velocity[2]
    return ux + (wy * rz - wz * ry), uy + (wz * rx - wx * rz), uz + (wx * ry - wy * rx)


@njit
def lowest_of(physics: Any, state: Any) -> float:
    """Return how far below the centre the lowest node is [m]."""
    lowest = physics.reach
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        lowest = min(lowest, upward(physics, nodes[k, 0], nodes[k, 1], nodes[k, 2]))
    return -lowest


@njit
def room_of(physics: Any, state: Any) -> float:
    """Return how much higher than the four lowest nodes the others are [m]; 0 if those are not at one height."""
    lowest = -lowest_of(physics, state)
    touching, others = 0, math.inf
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        above = upward(physics, nodes[k, 0], nodes[k, 1], nodes[k, 2]) - lowest
        if above <= 1e-9 * physics.reach:
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
    speed, tx, ty, tz = split(physics, ux, uy, uz)
    length = math.sqrt(tx * tx + ty * ty + tz * tz) + physics.cutoff
    fn = normal_force(law, depth, speed, physics.stiffness, physics.damping)
    grip = physics.friction * fn
    return (
        fn * physics.nx - grip * (tx / length),
        fn * physics.ny - grip * (ty / length),
        (fn * physics.nz - physics.node_weight) - grip * (tz / length),
    )

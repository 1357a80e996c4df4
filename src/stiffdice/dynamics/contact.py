"""What the ground does to one node: the normal force by contact law, and friction (paper, section 4.2).

Under every contact law (`scene/flat_landing.py`) the force is linear in depth and speed wherever it is not zero. The
closed forms (`exact`, `event`, fast-forward, the flat bounce) take it for S d − D u there.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.dynamics.compilation import njit, where
from stiffdice.dynamics.vector import Vector, cross, dot, inlined, norm, plus, plus_times, row, times, vector

# (fx, fy, fz, torque_x, torque_y, torque_z)
Wrench = tuple[float, float, float, float, float, float]


# The force on a node, as files tell it.
FORMULA = (
    "node in the ground by d, leaving it at u_n: normal force f = max(0, S max(0, d) - D u_n), "
    "if gated only where d > 0; friction -mu f u_t/(|u_t| + 1e-6 r)"
)


@inlined
def push(onset: float, depth: Any, drag: Any, stiffness: float) -> Any:
    """Return the magnitude of the normal force on a node [N], or on each of a vector of nodes.

    onset [m]: of the contact law. depth [m]: below the ground, negative above it. drag [N]: damping × speed along the
    outward normal.
    """
    return where(depth > onset, max(0.0, stiffness * max(0.0, depth) - drag), 0.0)


@njit
def drags(physics: Any) -> bool:
    """Return whether the ground pushes a falling node above it, too."""
    return bool(physics.onset < 0.0)


@njit
def reaches(physics: Any, clearance: float) -> bool:
    """Return whether the ground can act on a body whose every node is at least `clearance` [m] above it."""
    return drags(physics) or clearance <= 0.0


@njit
def falling(physics: Any) -> Wrench:
    """Return force and torque on a body that nothing touches."""
    return 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0


@njit
def together(a: Wrench, b: Wrench) -> Wrench:
    """Return the sum of forces [N] and torques [N m] about one point."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@njit
def change(new: Wrench, old: Wrench) -> Wrench:
    """Return by how much force [N] and torque [N m] have changed."""
    return new[0] - old[0], new[1] - old[1], new[2] - old[2], new[3] - old[3], new[4] - old[4], new[5] - old[5]


@njit
def normal_force(physics: Any, depth: float, speed: float) -> float:
    """Return the magnitude of the normal force on one node [N]; speed [m/s]: along the outward normal."""
    return push(physics.onset, depth, physics.damping * speed, physics.stiffness)


@njit
def normal_slopes(physics: Any, depth: float, speed: float) -> tuple[float, float]:
    """Return by how much the normal force grows with depth [N/m] and speed [kg/s]; by nothing where there is none."""
    if not normal_force(physics, depth, speed) > 0.0:
        return 0.0, 0.0
    return (physics.stiffness if depth > 0.0 else 0.0), -physics.damping


@inlined
def normal_of(physics: Any) -> Vector:
    """Return the ground's normal."""
    return Vector(physics.nx, physics.ny, physics.nz)


@inlined
def upward(physics: Any, v: Vector) -> float:
    """Return the part of a vector along the ground's normal."""
    return dot(normal_of(physics), v)


@inlined
def split(physics: Any, velocity: Vector) -> tuple[float, Vector]:
    """Return a velocity's part along the ground's normal, and the vector along the ground that is left."""
    speed = upward(physics, velocity)
    return speed, plus_times(velocity, -speed, normal_of(physics))


@njit
def height_of(physics: Any, state: Any) -> float:
    """Return the centre's height above the ground plane [m]."""
    return upward(physics, vector(state.position))


@njit
def speed_of(physics: Any, state: Any) -> float:
    """Return the centre's speed away from the ground plane [m/s]."""
    return upward(physics, vector(state.velocity))


@njit
def node_velocity(state: Any, k: int) -> Vector:
    """Return the velocity u + ω × r of node k [m/s]."""
    return plus(vector(state.velocity), cross(vector(state.angular_velocity), row(state.node_offset, k)))


@njit
def lowest_of(physics: Any, state: Any) -> float:
    """Return how far below the centre the lowest node is [m]."""
    lowest = physics.reach
    for k in range(len(state.node_offset)):
        lowest = min(lowest, upward(physics, row(state.node_offset, k)))
    return -lowest


@njit
def room_of(physics: Any, state: Any) -> float:
    """Return how much higher than the four lowest nodes the others are [m]; 0 if those are not at one height."""
    lowest = -lowest_of(physics, state)
    touching, others = 0, math.inf
    for k in range(len(state.node_offset)):
        above = upward(physics, row(state.node_offset, k)) - lowest
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
def node_force(physics: Any, depth: float, velocity: Vector) -> Vector:
    """Return the force on one node [N]: its weight, the normal force and friction, added in the listings' order.

    Friction is regularised as in the listings: its direction is u_tan/(|u_tan| + cutoff).
    """
    speed, slip = split(physics, velocity)
    length = norm(slip) + physics.cutoff
    fn = normal_force(physics, depth, speed)
    push = times(fn, normal_of(physics))
    pressed = Vector(push.x, push.y, push.z - physics.node_weight)
    return plus_times(pressed, -physics.friction * fn, Vector(slip.x / length, slip.y / length, slip.z / length))

"""Implicit Euler, linear in the contact force: the whole step under the forces at its end, found by linear equations.

Of M(v' − v) = h F(x + h v', v') it takes F linear: (M − h ∂F/∂v − h² ∂F/∂x) Δv = h (F + h ∂F/∂x v) (Baraff and Witkin
1998, Large steps in cloth simulation, SIGGRAPH), but about the place to which free flight would take the cube in this
step. So a node that comes to the ground within the step is pressed in it already, and one that leaves is not held back.
About the present place the cube would first sink by up to h|v|, and its springs hold up to (ωh)² times its energy.

No step of a flat cube gains energy, the springs' included, at any stiffness (its potential is convex; Hairer and
Wanner, Solving Ordinary Differential Equations II, IV.12). The bounce pays for it: it keeps about exp(−πωh/2) of its
speed where ωh is small, and less than (ωh)⁻² where it is large. A depth d comes out of the ground at d/h at most. The
nodes of a turning cube, whose arcs are not linear, may gain some h ω² r: nothing to speak of below a twentieth of a
radian a step, and some tenths of the energy at one.

The first system is without friction; it is solved again without the nodes that it would hold down, until there are
none. The last has friction by these normal forces: F_f = −μ F_n u_t/(|u_t| + cutoff) with u_t at the end of the step
and |u_t| at its begin. This is friction's chord: its tangent would overshoot standing still as explicit steps do. It
turns no sliding node around, and the matrix stays symmetric and positive definite at any coefficient. It errs by
μ g h/u, of first order as the rest (Steihaug and Wolfbrandt 1979, Math. Comp. 33, 521).

One evaluation of the nodes' forces and slopes a step. In free flight it is symplectic Euler.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import (
    height_of,
    node_velocity,
    normal_force,
    normal_slopes,
    reaches,
    speed_of,
    split,
    upward,
)
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Array, Motion, Physics
from stiffdice.integrators.free_flight import scaled
from stiffdice.integrators.linear_equations import factorise, solve


class ImplicitEuler(NamedTuple):
    """The tag of this scheme."""


TAG = ImplicitEuler()

# One step of h, as files tell it.
FORMULA = "(M - h dF/dv - h^2 dF/dx) dv = h (F + h dF/dx v), F linear about x + h v; v += dv; x += h v"

# The velocity of a step is the path's slope half a step before it: x_n = x_(n−1) + h u_n.
LAG = 0.5

_EVERY_NODE = -1  # in bits


@njit
def step(model: Any, law: Any, physics: Physics, state: Any, h: float, tolerance: float) -> int:
    """Advance `state` by one step of h [s] and return how often the force was evaluated."""
    weight = 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    height = height_of(physics, state) + h * (speed_of(physics, state) - h * physics.gravity * physics.nz)
    if not reaches(law, height - physics.reach):
        models.kick(model, physics, state, weight, h)
        models.drift(model, physics, state, h)
        return 1
    slips = _slips(physics, state)
    models.kick(model, physics, state, weight, h)
    models.drift(model, physics, state, h)
    change = _solved(model, law, physics, state, slips, h)
    models.move(model, state, scaled(change, h))
    m, i = physics.mass, physics.inertia
    impulse = m * change[0], m * change[1], m * change[2], i * change[3], i * change[4], i * change[5]
    models.kick(model, physics, state, impulse, 1.0)
    return 1


@njit
def _slips(physics: Physics, state: Any) -> Array:
    """Return each node's speed along the ground, cutoff added, shape (node,) [m/s]."""
    slips = np.empty(state.node_offset.shape[0])
    for k in range(slips.shape[0]):
        _, tx, ty, tz = split(physics, *node_velocity(state, k))
        slips[k] = math.sqrt(tx * tx + ty * ty + tz * tz) + physics.cutoff
    return slips


@njit
def _solved(model: Any, law: Any, physics: Physics, state: Any, slips: Array, h: float) -> Array:
    """Return by how much the ground changes velocity and spin from those of free flight, shape (6,)."""
    size = 6 if models.turns(model) else 3
    change = np.zeros(6)
    system = np.empty((size, size + 1))
    pressing = _EVERY_NODE
    while True:
        still = _assemble(law, physics, state, slips, pressing, False, change, system, h)
        if still == pressing:
            break
        pressing = still
        _solve(system, change)
    if pressing != 0 and physics.friction > 0.0:
        _assemble(law, physics, state, slips, pressing, True, change, system, h)
        _solve(system, change)
    return change


@njit
def _assemble(
    law: Any,
    physics: Physics,
    state: Any,
    slips: Array,
    nodes: int,
    rubbing: bool,
    change: Array,
    system: Array,
    h: float,
) -> int:
    """Write down the equations of those of these nodes that press after `change`, and return which they are, in bits.

    rubbing: with friction by the normal forces after `change`.
    """
    system[:] = 0.0
    for k in range(system.shape[0]):
        system[k, k] = physics.mass if k < 3 else physics.inertia
    pressing = 0
    for k in range(slips.shape[0]):
        rx, ry, rz = state.node_offset[k, 0], state.node_offset[k, 1], state.node_offset[k, 2]
        depth = -upward(physics, state.position[0] + rx, state.position[1] + ry, state.position[2] + rz)
        speed, tx, ty, tz = split(physics, *node_velocity(state, k))
        push = normal_force(law, depth, speed, physics.stiffness, physics.damping)
        by_depth, by_speed = normal_slopes(law, depth, speed, physics.stiffness, physics.damping)
        stiffening = h * by_depth - by_speed
        along = _lever(rx, ry, rz, physics.nx, physics.ny, physics.nz)
        pressed = push - stiffening * _dot(along, change)
        if (nodes >> k) & 1 == 0 or pressed <= 0.0:
            continue
        pressing |= 1 << k
        _add(system, along, h * stiffening, h * push)
        if rubbing:
            grip = h * physics.friction * pressed / slips[k]
            _add(system, _lever(rx, ry, rz, tx, ty, tz), 0.0, -grip)
            _add(system, _lever(rx, ry, rz, 1.0, 0.0, 0.0), grip, 0.0)
            _add(system, _lever(rx, ry, rz, 0.0, 1.0, 0.0), grip, 0.0)
            _add(system, _lever(rx, ry, rz, 0.0, 0.0, 1.0), grip, 0.0)
            _add(system, along, -grip, 0.0)
    return pressing


@njit
def _lever(rx: float, ry: float, rz: float, x: float, y: float, z: float) -> Motion:
    """Return what a force (x, y, z) on a node at r does to the body: the force, and r × it."""
    return x, y, z, ry * z - rz * y, rz * x - rx * z, rx * y - ry * x


@njit
def _dot(along: Motion, change: Array) -> float:
    """Return the velocity of a node along its lever's force in a change of motion."""
    total = 0.0
    for k in range(6):
        total += along[k] * change[k]
    return total


@njit
def _add(system: Array, along: Motion, resistance: float, impulse: float) -> None:
    """Add resistance·along alongᵀ to the matrix and impulse·along to the right-hand side."""
    size = system.shape[0]
    for i in range(size):
        for j in range(size):
            system[i, j] += resistance * along[i] * along[j]
        system[i, size] += impulse * along[i]


@njit
def _solve(system: Array, change: Array) -> None:
    """Solve the equations, shape (n, n + 1), of which the last column is the right side."""
    size = system.shape[0]
    for k in range(size):
        change[k] = system[k, size]
    factorise(system)
    solve(system, change)

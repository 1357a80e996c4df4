"""Implicit Euler, linear in the contact force: the whole step under the forces at its end, found by linear equations.

Of M(v' − v) = h F(x + h v', v') it takes F linear: (M − h ∂F/∂v − h² ∂F/∂x) Δv = h (F + h ∂F/∂x v) (Baraff and Witkin
1998, Large steps in cloth simulation, SIGGRAPH), but about the place to which free flight would take the cube in this
step: a node that comes to the ground within the step is pressed in it already, and one that leaves is not held back.

No step of a flat cube gains energy, the springs' included (its potential is convex; Hairer and Wanner, Solving Ordinary
Differential Equations II, IV.12). The nodes of a turning cube, whose arcs are not linear, may gain some h ω² r: nothing
to speak of below a twentieth of a radian a step, and some tenths of the energy at one.

The first system is without friction; it is solved again without the nodes that it would hold down, until there are
none. The last has friction by these normal forces: F_f = −μ F_n u_t/(|u_t| + cutoff) with u_t at the end of the step
and |u_t| at its begin. This is friction's chord (its tangent would overshoot standing still as explicit steps do): it
turns no sliding node around, and the matrix stays symmetric and positive definite. It errs by μ g h/u, of first order
as the rest (Steihaug and Wolfbrandt 1979, Math. Comp. 33, 521).
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

import numpy as np

from stiffdice.dynamics import contact
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Array, Motion, Physics
from stiffdice.dynamics.vector import Vector, cross, norm, plus, row, unit, vector
from stiffdice.integrators.free_flight import scaled
from stiffdice.integrators.linear_equations import factorise, solve

ImplicitEuler = namedtuple("ImplicitEuler", ())
TAG = ImplicitEuler()
FORMULA = "(M - h dF/dv - h^2 dF/dx) dv = h (F + h dF/dx v), F linear about x + h v; v += dv; x += h v"
LAG = 0.5  # the velocity of a step is the path's slope half a step before it: x_n = x_(n−1) + h u_n

_EVERY_NODE = -1  # in bits


@njit
def step(model: Any, physics: Physics, state: Any, h: float, tolerance: float) -> int:
    """Advance `state` by one step of h [s] and return how often the force was evaluated."""
    weight = 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    height = contact.height_of(physics, state) + h * (
        contact.speed_of(physics, state) - h * physics.gravity * physics.nz
    )
    if not contact.reaches(physics, height - physics.reach):
        models.kick(model, physics, state, weight, h)
        models.drift(model, physics, state, h)
        return 1
    slips = _slips(physics, state)
    models.kick(model, physics, state, weight, h)
    models.drift(model, physics, state, h)
    change = _solved(model, physics, state, slips, h)
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
        slips[k] = norm(contact.split(physics, contact.node_velocity(state, k))[1]) + physics.cutoff
    return slips


@njit
def _solved(model: Any, physics: Physics, state: Any, slips: Array, h: float) -> Array:
    """Return by how much the ground changes velocity and spin from those of free flight, shape (6,)."""
    size = 6 if models.turns(model) else 3
    change = np.zeros(6)
    system = np.empty((size, size + 1))
    pressing = _EVERY_NODE
    while True:
        still = _assemble(physics, state, slips, pressing, False, change, system, h)
        if still == pressing:
            break
        pressing = still
        _solve(system, change)
    if pressing != 0 and physics.friction > 0.0:
        _assemble(physics, state, slips, pressing, True, change, system, h)
        _solve(system, change)
    return change


@njit
def _assemble(
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
    system.fill(0.0)
    for k in range(system.shape[0]):
        system[k, k] = physics.mass if k < 3 else physics.inertia
    pressing = 0
    for k in range(slips.shape[0]):
        arm = row(state.node_offset, k)
        depth = -contact.upward(physics, plus(vector(state.position), arm))
        speed, slip = contact.split(physics, contact.node_velocity(state, k))
        push = contact.normal_force(physics, depth, speed)
        by_depth, by_speed = contact.normal_slopes(physics, depth, speed)
        stiffening = h * by_depth - by_speed
        along = _lever(arm, contact.normal_of(physics))
        pressed = push - stiffening * _dot(along, change)
        if (nodes >> k) & 1 == 0 or pressed <= 0.0:
            continue
        pressing |= 1 << k
        _add(system, along, h * stiffening, h * push)
        if rubbing:
            grip = h * physics.friction * pressed / slips[k]
            _add(system, _lever(arm, slip), 0.0, -grip)
            for axis in range(3):
                _add(system, _lever(arm, unit(axis)), grip, 0.0)
            _add(system, along, -grip, 0.0)
    return pressing


@njit
def _lever(arm: Vector, force: Vector) -> Motion:
    """Return what a force on a node does to the body: the force, and r × it."""
    torque = cross(arm, force)
    return force.x, force.y, force.z, torque.x, torque.y, torque.z


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

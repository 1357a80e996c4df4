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

from stiffdice.dynamics import contact, inertia
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Array, Motion, Physics
from stiffdice.dynamics.vector import Vector, cross, dot, factorise, norm, plus, row, solve, unit, vector
from stiffdice.integrators.free_flight import scaled

ImplicitEuler = namedtuple("ImplicitEuler", ())
TAG = ImplicitEuler()
FORMULA = "(M - h dF/dv - h^2 dF/dx) dv = h (F + h dF/dx v), F linear about x + h v; v += dv; x += h v"
LAG = 0.5  # the velocity of a step is the path's slope half a step before it: x_n = x_(n−1) + h u_n


@njit
def step(model: Any, physics: Physics, state: Any, h: float, tolerance: float) -> int:
    """Advance `state` by one step of h [s] and return how often the force was evaluated."""
    weight = 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    speed = contact.speed_of(physics, state) - h * physics.gravity * physics.nz
    if not contact.reaches(physics, contact.height_of(physics, state) + h * speed - physics.reach):
        models.kick(model, physics, state, weight, h)
        models.drift(model, physics, state, h)
        return 1
    slips = np.empty(state.node_offset.shape[0])  # of each node [m/s]: its speed along the ground, cutoff added
    for k in range(slips.shape[0]):
        slips[k] = norm(contact.split(physics, contact.node_velocity(state, k))[1]) + physics.cutoff
    models.kick(model, physics, state, weight, h)
    models.drift(model, physics, state, h)
    size = 6 if models.turns(model) else 3
    change, system = np.zeros(6), np.empty((size, size + 1))  # of velocity and spin, by the ground
    pressing = -1  # every node, in bits
    while True:
        still = _assemble(physics, state, slips, pressing, False, change, system, h)
        if still == pressing:
            break
        pressing = still
        _solve(system, change)
    if pressing != 0 and physics.friction > 0.0:
        _assemble(physics, state, slips, pressing, True, change, system, h)
        _solve(system, change)
    first, second, third = inertia.tensor_of(physics.body, physics, state)
    turning = vector(change[3:])
    models.move(model, state, scaled(change, h))
    m = physics.mass
    torques = dot(first, turning), dot(second, turning), dot(third, turning)
    impulse = m * change[0], m * change[1], m * change[2], *torques
    models.kick(model, physics, state, impulse, 1.0)
    return 1


@njit
def _assemble(
    physics: Physics, state: Any, slips: Array, nodes: int, rubs: bool, change: Array, system: Array, h: float
) -> int:
    """Write down the equations of those of these nodes that press after `change`, and return which they are, in bits.

    rubs: with friction by the normal forces after `change`.
    """
    system.fill(0.0)
    tensor = inertia.tensor_of(physics.body, physics, state)
    for k in range(3):
        system[k, k] = physics.mass
        if system.shape[0] == 6:
            for j in range(3):
                system[3 + k, 3 + j] = tensor[k][j]
    pressing = 0
    for k in range(slips.shape[0]):
        arm = row(state.node_offset, k)
        depth = -contact.upward(physics, plus(vector(state.position), arm))
        speed, slip = contact.split(physics, contact.node_velocity(state, k))
        push = contact.normal_force(physics, depth, speed)
        by_depth, by_speed = contact.normal_slopes(physics, depth, speed)
        stiffening = h * by_depth - by_speed
        along = _lever(arm, contact.normal_of(physics))
        changed = 0.0  # the velocity of the node
        for axis in range(6):
            changed += along[axis] * change[axis]
        pressed = push - stiffening * changed
        if (nodes >> k) & 1 == 0 or pressed <= 0.0:
            continue
        pressing |= 1 << k
        _add(system, along, h * stiffening, h * push)
        if rubs:
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

"""Energies of a state, for the time loop and for stored trajectories alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import height_of
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Array, Physics, States


@njit
def kinetic(physics: Physics, state: Any) -> float:
    """Return the kinetic energy of translation and rotation [J], m u²/2 + L²/(2 I) as in the throw listing."""
    ux, uy, uz = state.velocity[0], state.velocity[1], state.velocity[2]
    lx, ly, lz = state.angular_momentum[0], state.angular_momentum[1], state.angular_momentum[2]
    return 0.5 * physics.mass * (ux * ux + uy * uy + uz * uz) + 0.5 * (lx * lx + ly * ly + lz * lz) / physics.inertia


@njit
def kinetic_at_place(model: Any, law: Any, physics: Physics, state: Any, lag_time: float) -> float:
    """Return the kinetic energy [J] at the time of the place, where the velocities are those of `lag_time` [s] before.

    They are moved on at the acceleration of the state, as leapfrog's half-step velocities are (Hairer, Lubich and
    Wanner, Geometric Numerical Integration, I.1.4).
    """
    fx, fy, fz, tx, ty, tz = models.force(model, law, physics, state)
    per_mass = lag_time / physics.mass
    ux, uy, uz = state.velocity[0] + per_mass * fx, state.velocity[1] + per_mass * fy, state.velocity[2] + per_mass * fz
    momentum = state.angular_momentum
    lx, ly, lz = momentum[0] + lag_time * tx, momentum[1] + lag_time * ty, momentum[2] + lag_time * tz
    return 0.5 * physics.mass * (ux * ux + uy * uy + uz * uz) + 0.5 * (lx * lx + ly * ly + lz * lz) / physics.inertia


@njit
def potential(physics: Physics, state: Any) -> float:
    """Return the potential energy m g z of the centre [J]."""
    return physics.mass * physics.gravity * state.position[2]


@njit
def elastic(physics: Physics, state: Any) -> float:
    """Return the energy in the ground's springs [J], S d²/2 for each node at a depth d below the ground."""
    height = height_of(physics, state)
    energy = 0.0
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        depth = -(height + physics.nx * nodes[k, 0] + physics.ny * nodes[k, 1] + physics.nz * nodes[k, 2])
        energy += 0.5 * physics.stiffness * max(0.0, depth) ** 2
    return energy


@njit(cache=True)
def energies(physics: Physics, states: States) -> tuple[Array, Array, Array]:
    """Return kinetic, potential and elastic energy [J] of each state, shape (state,) each."""
    count = states.shape[0]
    result = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        result[0][k] = kinetic(physics, states[k])
        result[1][k] = potential(physics, states[k])
        result[2][k] = elastic(physics, states[k])
    return result


@njit(cache=True)
def mechanical(model: Any, law: Any, physics: Physics, states: States, lag_time: float) -> Array:
    """Return kinetic + m g z + the springs' energy [J] of each state at the time of its place, shape (state,).

    lag_time [s]: how much earlier than the place the velocities are.
    """
    result = np.empty(states.shape[0])
    for k in range(states.shape[0]):
        moving = kinetic_at_place(model, law, physics, states[k], lag_time)
        result[k] = moving + potential(physics, states[k]) + elastic(physics, states[k])
    return result

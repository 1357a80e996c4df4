"""Energies of a state, for the time loop and for stored trajectories alike."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit, separate
from stiffdice.dynamics.contact import height_of, normal_of
from stiffdice.dynamics.inertia import turning_energy
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Array, Physics, States
from stiffdice.dynamics.vector import Vector, dot, plus_times, row, vector


@njit
def _moving(physics: Physics, state: Any, velocity: Vector, momentum: Vector) -> float:
    """Return m u²/2 + L·ω/2 [J] of a body turned as in a state, as in the throw listing."""
    return 0.5 * physics.mass * dot(velocity, velocity) + turning_energy(physics.body, physics, state, momentum)


@njit
def kinetic(physics: Physics, state: Any) -> float:
    """Return the kinetic energy of translation and rotation [J]."""
    return _moving(physics, state, vector(state.velocity), vector(state.angular_momentum))


@separate("float64")
def kinetic_at_place(model: Any, physics: Physics, state: Any, lag_time: float) -> float:
    """Return the kinetic energy [J] at the time of the place, where the velocities are those of `lag_time` [s] before.

    They are moved on at the acceleration of the state, as leapfrog's half-step velocities are (Hairer, Lubich and
    Wanner, Geometric Numerical Integration, I.1.4).
    """
    wrench = models.force(model, physics, state)
    velocity = plus_times(vector(state.velocity), lag_time / physics.mass, vector(wrench))
    return _moving(physics, state, velocity, plus_times(vector(state.angular_momentum), lag_time, vector(wrench[3:])))


@njit
def potential(physics: Physics, state: Any) -> float:
    """Return the potential energy m g z of the centre [J]."""
    return physics.mass * physics.gravity * state.position[2]


@njit
def elastic(physics: Physics, state: Any) -> float:
    """Return the energy in the ground's springs [J], S d²/2 for each node at a depth d below the ground."""
    height, n, energy = height_of(physics, state), normal_of(physics), 0.0
    for k in range(len(state.node_offset)):
        node = row(state.node_offset, k)
        depth = max(0.0, -(height + n.x * node.x + n.y * node.y + n.z * node.z))
        energy += 0.5 * physics.stiffness * (depth * depth)
    return energy


@njit(cache=True)
def energies(physics: Physics, states: States) -> tuple[Array, Array, Array]:
    """Return kinetic, potential and elastic energy [J] of each state, shape (state,) each."""
    count = len(states)
    moving, high, pressed = np.empty(count), np.empty(count), np.empty(count)
    for k in range(count):
        state = states[k]
        moving[k], high[k], pressed[k] = kinetic(physics, state), potential(physics, state), elastic(physics, state)
    return moving, high, pressed


def energies_at_places(model: Any, physics: Physics, states: States, lag_time: float) -> tuple[Array, ...]:
    """Return kinetic, potential, elastic and mechanical energy [J] of each state, shape (state,) each.

    The mechanical one is the sum of all three at the time of the state's place. lag_time [s]: how much earlier than
    that the velocities are.
    """
    parts = np.empty((4, len(states)))  # made here, as numba compiles all of `np.empty` where that is called
    fill_energies(model, physics, states, lag_time, parts)
    return tuple(parts)


@njit(cache=True)
def fill_energies(model: Any, physics: Physics, states: States, lag_time: float, parts: Array) -> None:
    """Set `parts`, shape (4, state), to what `energies_at_places` returns."""
    for k in range(len(states)):
        state = states[k]
        high, pressed = potential(physics, state), elastic(physics, state)
        parts[0, k], parts[1, k], parts[2, k] = kinetic(physics, state), high, pressed
        parts[3, k] = kinetic_at_place(model, physics, state, lag_time) + high + pressed

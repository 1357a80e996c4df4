"""Energies of two boxes, and how high they are above the ground."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffdice.dynamics import energy
from stiffdice.dynamics.box_contact import law
from stiffdice.dynamics.box_contact.pair_state import PairPhysics, Pairs
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import height_of, lowest_of
from stiffdice.dynamics.models import pair as pairs
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Array, Physics


@njit
def clearance(physics: PairPhysics, pair: Any) -> float:
    """Return how high the lowest node of either box is above the ground [m]."""
    a = height_of(physics.a, pair.a) - lowest_of(physics.a, pair.a)
    return min(a, height_of(physics.b, pair.b) - lowest_of(physics.b, pair.b))


@njit
def kinetic(physics: PairPhysics, pair: Any) -> float:
    """Return the kinetic energy of both [J]."""
    return energy.kinetic(physics.a, pair.a) + energy.kinetic(physics.b, pair.b)


@njit
def potential(physics: PairPhysics, pair: Any) -> float:
    """Return the potential energy of both [J]."""
    return energy.potential(physics.a, pair.a) + energy.potential(physics.b, pair.b)


@njit
def _airborne(physics: Physics, body: Any, lag_time: float) -> float:
    fall = lag_time * physics.gravity
    rising = energy.kinetic(physics, body) + physics.mass * fall * (0.5 * fall - body.velocity[2])
    return rising + energy.potential(physics, body)


@njit
def airborne(physics: PairPhysics, pair: Any, lag_time: float) -> float:
    """Return kinetic and potential energy [J] of boxes that nothing touches, at the time of the place.

    lag_time [s]: velocities are of so long before it.
    """
    return _airborne(physics.a, pair.a, lag_time) + _airborne(physics.b, pair.b, lag_time)


@njit(cache=True)
def energies(physics: PairPhysics, states: Pairs, lag_time: float) -> Array:
    """Return the energies [J] of each state, shape (5, state).

    Kinetic, potential, elastic of the ground, elastic between the boxes, and the sum of all with the velocity at the
    time of the place; lag_time [s]: velocities are of so long before it.
    """
    parts, work = np.empty((5, len(states))), states.copy()
    for k in range(len(states)):
        state = work[k]
        parts[0, k], parts[1, k] = kinetic(physics, state), potential(physics, state)
        parts[2, k] = energy.elastic(physics.a, state.a) + energy.elastic(physics.b, state.b)
        parts[3, k] = law.elastic_energy(physics, state)
        models.kick(pairs.TAG, physics, state, models.force(pairs.TAG, physics, state), lag_time)
        parts[4, k] = kinetic(physics, state) + parts[1, k] + parts[2, k] + parts[3, k]
    return parts

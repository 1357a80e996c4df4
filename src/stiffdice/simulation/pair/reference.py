"""The motion of two boxes by SciPy's DOP853 on the same compiled forces: what time steps are measured against.

What is solved for is place, velocity, angular momentum and a quaternion of either box, the first box's 13 numbers
before the second's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from stiffdice.dynamics.box_contact.pair_state import PairPhysics, Pairs, pair_physics_of
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import pair as pairs
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Array
from stiffdice.integrators.event_driven.active_set import give, normalise, quaternion_rate
from stiffdice.scene.pair import PairScene

# Relative, and absolute in m, m/s, kg m²/s and 1: what is left is round-off.
_TOLERANCE = 1e-13

# Numbers of one box.
_EACH = 13


@njit
def _put_one(physics: Any, nodes: Any, y: Array, state: Any) -> None:
    motion = y.copy()
    normalise(motion)
    give(True, physics, nodes, motion, state)


@njit
def _put(physics: PairPhysics, launch: Any, y: Array, pair: Any) -> None:
    """Make the state that a solution vector stands for; quaternions need not be units."""
    _put_one(physics.a, launch.a.node_offset, y[:_EACH], pair.a)
    _put_one(physics.b, launch.b.node_offset, y[_EACH:], pair.b)


@njit
def _rate(mass: float, state: Any, wrench: Any, y: Array, rate: Array) -> None:
    """Set the slopes of one box's numbers."""
    spin = state.angular_velocity
    for axis in range(3):
        rate[axis], rate[3 + axis], rate[6 + axis] = y[3 + axis], wrench[axis] / mass, wrench[3 + axis]
    turned = quaternion_rate(spin[0] / 2, spin[1] / 2, spin[2] / 2, y[9], y[10], y[11], y[12])
    rate[9], rate[10], rate[11], rate[12] = turned


@njit(cache=True)
def _slope(physics: PairPhysics, launch: Pairs, y: Array, room: Pairs) -> Array:
    """Return dy/dt, shape (26,). room: for one state, shape (1,)."""
    pair, rate = room[0], np.empty(y.shape[0])
    _put(physics, launch[0], y, pair)
    wrenches = models.force(pairs.TAG, physics, pair)
    _rate(physics.a.mass, pair.a, wrenches.a, y[:_EACH], rate[:_EACH])
    _rate(physics.b.mass, pair.b, wrenches.b, y[_EACH:], rate[_EACH:])
    return rate


@njit(cache=True)
def _states(physics: PairPhysics, launch: Pairs, solution: Array, states: Pairs) -> None:
    for k in range(states.shape[0]):
        _put(physics, launch[0], solution[k], states[k])


def start_of(launch: Pairs) -> Array:
    """Return the solution vector of a launch, shape (1,)."""
    (pair,) = launch
    unturned = [1.0, 0.0, 0.0, 0.0]
    parts = [(pair[k]["position"], pair[k]["velocity"], pair[k]["angular_momentum"], unturned) for k in "ab"]
    return np.concatenate([part for body in parts for part in body])


def slope_of(scene: PairScene, launch: Pairs) -> Callable[[float, Array], Array]:
    """Return (t, y) -> dy/dt of boxes that begin as in a launch, shape (1,)."""
    physics, room = pair_physics_of(scene), launch.copy()
    return lambda _time, y: np.asarray(_slope(physics, launch, y, room))


def states_at(scene: PairScene, launch: Pairs, times: Sequence[float]) -> Pairs:
    """Return the states of two boxes at some times [s] after a launch, shape (1,), ascending, shape of the times."""
    from scipy.integrate import solve_ivp  # which takes a while to import

    limits = {"rtol": _TOLERANCE, "atol": _TOLERANCE}
    found = solve_ivp(
        slope_of(scene, launch), (0.0, times[-1]), start_of(launch), method="DOP853", t_eval=times, **limits
    )
    states = np.repeat(launch, len(times))
    _states(pair_physics_of(scene), launch, np.ascontiguousarray(found.y.T), states)
    return states

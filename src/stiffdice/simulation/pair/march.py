"""The loop of two boxes: members one after another, each watched for what decides its verdict."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.box_contact.pair_state import PairPhysics, Pairs
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models.pair import TAG
from stiffdice.dynamics.vector import minus, norm, vector
from stiffdice.integrators import registry as schemes
from stiffdice.simulation.pair import energy
from stiffdice.simulation.pair.flight import fly, time_to_meet

# Steps, about, after which compiled code returns, to see signals and tell progress.
_WORK = 100_000

# Of a member, while it goes on. done: steps. launch [J]: its energy at the start. airborne [J]: the largest whenever
# nothing has touched since. deepest [m]: contact between the boxes. touching: 1 if they touched in the last step.
# meetings: how often they have begun to touch. ending: 0 as long as it goes well, else one of _DEEP, _LOST.
MEMORY = np.dtype(
    [
        ("done", np.int64),
        ("launch", np.float64),
        ("airborne", np.float64),
        ("deepest", np.float64),
        ("touching", np.int8),
        ("meetings", np.int64),
        ("ending", np.int8),
    ]
)
DEEP, LOST = 1, 2


class Limits(NamedTuple):
    """steps: of the run. every: a state is kept after each K-th, none if 0. h [s]: of a step.

    lag_time [s]: by which the scheme's velocities are behind the places. half [m]: of the shortest side of either box.
    """

    steps: int
    every: int
    h: float
    lag_time: float
    half: float


@njit
def _approach(physics: PairPhysics, pair: Any) -> float:
    """Return how fast points of the two boxes can move against each other at most [m/s]."""
    spins = norm(vector(pair.a.angular_velocity)) * physics.a.reach
    spins += norm(vector(pair.b.angular_velocity)) * physics.b.reach
    return norm(minus(vector(pair.a.velocity), vector(pair.b.velocity))) + spins


@njit
def _is_finite(pair: Any) -> bool:
    total = norm(vector(pair.a.position)) + norm(vector(pair.a.velocity)) + norm(vector(pair.a.angular_momentum))
    total += norm(vector(pair.b.position)) + norm(vector(pair.b.velocity)) + norm(vector(pair.b.angular_momentum))
    return bool(total < math.inf)


@njit
def _is_deep(physics: PairPhysics, pair: Any, limits: Limits) -> bool:
    """Return whether the opposite face of the thinner box may be as near after the next step, or be passed in it.

    Which way is out is not known then.
    """
    if not time_to_meet(physics, pair) <= limits.h:
        return False
    return bool(pair.depth + _approach(physics, pair) * limits.h >= limits.half)


@njit
def _watch(physics: PairPhysics, pair: Any, limits: Limits, memory: Any) -> None:
    """Take note of what the last step has done."""
    memory.deepest = max(memory.deepest, pair.depth)
    touching = pair.depth > 0.0
    if touching and memory.touching == 0:
        memory.meetings += 1
    memory.touching = 1 if touching else 0
    if not _is_finite(pair):
        memory.ending = LOST
    if not touching and energy.clearance(physics, pair) > 0.0:
        memory.airborne = max(memory.airborne, energy.airborne(physics, pair, limits.lag_time))


@njit(cache=True, nogil=True)
def march(
    scheme: Any,
    physics: PairPhysics,
    pairs: Pairs,
    memory: npt.NDArray[np.void],
    samples: Pairs,
    limits: Limits,
    tolerance: float,
) -> bool:
    """Advance members until all are at their end, or for some work; return whether there is more to do.

    samples: room for every K-th state of one member, from its launch on.
    """
    work = 0
    for m in range(len(pairs)):
        pair, seen = pairs[m], memory[m]
        while seen.done < limits.steps and seen.ending == 0:
            if work >= _WORK:
                return True
            to_keep = limits.every - seen.done % limits.every if limits.every > 0 else limits.steps
            steps = fly(scheme, physics, pair, limits.h, min(to_keep, limits.steps - seen.done))
            if steps == 0:
                if _is_deep(physics, pair, limits):
                    seen.ending = DEEP
                    break
                steps = 1
                schemes.step(scheme, TAG, physics, pair, limits.h, tolerance)
            work += 1
            _watch(physics, pair, limits, seen)
            if seen.ending != LOST:
                seen.done += steps
                if limits.every > 0 and seen.done % limits.every == 0:
                    samples[seen.done // limits.every] = pair
    return False


@njit(cache=True)
def begin(physics: PairPhysics, pairs: Pairs, memory: npt.NDArray[np.void]) -> None:
    """Set what is remembered of members at their launch."""
    for m in range(len(pairs)):
        launch = energy.kinetic(physics, pairs[m]) + energy.potential(physics, pairs[m])
        memory[m].launch = memory[m].airborne = launch

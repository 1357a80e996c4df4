"""A run to be made: what was asked of it, and what is remembered of each member while it goes on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Array, Physics, States, physics_of
from stiffdice.errors import InputError
from stiffdice.simulation.backend import Setup

LARGEST_TRAJECTORY = 5_000_000  # samples kept in memory for one run: 1.4 GB


class System(NamedTuple):
    """What moves, as compiled functions take it: the tag of the model, the scene's numbers."""

    model: Any
    physics: Physics


class Limits(NamedTuple):
    """steps: of the whole run. budget: steps, or force evaluations of what takes its own, to compute of a member.

    every: a state is kept after each K-th step, none if 0. tolerance [1]: of the error.
    """

    steps: int
    budget: int
    every: int
    tolerance: float


class Member(NamedTuple):
    """A member's records; compiled code makes one of `Members` where it needs it, as returning a record copies it."""

    state: Any
    sight: Any
    memory: Any
    reference: Any


class Members(NamedTuple):
    """What the loops read and change in place; first dimension member but where told.

    ensemble: states now. sight: SIGHT of the monitor. memory: MEMORY of the criteria. references: REFERENCE records,
    one or one for each member. samples: the states kept of a run, shape (sample,). The others count.
    """

    ensemble: States
    sight: npt.NDArray[np.void]
    memory: npt.NDArray[np.void]
    references: npt.NDArray[np.void]
    samples: States
    steps_done: npt.NDArray[np.int64]
    steps_computed: npt.NDArray[np.int64]
    evaluations: npt.NDArray[np.int64]

    @property
    def spent(self) -> Array:
        """What each member has taken of its budget: steps computed, or the work of a scheme that takes its own."""
        return np.maximum(self.steps_computed, self.sight["work"])

    def fraction(self, steps: int, h: float) -> float:
        """Return the part done of a run of so many steps of h [s], the mean over the members."""
        pending = self.sight["pending"]
        begun = np.where(pending > 0, 1 - pending / h, 0.0)
        return float(np.mean((self.steps_done + begun) / steps))


class Task(NamedTuple):
    """One run or an ensemble. hop_height [m]: of the criterion apex. launches: states, shape (member,)."""

    setup: Setup
    limits: Limits
    hop_height: float
    launches: States
    members: Members

    @property
    def system(self) -> System:
        """What moves."""
        scene = self.setup.scene
        return System(MODELS[self.setup.model], physics_of(scene))


def room_for(steps: int, every: int | None) -> States:
    """Return room for every K-th state of a run and the launch; raises InputError where that is too large to hold."""
    count = 0 if every is None else steps // every + 1
    if count > LARGEST_TRAJECTORY:
        raise InputError(
            f"every = {every}: would keep {count} samples ({count * STATE.itemsize / 1e9:.1f} GB); "
            f"allowed is {math.ceil(steps / LARGEST_TRAJECTORY)} or more"
        )
    return np.zeros(count, STATE)


@njit
def until_kept(limits: Limits, done: int) -> int:
    """Return the next step whose state is kept, or the last."""
    steps, every = limits.steps, limits.every
    return min(steps, (done // every + 1) * every) if every > 0 else steps


@njit
def keep(limits: Limits, samples: States, state: Any, done: int) -> None:
    """Keep a state if it is that of a K-th step."""
    if limits.every > 0 and done % limits.every == 0:
        samples[done // limits.every] = state

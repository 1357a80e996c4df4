"""A run to be made: what was asked of it, and what is remembered of each member while it goes on."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Array, Physics, States, physics_of
from stiffdice.errors import InputError
from stiffdice.simulation.backend import Setup

LARGEST_TRAJECTORY = 5_000_000  # samples kept in memory for one run: 1.4 GB


class Watched(NamedTuple):
    """What a kernel keeps of each member besides its state; first dimension member.

    memory: MEMORY of the criteria. sight: SIGHT of the monitor. The others count steps and force evaluations.
    """

    memory: npt.NDArray[np.void]
    sight: npt.NDArray[np.void]
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
    """One run or an ensemble, as the loops take it; they change `ensemble`, `watched` and `samples` in place.

    tolerance [1]: of the error. budget: steps, or force evaluations of what takes its own steps. every: a state is kept
    after each K-th step, none if 0. hop_height [m]: of the criterion apex. launches, ensemble: states at the launch and
    now, shape (member,). references: REFERENCE records, one or one for each member. samples: the states kept.
    """

    setup: Setup
    tolerance: float
    budget: int
    every: int
    hop_height: float
    launches: States
    ensemble: States
    watched: Watched
    references: npt.NDArray[np.void]
    samples: States

    @property
    def tags(self) -> tuple[Any, Any]:
        """The model and the contact law, as compiled functions take them."""
        return MODELS[self.setup.model], LAWS[self.setup.scene.ground.contact]

    @property
    def physics(self) -> Physics:
        """The numbers of the scene."""
        return physics_of(self.setup.scene)


def room_for(steps: int, every: int | None) -> States:
    """Return room for every K-th state of a run and the launch; raises InputError where that is too large to hold."""
    count = 0 if every is None else steps // every + 1
    if count > LARGEST_TRAJECTORY:
        raise InputError(
            f"every = {every}: would keep {count} samples ({count * STATE.itemsize / 1e9:.1f} GB); "
            f"allowed is {math.ceil(steps / LARGEST_TRAJECTORY)} or more"
        )
    return np.zeros(count, STATE)

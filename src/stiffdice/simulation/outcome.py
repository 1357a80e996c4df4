"""How a run ended: one of a closed list of verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from enum import IntEnum

import numpy as np
import numpy.typing as npt

# Airborne energy this many times the launch's is no longer a trajectory with an error in it.
BLOW_UP = 1e3


class Verdict(IntEnum):
    """How a run ended. The numbers are stored: a new verdict gets a new one, whatever its severity."""

    PASSED = 0
    APEX_ROSE = 1
    ENERGY_GREW = 2
    SANK = 3
    BLEW_UP = 4
    LEFT_NUMERIC_RANGE = 5
    RESTITUTION_OFF = 6
    OFF_TRAJECTORY = 7
    STALLED = 8
    UNDECIDED = 9
    UNRESOLVED = 10
    DEEP = 11

    @property
    def sentence(self) -> str:
        """What it means, for people."""
        return _SENTENCES[self]


_SENTENCES = {
    Verdict.PASSED: "passed: every criterion that was looked at holds; accuracy is another question",
    Verdict.UNRESOLVED: "unresolved: steps beyond the linear limit of a force it met, or of more than half a turn",
    Verdict.OFF_TRAJECTORY: "off trajectory: the cube was farther from the reference than allowed",
    Verdict.RESTITUTION_OFF: "restitution off: a bounce gave back more or less than the contact law does",
    Verdict.APEX_ROSE: "apex rose: a rebound went higher than the one before",
    Verdict.ENERGY_GREW: "energy grew: the cube had more energy in the air than at the launch",
    Verdict.SANK: "sank or tunnelled: the whole cube was below the ground at the end, deeper than a bounce",
    Verdict.UNDECIDED: "undecided: the budget of steps or force evaluations was spent before the end",
    Verdict.STALLED: "stalled: the steps are too short for double precision to move the cube",
    Verdict.DEEP: "deep: two cubes overlapped so far that which way is out is not known",
    Verdict.BLEW_UP: f"blew up: the airborne energy passed {BLOW_UP:g} times the start's",
    Verdict.LEFT_NUMERIC_RANGE: "left the numeric range: a number grew past what double precision holds",
}

# From mild to grave; a run has the gravest that applies.
SEVERITY = tuple(_SENTENCES)


def gravest(applies: Mapping[Verdict, npt.ArrayLike]) -> npt.NDArray[np.int8]:
    """Return the gravest Verdict that applies, int8, shape of the arrays of booleans; PASSED where none does."""
    shape = np.broadcast_shapes(*(np.shape(where) for where in applies.values()))
    verdict = np.full(shape, Verdict.PASSED, dtype=np.int8)
    for grade in SEVERITY:
        if grade in applies:
            verdict[np.asarray(applies[grade])] = grade
    return verdict

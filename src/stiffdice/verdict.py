"""What counts as stable: criteria, which are limits on measures, and the verdict of a run.

Adding a criterion on an existing measure is one line in CRITERIA.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from stiffdice.state import TURNING

Flags = npt.NDArray[np.bool_]


# Airborne energy this many times the start's is no longer a trajectory with an error in it.
BLOW_UP = 1e3


class Verdict(IntEnum):
    """How a run ended. The numbers are stored: a new verdict gets a new one, whatever its severity."""

    PASSED = 0
    APEX_ROSE = 1
    ENERGY_GREW = 2
    SANK = 3
    BLEW_UP = 4
    LEFT_NUMERIC_RANGE = 5

    @property
    def sentence(self) -> str:
        """What it means, for people."""
        return _SENTENCES[self]


_SENTENCES = {
    Verdict.PASSED: "passed: every criterion holds",
    Verdict.APEX_ROSE: "apex rose: a rebound went higher than the one before",
    Verdict.ENERGY_GREW: "energy grew: the cube had more energy in the air than at the launch",
    Verdict.SANK: "sank: the whole cube was below the ground at the end",
    Verdict.BLEW_UP: f"blew up: the airborne energy passed {BLOW_UP:g} times the start's",
    Verdict.LEFT_NUMERIC_RANGE: "left the numeric range: a number grew past what double precision holds",
}

# From mild to grave; a run has the gravest that applies.
SEVERITY = (
    Verdict.PASSED,
    Verdict.APEX_ROSE,
    Verdict.ENERGY_GREW,
    Verdict.SANK,
    Verdict.BLEW_UP,
    Verdict.LEFT_NUMERIC_RANGE,
)


@dataclass(frozen=True)
class Criterion:
    """A measure that must not exceed 1 + tolerance."""

    measure: str
    tolerance: float  # the default; a study may set another
    failure: Verdict
    meaning: str
    # Whether it says anything of a cube that turns. One that tumbles may rightly bounce higher than before, paid for
    # by its spin.
    for_turning: bool = True

    def holds(self, measure: npt.ArrayLike, tolerance: float | None = None) -> Flags:
        """Return where the criterion holds, shape of `measure`; not-a-number never does."""
        limit = 1 + (self.tolerance if tolerance is None else tolerance)
        return np.asarray(np.asarray(measure) <= limit)


CRITERIA: dict[str, Criterion] = {
    "energy": Criterion(
        "energy_ratio",
        0.05,
        Verdict.ENERGY_GREW,
        "airborne energy never above (1 + tolerance) of the start",
    ),
    "apex": Criterion(
        "apex_ratio",
        0.02,
        Verdict.APEX_ROSE,
        "no apex above (1 + tolerance) of the one before",
        for_turning=False,
    ),
}


def criteria_of(model: str) -> dict[str, Criterion]:
    """Return the criteria that mean something for a model."""
    return {name: part for name, part in CRITERIA.items() if part.for_turning or model not in TURNING}


def judge(
    model: str, measures: Mapping[str, npt.ArrayLike], finite: npt.ArrayLike, sunk: npt.ArrayLike
) -> npt.NDArray[np.int8]:
    """Return the Verdict of each run, int8, by the criteria's default tolerances.

    measures: values by name. finite: whether every step stayed within doubles. sunk: whether the run ended with
    every node below the ground. All of one shape, which is the result's.
    """
    energy = np.asarray(measures["energy_ratio"])
    applies = {part.failure: ~part.holds(measures[part.measure]) for part in criteria_of(model).values()}
    applies[Verdict.SANK] = np.asarray(sunk)
    applies[Verdict.BLEW_UP] = energy > BLOW_UP
    applies[Verdict.LEFT_NUMERIC_RANGE] = ~np.asarray(finite) | np.isnan(energy)
    verdict = np.full(np.shape(finite), Verdict.PASSED, dtype=np.int8)
    for grade in SEVERITY:
        if grade in applies:
            verdict[applies[grade]] = grade
    return verdict

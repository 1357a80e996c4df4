"""What an engine makes of a contact over a ladder of timesteps: a flat bounce without gravity, by phase of the step.

Each engine is measured as it is told (`engine_parameters`), and beside it our own scheme that steps as it does. Without
gravity, so that what is off is the step's and the contact's alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from stiffdice.advice import engine_parameters, step_limits
from stiffdice.advice.contact_design import Contact
from stiffdice.advice.engine_parameters import compensated
from stiffdice.advice.step_limits import CRITERIA, bounces
from stiffdice.dynamics.state import Array
from stiffdice.errors import NotInstalledError
from stiffdice.scene import flat_landing
from stiffdice.simulation.engines import registry as engines

# The scheme of ours that steps as the engine does.
LIKE = {"mujoco": "symplectic_euler", "pybullet": "implicit_euler", "drake": "implicit_euler"}

_LATE = "our implicit_euler; the engine finds the ground up to a step later"
LIKE_WORDS = {"mujoco": "our symplectic_euler, which steps as it does", "pybullet": _LATE, "drake": _LATE}

# Timesteps are 1, 2 and 5 times powers of ten, between these ωh; bounces meet the ground at so many phases.
LOWEST, HIGHEST, PHASES = 0.003, 2.0, 6

# What is asked of a ladder.
KEPT = ("restitution_5", "restitution_1", "energy")

# Restitutions by phase, shape (phase,); None where a way has none.
Measured = Callable[[Contact, float], Array | None]


class Column(NamedTuple):
    """A way to tell an engine of a contact, and whether its bounces are the engine's, `measured`, or `predicted`."""

    way: str
    kind: str


class Rung(NamedTuple):
    """One timestep [s], its ωh [1], and the least and the largest restitution [1] by column; 0 of a box that stays."""

    timestep: float
    omega_h: float
    found: dict[Column, tuple[float, float]]


class Ladder(NamedTuple):
    """All timesteps of an engine, ascending; version: of the engine, or why it is not measured."""

    engine: str
    version: str
    installed: bool
    rungs: list[Rung]

    @property
    def columns(self) -> list[Column]:
        """What is known at one timestep at least."""
        return list(dict.fromkeys(column for rung in self.rungs for column in rung.found))

    def longest(self, column: Column, criterion: str, exact: float) -> float | None:
        """Return the longest timestep [s] up to which a column keeps a criterion; None if none does.

        exact [1]: the restitution.
        """
        last = None
        for rung in self.rungs:
            found = rung.found.get(column)
            if found is None or not _keeps(found, criterion, exact):
                return last
            last = rung.timestep
        return last

    def recommended(self, contact: Contact) -> float:
        """Return the longest timestep [s] at which what is printed keeps e within 5 %; the shortest if none does."""
        kind = "measured" if self.installed else "predicted"
        columns = [column for column in self.columns if column.kind == kind and column.way != RESTITUTION]
        longest = [self.longest(column, KEPT[0], contact.restitution) for column in columns]
        return max((h for h in longest if h is not None), default=self.rungs[0].timestep)


def _keeps(found: tuple[float, float], criterion: str, exact: float) -> bool:
    low, high = found
    if criterion == "energy":
        return not high * high > 1 + CRITERIA["energy"]
    return bool(max(abs(low / exact - 1), abs(high / exact - 1)) <= CRITERIA[criterion])


def climbed(engine: str, contact: Contact, timestep: float | None = None) -> Ladder:
    """Return the ladder of an engine: predicted, and measured where it is installed.

    timestep [s]: one more. Raises InputError for a contact law that the engine does not have, and for a contact whose
    bounces cannot be measured.
    """
    engine_parameters.check(contact)
    step_limits.check(contact)
    ways = WAYS[engine]
    try:
        version, installed = engines.adapter_of(engine).version(), True
    except NotInstalledError as error:
        version, installed = str(error), False
    rungs = []
    for h in timesteps(contact, timestep):
        found = {}
        for way, measured in ways.items():
            found[Column(way, "predicted")] = _predicted(engine, way, contact, h)
            found[Column(way, "measured")] = measured(contact, h) if installed else None
        known = {column: _range(values) for column, values in found.items() if values is not None}
        rungs.append(Rung(h, contact.omega * h, known))
    return Ladder(engine, version, installed, rungs)


def timesteps(contact: Contact, another: float | None = None) -> list[float]:
    """Return the timesteps of a ladder [s], ascending."""
    low, high = LOWEST / contact.omega, HIGHEST / contact.omega
    powers = range(math.floor(math.log10(low)), math.floor(math.log10(high)) + 1)
    round_ones = [float(f"{digit}e{power}") for power in powers for digit in (1, 2, 5)]
    return sorted({h for h in round_ones if low <= h <= high} | ({another} if another else set()))


def _range(found: Array) -> tuple[float, float]:
    stays = np.where(np.isnan(found), 0.0, found)
    return float(stays.min()), float(stays.max())


def _predicted(engine: str, way: str, contact: Contact, h: float) -> Array | None:
    """Return what our own scheme makes of it, of the ways that are a spring and a dashpot."""
    if way == RESTITUTION:
        return None
    told = compensated(contact, h) if way == LESS else contact
    return None if told is None else bounces(told, LIKE[engine], h, PHASES).restitution


def _as_told(engine: str) -> Measured:
    return lambda contact, h: bounces(contact, engine, h, PHASES).restitution


def _with_less(engine: str) -> Measured:
    def measured(contact: Contact, h: float) -> Array | None:
        less = compensated(contact, h)
        return None if less is None else bounces(less, engine, h, PHASES).restitution

    return measured


def _starts(contact: Contact, h: float) -> Array:
    """Return clearances [m] from which a box meets the ground at the phases."""
    return contact.speed * h * (1 + np.arange(PHASES) / PHASES)


def _pasted(contact: Contact, h: float) -> Array:
    """Return restitutions of the model that is printed for MuJoCo."""
    from stiffdice.simulation.engines.mujoco import rebounds

    time = (flat_landing.duration(contact.law, contact.zeta) + 2 * contact.zeta) / contact.omega
    steps = math.ceil(1.3 * time / h) + 8
    model = engine_parameters.mujoco(contact, h).paste
    return rebounds(model, contact.scene.cube.side / 2, contact.speed, _starts(contact, h), steps) / contact.speed


def _with_restitution(contact: Contact, h: float) -> Array:
    """Return restitutions of a box with PyBullet's own restitution."""
    from stiffdice.simulation.engines.pybullet import rebounds

    cube, speed = contact.scene.cube, contact.speed
    return rebounds(contact.restitution, cube.side, cube.mass, speed, h, _starts(contact, h)) / speed


# How an engine may be told, and what measures that.
PASTED, DAMPING, LESS, RESTITUTION = "as printed", "D", "D − S h", "restitution = e, a box"
WAYS: dict[str, dict[str, Measured]] = {
    "mujoco": {PASTED: _pasted},
    "pybullet": {DAMPING: _as_told("pybullet"), LESS: _with_less("pybullet"), RESTITUTION: _with_restitution},
    "drake": {DAMPING: _as_told("drake"), LESS: _with_less("drake")},
}

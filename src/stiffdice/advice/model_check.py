"""What a MuJoCo model's contacts do at its own time step: predicted from its numbers, measured in MuJoCo, judged.

A body falls on each floor, and on each other body that the model lets it touch, at the speed of a drop from its own
size, without anything else in the way. It lands at eight phases of the step: from clearances of 1/16, 3/16, … 15/16 of
the way of a step. That is done at an eighth to eight times the model's time step.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from stiffdice.errors import InputError
from stiffdice.simulation.engines.mjcf.law import Law
from stiffdice.simulation.engines.mjcf.model import Model, load, silence

if TYPE_CHECKING:
    from stiffdice.simulation.engines.mjcf.meeting import Meeting, Touch

LADDER = tuple(2.0**k for k in range(-3, 4))  # time steps, in the model's own
PHASES = tuple((k + 0.5) / 8 for k in range(8))
FALL = 9.81  # m/s², where a model has no gravity
MOST = 40  # meetings that are measured

# What is judged: energy after a landing over that before; depths in sizes, of a landing and at rest; ζ; and how far a
# restitution may be from that of short steps.
GAIN, DEEP, SUNK, DAMPED, OFF = 1.01, 0.1, 0.01, 1.05, 0.05


class Span(NamedTuple):
    """A number over the phases of a step: least, mean, greatest."""

    low: float
    mean: float
    high: float


@dataclass(frozen=True)
class Rung:
    """Landings at one time step [s]: ωh [1], e [1] predicted and measured, energy after over before [1], depths [m]."""

    timestep: float
    omega_h: float
    predicted: Span
    measured: Span
    energy: float
    predicted_depth: float
    depth: float


class Verdict(NamedTuple):
    """What is wrong with a contact: a word for programs, a sentence for people."""

    kind: str
    sentence: str


@dataclass(frozen=True)
class Contact:
    """What was found of one meeting.

    law: by which it was predicted, at the model's time step; speed [m/s]; spring [m]: the depth at which the law's ω
    and ζ are given, the deepest of a landing; alike: other meetings of the same numbers, which are not measured.
    """

    meeting: Meeting
    touch: Touch
    speed: float
    spring: float
    rungs: tuple[Rung, ...]
    verdicts: tuple[Verdict, ...]
    alike: tuple[tuple[Meeting, Touch], ...] = ()

    @property
    def law(self) -> Law:
        """The law of the contact, at the model's time step."""
        return self.touch.law

    @property
    def own(self) -> Rung:
        """What happens at the model's own time step."""
        return self.at(self.law.timestep)

    def at(self, timestep: float) -> Rung:
        """Return what happens at a time step of the ladder [s]."""
        return next(rung for rung in self.rungs if rung.timestep == timestep)

    @property
    def difference(self) -> float:
        """How far prediction and measurement of e are apart at the model's time step, means over phases [1]."""
        gap = abs(self.own.predicted.mean - self.own.measured.mean)
        return gap if math.isfinite(gap) else math.inf


@dataclass(frozen=True)
class Check:
    """What was found of a model; missed: meetings that did not come about; left: those beyond the most."""

    model: Model
    contacts: tuple[Contact, ...]
    missed: tuple[tuple[str, str], ...]
    left: int = 0

    @property
    def passed(self) -> bool:
        """Whether no contact has a verdict against it."""
        return not any(contact.verdicts for contact in self.contacts)


def check(path: Path, tell: Callable[..., None] = lambda *_: None) -> Check:
    """Return what a model's contacts do; raises InputError where it cannot be read, or nothing in it can fall."""
    model = load(path)
    # It imports MuJoCo, which `load` has found.
    from stiffdice.simulation.engines.mjcf.meeting import meetings_of

    everyone = meetings_of(model.compiled)
    if not everyone:
        raise InputError(f"{path}: no free body that may touch a plane or another body: nothing to check")
    found = check_meetings(model, everyone[:MOST], LADDER, tell)
    if not found.contacts:
        told = "; ".join(" on ".join(names) for names in found.missed)
        raise InputError(f"{path}: no contact comes about where a body falls ({told}): nothing to check")
    return replace(found, left=len(everyone[MOST:]))


def check_meetings(
    model: Model,
    everyone: Sequence[Meeting],
    ladder: tuple[float, ...],
    tell: Callable[..., None] = lambda *_: None,
    *,
    stop: bool = False,
) -> Check:
    """Return what contacts of a model do. ladder: time steps in the model's own; stop: with the first verdict."""
    from stiffdice.simulation.engines.mjcf import meeting as meetings

    found: dict[object, Contact] = {}
    missed: list[tuple[str, str]] = []
    with silence():
        for number, meeting in enumerate(everyone):
            tell(f"{meeting.names[0]} on {meeting.names[1]}", number / len(everyone))
            alone = meetings.alone(model.compiled, meeting)
            touch = meetings.touch_of(alone, meeting)
            if touch is None:
                missed.append(meeting.names)
                continue
            key = _likeness(meeting, touch)
            if key in found:
                found[key] = replace(found[key], alike=(*found[key].alike, (meeting, touch)))
            else:
                found[key] = _contact(alone, meeting, touch, ladder)
                if stop and found[key].verdicts:
                    break
    return Check(model, tuple(found.values()), tuple(missed))


def _likeness(meeting: Meeting, touch: Touch) -> object:
    """Return what two meetings that need one measurement have in common."""
    law = touch.law
    numbers = (*law.solref, *law.solimp, law.softness, law.pull, law.mass, meeting.size)
    return tuple(f"{number:.9g}" for number in numbers), touch.contacts, touch.why, meeting.is_floor


def _contact(alone: Any, meeting: Meeting, touch: Touch, ladder: tuple[float, ...]) -> Contact:
    law = touch.law
    gravity = float(np.linalg.norm(alone.opt.gravity)) or FALL
    speed = math.sqrt(2 * gravity * meeting.size)
    spring = law.bounce(speed, 0.0)[1]
    if not math.isfinite(spring):
        spring = speed * law.timestep
    rungs = tuple(_rung(alone, meeting, touch, law.at(law.timestep * k), speed, spring) for k in ladder)
    contact = Contact(meeting, touch, speed, spring, rungs, ())
    return replace(contact, verdicts=tuple(_verdicts(contact)))


def _rung(alone: Any, meeting: Meeting, touch: Touch, law: Law, speed: float, spring: float) -> Rung:
    """Return landings at the time step of a law."""
    from stiffdice.simulation.engines.mjcf.drop import drops

    predicted = [law.bounce(speed, phase * speed * law.timestep, spring) for phase in PHASES]
    measured = drops(alone, meeting, touch, law, speed, np.array(PHASES))
    return Rung(
        law.timestep,
        law.frequency(spring) * law.timestep,
        _span([restitution for restitution, _ in predicted]),
        _span([one.restitution for one in measured]),
        max(one.energy for one in measured),
        max(depth for _, depth in predicted),
        max(one.depth for one in measured),
    )


def _span(values: list[float]) -> Span:
    return Span(min(values), sum(values) / len(values), max(values))


def _verdicts(contact: Contact) -> list[Verdict]:
    """Return what is wrong at the model's own time step, by the measurement; damping and rest by the law."""
    own, law, size, found = contact.own, contact.law, contact.meeting.size, []
    h, fine = law.timestep, contact.rungs[0]
    zeta, rest = law.damping_ratio(contact.spring), law.rest_depth()
    if own.energy > GAIN:
        told = f"a landing leaves {own.energy:.3g} times the energy (ωh = {own.omega_h:.2g} at {h:g} s)"
        found.append(Verdict("gains_energy", f"will gain energy: {told}"))
    if own.depth > DEEP * size or rest > SUNK * size:
        told = f"sinks in {own.depth / size:.2g} of its size when dropped from it, {rest / size:.2g} at rest"
        found.append(Verdict("soft", f"will be soft: {told}"))
    if zeta > DAMPED:
        told = f"ζ = {zeta:.3g}, e = {law.restitution(contact.spring):.2g} without gravity"
        found.append(Verdict("over_damped", f"is over-damped: {told}"))
    off = max(own.measured.high - fine.measured.mean, fine.measured.mean - own.measured.low)
    if own.timestep > fine.timestep and not off <= OFF:
        told = f"e from {own.measured.low:.3g} to {own.measured.high:.3g} by where a step of {h:g} s falls"
        told += f", {fine.measured.mean:.3g} at {fine.timestep:g} s"
        found.append(Verdict("under_resolved", f"is under-resolved: {told}"))
    return found

"""From event to event: exact flights, and in contact steps of high order, as long as their error allows.

A flight is a parabola and a turn at constant spin; its touch-down is found to round-off (`touchdown.py`). From there on
the motion obeys smooth equations until a node crosses the ground or the force on one reaches zero (`active_set.py`).
Each such event is located to round-off, and the integrator starts anew behind it, so that it keeps its order: it is
Dormand and Prince's method of order 8 (`dop853.py`), or where friction holds a node, whose motion is stiff then,
Radau's of order 9 (`radau_iia.py`). Steps scale with the contact's time. The tolerance is of a step's error, relative
to the motion of the contact: to its speed, and to that over its frequency as length.

Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, sections II.4 and II.6 (step size, events).
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any

import numpy as np

from stiffdice.dynamics import inertia
from stiffdice.dynamics.compilation import njit, separate
from stiffdice.dynamics.contact import drags
from stiffdice.dynamics.inertia import spins_steadily
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import assign
from stiffdice.integrators.event_driven import active_set, dop853, radau_iia
from stiffdice.integrators.event_driven.active_set import NODES, SIZE, SWITCHES, Contact, derivative, passes
from stiffdice.integrators.event_driven.touchdown import free_time
from stiffdice.integrators.free_flight import flight

Event = namedtuple("Event", ())
TAG = Event()
FORMULA = (
    "exact flights; contacts by Dormand and Prince's method of order 8 from one event to the next, "
    "Radau's implicit method of order 9 where friction holds a node"
)
LAG = 0.0  # the velocity is that at the stored place

OWN_STEPS = True

# So many advances to a touch-down take about as long as an evaluation of the forces.
_ADVANCES = 4
# An explicit step is not stable for longer than about this over the fastest friction or damping.
_STIFF = 4.0
# The first step of a contact: about what turns out to be right, as part of its 1/ω, over the tolerance's eighth root.
_FIRST = 5.0
# Where friction is so many times as fast as the contact it holds a node, or is about to: the slip is of the order of
# the cutoff then, and must be known to a part of that.
_HOLDING, _HELD = 1e4, 0.1
# By what a step may exceed the one before.
_GROWTH = 5.0
# A step is accepted whatever its error once it is shorter than this part of the contact's 1/ω or of all there is to go.
_SHORTEST = 1e-13
# After so many such steps in a row the motion is beyond doubles, and becomes not-a-number.
_FORCED = 100
# Times that the location of an event may correct itself; it takes three or four.
_CORRECTIONS = 30
# Over less than this part of the contact's 1/ω a method of order 4 is exact to round-off.
_NEAR = 1e-3

# What a contact is computed in, one record, which reaches compiled code as a bare pointer (see `state.STATE`). nodes,
# bits, inverse: those of the regime. here, there: the motion at a step's start and end; stages: rates in between.
# scale: what error is tolerated; nothing: zeros. sums: scratch of the integrator. hard: see `active_set.hardness`.
# value, slope: of the switches at start and end; small: see `active_set.vanishing`.
_WORK = np.dtype(
    [
        ("nodes", np.float64, (NODES, 3)),
        ("bits", np.int8, NODES),
        ("inverse", np.float64, (3, 3)),
        ("here", np.float64, SIZE),
        ("there", np.float64, SIZE),
        ("scale", np.float64, SIZE),
        ("stages", np.float64, (dop853.STAGES + 1, SIZE)),
        ("nothing", np.float64, SIZE),
        ("sums", np.float64, (2, SIZE)),
        ("hard", np.float64, 3),
        ("value", np.float64, (2, SWITCHES)),
        ("slope", np.float64, (2, SWITCHES)),
        ("small", np.float64, 2),
    ]
)


@njit
def part(model: Any, physics: Physics, state: Any, h: float, tolerance: float, most: int) -> tuple[float, int, int]:
    """Advance `state` by h [s], or by less where that is more work; return what is left [s], evaluations, and the work.

    most: about how much work at most, in evaluations; finding touch-downs is work, too.
    """
    # bool() keeps them from being taken for constants, for each of which all would be compiled again.
    turning, dragging = bool(models.turns(model)), bool(physics.damping > 0.0 and drags(physics))
    flying = turning and not spins_steadily(physics.body)
    left, evaluations, work = h, 0, 0
    while left > 0.0 and work < most:
        if not math.isfinite(state.position[2]):
            return 0.0, evaluations, work
        if not (dragging or flying):
            free, advances = free_time(model, physics, state, left)
            flight(model, physics, state, free, 1, LAG)
            left -= free
            work += 1 + advances // _ADVANCES
        if left > 0.0:
            going = turning, dragging, flying
            spent, count = _touch(going, physics, state, left, tolerance, max(1, most - work))
            left -= spent
            evaluations += count
            work += count
    return left, evaluations, work


@separate("Tuple((float64, int64))")
def _touch(
    going: tuple[bool, bool, bool], physics: Physics, state: Any, most: float, tolerance: float, effort: int
) -> tuple[float, int]:
    """Advance `state` until nothing acts on it any more, by at most `most` [s]; return by how much, and evaluations.

    going: turning, dragging and flying, of a `Contact`. effort: evaluations after which to stop between two steps.
    """
    # Kept here while it is used: a record does not keep its array alive.
    room = np.zeros(1, _WORK)
    contact = Contact(*going, physics, room[0])
    inertia.put_inverse(physics.body, physics, state, room[0].inverse)
    return _go_through(contact, state, most, tolerance, effort, room)


@njit
def _go_through(
    contact: Contact, state: Any, most: float, tolerance: float, effort: int, room: Any
) -> tuple[float, int]:
    work = room[0]
    for node in range(NODES):
        assign(work.nodes[node], state.node_offset[node])
    work.scale.fill(1.0)
    active_set.take(contact.turning, state, work.here)
    active_set.vanishing(contact.physics, work.here, work.small)
    active_set.begin(contact, work.here, work.small)
    _look(contact, work, work.here, 0, 0)
    time, h, evaluations, idle, forced, growth = 0.0, 0.0, 1, 0, 0, _GROWTH
    while time < most and evaluations < effort and (contact.dragging or contact.flying or _touches(work)):
        active_set.hardness(contact, work.here, work.hard)
        if h == 0.0:
            h = _first(contact.physics, work, tolerance)
        pace, slowest = min(h, most - time), max(work.hard[0], 1.0 / most)
        _tolerate(contact.physics, work, tolerance)
        error, order, count = _attempt(contact, work, pace)
        evaluations += count + 1
        change = min(growth, max(0.2, 0.9 * error ** (-1.0 / order))) if error != 0.0 else growth
        if not error <= 1.0 and pace * slowest > _SHORTEST:
            h = pace * min(change, 0.9)
            growth = 1.0 if error == math.inf else _GROWTH  # where no stages are found, it is not the error that says
            continue
        forced, growth = 0 if error <= 1.0 else forced + 1, _GROWTH
        if forced > _FORCED or not math.isfinite(work.small[1]):
            work.here.fill(math.nan)
            break
        _look(contact, work, work.there, dop853.STAGES, 1)
        lowest = _dip(work, pace)
        if 0.0 < lowest < pace:  # a touch that begins and ends within the step: to be met, or missed, at its deepest
            h = lowest
            continue
        h = max(h, pace * change) if change > 1.0 else pace * change
        zero = _first_zero(work, pace)
        if zero <= pace and idle <= SWITCHES:
            end, error, count = _locate(contact, work, zero, pace)
            evaluations += count
            if not error <= 1.0 and end * slowest > _SHORTEST:
                h = end / 2  # what a node does that is let go before the event is not seen from beyond it
                continue
            pace = end
            idle = idle + 1 if pace == 0.0 else 0
        time = most if pace == most - time else time + pace
        changed = _cross_zeros(contact, work)
        _move_on(work)
        if changed:
            _look(contact, work, work.here, 0, 0)
        if not math.isfinite(work.here[2]):
            break
    active_set.give(contact.turning, contact.physics, work.nodes, work.here, state)
    return time, evaluations


@njit
def _touches(work: Any) -> bool:
    """Return whether anything acts on a node."""
    acting = False
    for node in range(NODES):
        acting = acting or work.bits[node] != 0
    return acting


@njit
def _look(contact: Contact, work: Any, motion: Any, stage: int, end: int) -> None:
    """Evaluate rate and switches of the motion at the start of a step (stage 0, end 0) or at its end (the last, 1)."""
    rate = work.stages[stage]
    derivative(contact, motion, rate)
    active_set.switches(contact, motion, rate, work.value[end], work.slope[end])


@njit
def _move_on(work: Any) -> None:
    """Start from where the step ended."""
    active_set.normalise(work.there)
    assign(work.here, work.there)
    assign(work.stages[0], work.stages[dop853.STAGES])
    assign(work.value[0], work.value[1])
    assign(work.slope[0], work.slope[1])


@njit
def _tolerate(physics: Physics, work: Any, tolerance: float) -> None:
    """Set what error is tolerated of each part of the motion in a step."""
    here, scale, hard = work.here, work.scale, work.hard
    active_set.vanishing(physics, here, work.small)
    speed = active_set.fastest(physics, here)
    if hard[0] * physics.reach > hard[2]:
        length, pace = hard[2] / hard[0], hard[2]
    else:
        length, pace = physics.reach, max(speed, math.sqrt(physics.gravity * physics.reach))
    length, pace = tolerance * length, tolerance * pace
    if hard[1] > _HOLDING * hard[0]:
        pace = min(pace, _HELD * physics.cutoff)
    # What round-off does to a step is no error of it.
    length = max(length, work.small[0])
    pace = max(pace, work.small[0] * hard[0] + 2.0**-49 * speed)
    scale.fill(length / physics.reach)
    for axis in range(3):
        scale[axis], scale[3 + axis], scale[6 + axis] = length, pace, pace * physics.inertia / physics.reach


@njit
def _first(physics: Physics, work: Any, tolerance: float) -> float:
    """Return the step [s] to try first."""
    fastest = max(work.hard[0], math.sqrt(physics.gravity / physics.reach), 1e-300)
    return _FIRST * tolerance ** (1.0 / dop853.ORDER) / fastest


@separate("Tuple((float64, int64, int64))")
def _attempt(contact: Contact, work: Any, h: float) -> tuple[float, int, int]:
    """Step by h [s]; return the error over what is tolerated, the order of its estimate, and evaluations."""
    if work.hard[1] * h > _STIFF:
        error, count = radau_iia.step(contact, work.here, h, work.there, work.scale)
        return error, radau_iia.ORDER, count
    dop853.step(contact, work.here, h, work.stages, work.there)
    error = dop853.error(work.stages, work.scale, h, work.nothing, work.sums)
    return error, dop853.ORDER, dop853.STAGES - 1


@njit
def _cubic(work: Any, switch: int, h: float, s: float) -> float:
    """Return a switch at part s of a step, on the cubic through its values and slopes at both ends (Hermite)."""
    p, q = work.value[0, switch], work.value[1, switch]
    u, v = h * work.slope[0, switch], h * work.slope[1, switch]
    return float(p + s * (u + s * (3 * (q - p) - 2 * u - v + s * (2 * (p - q) + u + v))))


@njit
def _dip(work: Any, h: float) -> float:
    """Return when [s] within a step a switch that is positive at both ends seems lowest below zero; h if none is."""
    lowest = h
    for switch in range(SWITCHES):
        falls, rises = work.slope[0, switch] < 0.0, work.slope[1, switch] > 0.0
        if not (falls and rises and work.value[0, switch] > 0.0 and work.value[1, switch] > 0.0):
            continue
        low, high = 0.0, 1.0
        for _ in range(40):
            left, right = low + (high - low) / 3, high - (high - low) / 3
            if _cubic(work, switch, h, left) < _cubic(work, switch, h, right):
                high = right
            else:
                low = left
        if _cubic(work, switch, h, low) < 0.0:
            lowest = min(lowest, low * h)
    return lowest


@njit
def _falls_to_zero(work: Any, switch: int) -> bool:
    """Return whether a switch is at zero but for round-off and falling at the end of a step, or below."""
    value, small = work.value[1, switch], work.small[switch % 2]
    return bool(value < -small or (value <= small and work.slope[1, switch] < 0.0))


@njit
def _first_zero(work: Any, h: float) -> float:
    """Return about when [s] within a step the first switch falls to zero; infinite if none does."""
    first = math.inf
    for switch in range(SWITCHES):
        if passes(work.bits, switch) or not _falls_to_zero(work, switch):
            continue
        low, high = 0.0, 1.0
        while high - low > 1e-6:
            middle = (low + high) / 2
            if _cubic(work, switch, h, middle) > 0.0:
                low = middle
            else:
                high = middle
        first = min(first, high * h)
    return first


@njit
def _locate(contact: Contact, work: Any, when: float, most: float) -> tuple[float, float, int]:
    """Step to the first zero of a switch, which is about at `when` [s]; return when exactly, the error, evaluations.

    The error is infinite where none was found.
    """
    evaluations, change, error, hardest = 0, math.inf, 0.0, max(work.hard[0], work.hard[1])
    for _ in range(_CORRECTIONS):
        if abs(change) * hardest < _NEAR:
            _shift(contact, work, change)
            evaluations += 4
        else:
            error, _, count = _attempt(contact, work, when)
            evaluations += count + 1
        if not error <= 1.0:
            break
        _look(contact, work, work.there, dop853.STAGES, 1)
        better = min(most, max(0.0, when + _correction(work, when)))
        if better == when:
            return when, error, evaluations
        change, when = better - when, better
    return when, error if abs(change) * hardest < _NEAR else math.inf, evaluations


@njit
def _shift(contact: Contact, work: Any, h: float) -> None:
    """Move the end of the step by h [s], so short that the classical method of Runge and Kutta is exact."""
    stages, there, trial = work.stages, work.there, work.stages[1]
    first, weights = dop853.STAGES, (0.5, 1.0, 0.0)
    for part in range(SIZE):
        trial[part] = there[part] + 0.5 * h * stages[first, part]
    for stage in range(3):
        derivative(contact, trial, stages[2 + stage])
        for part in range(SIZE):
            trial[part] = there[part] + weights[stage] * h * stages[2 + stage, part]
    for part in range(SIZE):
        outer, inner = stages[first, part] + stages[4, part], stages[2, part] + stages[3, part]
        there[part] += h / 6 * (outer + 2 * inner)


@njit
def _correction(work: Any, when: float) -> float:
    """Return by how much [s] the first zero is off, by Newton's method on the switches that have passed or reach it."""
    back, ahead, there = 0.0, math.inf, False
    for switch in range(SWITCHES):
        value, slope, small = work.value[1, switch], work.slope[1, switch], work.small[switch % 2]
        if passes(work.bits, switch):
            continue
        if value < -small:
            back = min(back, -value / slope if slope < 0.0 else -when / 2)
        elif slope < 0.0:
            there = there or value <= small
            ahead = min(ahead, -value / slope)
    if back < 0.0:
        return back
    return 0.0 if there or ahead == math.inf else ahead


@njit
def _cross_zeros(contact: Contact, work: Any) -> bool:
    """Change the regime for every switch that fell to zero in a step; return whether one did."""
    crossed = False
    for node in range(NODES):
        for switch in (2 * node, 2 * node + 1):
            if _falls_to_zero(work, switch):
                active_set.cross_zero(contact, work.there, switch)
                crossed = True
                break
    return crossed

"""The order of each scheme where two cubes meet: within a contact, and across what is not smooth in it.

Two cubes that tumble meet twice. Their exact motion is DOP853's (`simulation.pair.reference`). Along it are four
stretches: `held`, in which the contacts are the same all the time; `touch`, from before the cubes touch to within the
first contacts; `handed`, from the first contacts to the last ones of a meeting in which others take their place; and
`motion`, the whole of it. In each the schemes begin on the exact motion, and take more and more steps to its end. At a
touch the slope of the force jumps, with damping the force itself; where contacts are handed over, the energy is
continuous, but the force need not be.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.box_contact import law
from stiffdice.dynamics.box_contact.overlap import CONTACT, MOST
from stiffdice.dynamics.box_contact.pair_state import PairPhysics, Pairs, pair_physics_of, pair_start_of
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import coordinates, mapped, numbers, quantity, result
from stiffdice.experiments.pair.placement import IN_THE_AIR, pair_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.pair import PairScene
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation.pair import reference
from stiffdice.simulation.pair.run import simulate_pair

MODEL = "tumbling"
STRETCHES = ("held", "touch", "handed", "motion")

# In units of side, speed, and of the spin that turns a cube by one radian while it moves by its side.
_PLACES = (0.0, 0.0, IN_THE_AIR), (1.55, 0.3, IN_THE_AIR + 0.2)
_SPEEDS = (0.5, 0.1, 0.0), (-0.5, -0.1, 0.0)
_TURNS = (0.3, 0.2, 0.1), (-0.2, 0.5, 0.7)
_SPINS = (0.6, -1.0, 0.8), (-1.2, 0.6, 1.4)
# Of the duration, in units of side over speed; and at how many times of it the contacts are looked at.
_WAY, _LOOKS = 1.2, 4000
# Errors below are round-off's, or the reference's; above, steps are too long for an order to show.
_FLOOR, _CEILING = 1e-11, 1e-1


@njit(cache=True)
def _contacts(physics: PairPhysics, pairs: Pairs, found: npt.NDArray[np.int64]) -> None:
    """Set which contacts there are in each state: a number for a face and how many lie below it; 0 for none."""
    contacts = np.empty(2 * MOST, CONTACT)
    for k in range(len(pairs)):
        _, least = law.overlap(physics, pairs[k], contacts)
        face = 6 * least.box + 2 * least.face.axis + (1 if least.face.sign > 0 else 0)
        found[k] = 0 if least.number == 0 else 1 + face + 12 * least.number


class _Stretch(NamedTuple):
    """Of a motion: the states at its ends, and how long it lasts [s]."""

    begin: Pairs
    end: Pairs
    duration: float


def measure(
    scene: Scene,
    *,
    damping: Sequence[float] = (0.0, 1.0),
    stiffness: float = 300.0,
    speed: float = 1.0,
    steps: Sequence[int] = (4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192),
) -> xr.Dataset:
    """Return errors and orders of all schemes that two boxes can be run by.

    scene: gives the cube that both are. damping [kg/s], stiffness [kg/s²]: of the contact; no friction. speed [m/s]: at
    which the cubes near each other. steps: in each stretch.
    Dimensions stretch, damping, method, step_count. Raises InputError for a value out of range, and for a motion
    without all stretches.
    """
    damping = numbers("damping", damping, "kg/s", at_least=0)
    stiffness = validation.number("stiffness", stiffness, "kg/s²", above=0)
    speed = validation.number("speed", speed, "m/s", above=0)
    counts = [validation.count("steps", number) for number in steps]
    motions = {}
    for value in damping:
        pair = _meeting(scene, speed, stiffness, value)
        motions[value] = pair, _stretches(pair)

    def found(stretch: str, value: float, scheme: str) -> list[Array | float]:
        pair, stretches = motions[value]
        errors = np.array([_error(pair, stretches[stretch], scheme, count) for count in counts])
        return [errors / scene.cube.side, _order(np.array(counts), errors / scene.cube.side)]

    told = {
        "error": ("largest error of a centre or a node at the end, over the side", "1", "step_count"),
        "order": ("observed order: slope of the errors against the step", "1"),
    }
    variables = mapped(found, told, stretch=STRETCHES, damping=damping, method=schemes.OF_PAIRS)
    variables |= coordinates(step_count=counts)
    lasting = [[motions[value][1][name].duration for value in damping] for name in STRETCHES]
    variables["lasts"] = quantity(("stretch", "damping"), lasting, "duration of the stretch", "s")
    note = "two such cubes; launches and contact are the experiment's, not the scene's; no gravity, no friction"
    named = {"speed": speed, "stiffness": stiffness}
    return result(
        variables, "Orders of schemes of two cubes", scene, MODEL, "dop853", __name__, scene_note=note, **named
    )


def _meeting(scene: Scene, speed: float, stiffness: float, damping: float) -> PairScene:
    """Return two cubes that tumble at each other."""
    side = scene.cube.side
    launches, turning = [], scene.cube.moment_of_inertia * speed / side
    for place, velocity, turn, spin in zip(_PLACES, _SPEEDS, _TURNS, _SPINS, strict=True):
        moved = _vector(place, side), _vector(velocity, speed), _vector(spin, turning)
        launches.append(Launch(*moved, turn, "rigid"))
    lasting = dataclasses.replace(scene, duration=_WAY * side / speed)
    return pair_of(lasting, launches, gravity=0.0, stiffness=stiffness, damping=damping, friction=0.0)


def _vector(parts: tuple[float, float, float], size: float) -> tuple[float, float, float]:
    x, y, z = parts
    return x * size, y * size, z * size


def _stretches(pair: PairScene) -> dict[str, _Stretch]:
    """Return the stretches of a motion by name; raises InputError for a motion that does not have them."""
    times = np.linspace(0.0, pair.duration, _LOOKS)
    states = reference.states_at(pair, pair_start_of(pair), times.tolist())
    kind = np.zeros(_LOOKS, np.int64)
    _contacts(pair_physics_of(pair), states, kind)
    starts = np.flatnonzero(np.diff(kind, prepend=-1))
    sets = [(int(first), int(last)) for first, last in zip(starts, [*starts[1:], _LOOKS], strict=True)]
    meetings = [list(group) for touching, group in itertools.groupby(sets, lambda ends: kind[ends[0]] > 0) if touching]
    if not meetings or kind[0] or kind[-1] or max(map(len, meetings)) < 2:
        raise InputError("stiffness, speed: the cubes do not meet, or with one set of contacts alone")
    first, last = meetings[0][0]
    handing, part = max(meetings, key=len), (last - first) // 4
    begins = {
        "held": (first + part, last - part),
        "touch": (first - part, first + part),
        "handed": (sum(handing[0]) // 2, sum(handing[-1]) // 2),
        "motion": (0, _LOOKS - 1),
    }
    return {
        name: _Stretch(states[first : first + 1], states[last : last + 1], times[last] - times[first])
        for name, (first, last) in begins.items()
    }


def _error(pair: PairScene, stretch: _Stretch, scheme: str, steps: int) -> float:
    """Return the largest error of a centre or of a node's offset at the end [m]; not-a-number for a run that fails."""
    a, b = (dataclasses.replace(part, duration=stretch.duration) for part in pair.parts)
    run = simulate_pair(PairScene((a, b)), scheme=scheme, steps=steps, launches=stretch.begin)
    if run.steps_done[0] < steps:
        return float("nan")
    off = [np.abs(run.end[k][part] - stretch.end[k][part]).max() for k in "ab" for part in ("position", "node_offset")]
    return float(max(off))


def _order(steps: npt.NDArray[np.int64], errors: Array) -> float:
    """Return the slope of errors against the step in the logarithms, where they tell; NaN for fewer than three."""
    telling = (errors > _FLOOR) & (errors < _CEILING)
    if telling.sum() < 3:
        return float("nan")
    return float(-np.polyfit(np.log(steps[telling]), np.log(errors[telling]), 1)[0])

"""From measures, and from how a run ended, to a verdict: what it means to pass, for one run and for those of a cell."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.state import TOUCHING, TURNING, Physics, States
from stiffdice.integrators import linear_stability
from stiffdice.integrators import registry as schemes
from stiffdice.scene.rotation import along
from stiffdice.simulation.criteria.registry import CRITERIA, holds
from stiffdice.simulation.outcome import BLOW_UP, Verdict, gravest
from stiffdice.simulation.task import Members, Task

Flags = npt.NDArray[np.bool_]


def ending(measures: Mapping[str, npt.ArrayLike], endings: Mapping[Verdict, npt.ArrayLike]) -> npt.NDArray[np.int8]:
    """Return how each run ended whatever it is asked, a Verdict, int8; PASSED where nothing speaks against it.

    measures: values by name. endings: whether a run ended so, by verdict. Arrays are all of one shape, the result's.
    """
    ratio = np.asarray(measures["energy_ratio"])
    out_of_range = (np.asarray(measures["out_of_range"]) > 0) | np.isnan(ratio)
    return gravest({**endings, Verdict.BLEW_UP: ratio > BLOW_UP, Verdict.LEFT_NUMERIC_RANGE: out_of_range})


def passes(tolerances: Mapping[str, float], measures: Mapping[str, npt.ArrayLike], endings: npt.ArrayLike) -> Flags:
    """Return whether each criterion asked holds of a run that ended well, shape (criterion, ...).

    tolerances: of the criteria asked. measures: values by name. endings: as `ending` returns them.
    """
    well = np.asarray(endings) == Verdict.PASSED
    return np.stack(
        [well & holds(name, measures[CRITERIA[name].MEASURE], tolerance) for name, tolerance in tolerances.items()]
    )


def judge(
    tolerances: Mapping[str, float], measures: Mapping[str, npt.ArrayLike], endings: npt.ArrayLike
) -> npt.NDArray[np.int8]:
    """Return the Verdict of each run, int8: the gravest of the criteria it breaks and of how it ended.

    It is PASSED where `passes` says so of every criterion asked. Arguments as there.
    """
    ended = np.asarray(endings)
    applies: dict[Verdict, Flags] = {verdict: ended == verdict for verdict in Verdict if verdict != Verdict.PASSED}
    for name, tolerance in tolerances.items():
        fails = ~holds(name, measures[CRITERIA[name].MEASURE], tolerance)
        applies[CRITERIA[name].FAILURE] = applies[CRITERIA[name].FAILURE] | fails
    return gravest(applies)


def endings_of(task: Task) -> dict[Verdict, Flags]:
    """Return whether each run of a task that is over ended so, shape (member,), by the verdict that says it.

    Those are the verdicts that the last state, the launch, the steps and the budget tell. Steps are too long beyond the
    linear limit of a contact where a run touched the ground, beyond that of the ungated law's drag anywhere, or with
    more than half a turn in a step, at the launch or at the end. An engine's limits are its own.
    """
    setup, members, fewest = task.setup, task.members, np.zeros(len(task.launches))
    if setup.ours:
        contact, drag = linear_stability.fewest_steps(setup.scene, setup.model, setup.scheme)
        fewest = np.maximum(np.where(members.sight["touched"] > 0, contact, 0.0), drag)
    if setup.model in TURNING & TOUCHING and setup.scheme not in schemes.OWN_STEPS:
        for states in (task.launches, members.ensemble):
            fewest = np.fmax(fewest, linear_stability.half_turn_steps(setup.scene, states["angular_momentum"]))
    return {
        Verdict.UNRESOLVED: np.asarray(setup.steps < fewest),
        Verdict.SANK: sunk(task.system.physics, members),
        Verdict.STALLED: stalled(task.launches, setup.step_size),
        Verdict.UNDECIDED: (members.steps_done < setup.steps) & (members.spent >= task.limits.budget),
    }


def sunk(physics: Physics, members: Members) -> Flags:
    """Return whether every node ended below the ground, shape (member,), and not just in the middle of a bounce.

    A bounce ends, if the cube rests with its upper nodes out, and is no deeper than the energy of the launch takes it.
    """
    ends, sag = members.ensemble, members.sight["sag"]
    with np.errstate(all="ignore"):  # a run that blew up has infinite heights
        heights = along(ends["position"][:, None, :] + ends["node_offset"], (physics.nx, physics.ny, physics.nz))
        fall = np.sqrt(members.memory["energy"][:, 2] / (2 * physics.stiffness))
    bounces = (sag < physics.side) & (-heights.min(axis=1) <= 2 * sag + fall)
    return np.asarray((heights < 0).all(axis=1) & ~bounces)


def stalled(launches: States, h: float) -> Flags:
    """Return whether a step of h [s] at the speed of the launch is lost in round-off of the place, shape (member,)."""
    place, speed = launches["position"], launches["velocity"]
    with np.errstate(over="ignore"):  # launches may be anything
        return np.asarray(((speed != 0) & (place + h * speed == place)).any(axis=1))

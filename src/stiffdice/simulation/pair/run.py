"""A scene of two boxes + scheme + steps → trajectory and verdict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.box_contact.pair_state import PAIR, Pairs, pair_physics_of, pair_start_of
from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.pair import PairScene
from stiffdice.simulation import backend
from stiffdice.simulation.outcome import Verdict, gravest
from stiffdice.simulation.pair import energy
from stiffdice.simulation.pair.march import DEEP, LOST, MEMORY, Limits, begin, march

# How much more energy than at the launch boxes may have that nothing touches, over what they could ever give back.
TOLERANCE = 0.05


@dataclass(frozen=True)
class PairTrajectory:
    """Every K-th state of two boxes; all arrays have shape (time,).

    step: how many steps were done. time [s]: since the launch. state: records of both, `a` and `b` with the fields of
    those in a single body's trajectory. kinetic_energy [J]: of both, of translation and rotation. potential_energy [J]:
    m g z of both centres. elastic_energy [J]: in the ground's springs. contact_energy [J]: in the springs between the
    boxes. mechanical_energy [J]: all four, the velocity at the time of the place.
    """

    step: npt.NDArray[np.int64]
    time: Array
    state: Pairs
    kinetic_energy: Array
    potential_energy: Array
    elastic_energy: Array
    contact_energy: Array
    mechanical_energy: Array


@dataclass(frozen=True)
class PairRun:
    """A run of two boxes, or of many launches of them; arrays have shape (member,).

    scene: the problem. scheme: of the time steps. steps: their number to the scene's duration. verdict: int8, the
    `Verdict`. steps_done: int64, fewer than `steps` where a run could not go on. energy_ratio [1]: largest energy in
    the air, over that of the launch, counted from both boxes at rest on the ground. deepest [m]: contact between the
    boxes. meetings: how often they have begun to touch. end: states at the end, records of both, `a` and `b`.
    trajectory: None if no state was kept.
    """

    scene: PairScene
    scheme: str
    steps: int
    verdict: npt.NDArray[np.int8]
    steps_done: npt.NDArray[np.int64]
    energy_ratio: Array
    deepest: Array
    meetings: npt.NDArray[np.int64]
    end: Pairs
    trajectory: PairTrajectory | None


def check_scheme(scheme: str) -> None:
    """Raise InputError for a scheme that two boxes cannot be run by."""
    if scheme not in schemes.OF_PAIRS:
        validation.choice("scheme", scheme, schemes.SCHEMES)
        raise InputError(
            f"scheme = {scheme}: allowed is {' or '.join(schemes.OF_PAIRS)} for two cubes; {scheme} follows the "
            "contact of one cube with a plane; rk4 with short steps is the most accurate of these"
        )


def simulate_pair(
    scene: PairScene,
    *,
    scheme: str = backend.DEFAULT_SCHEME,
    steps: int = 10_000,
    every: int = 0,
    launches: Pairs | None = None,
    progress: Callable[[float], None] | None = None,
) -> PairRun:
    """Return a run of two boxes.

    scene: the problem. scheme: of the time steps. steps: to the scene's duration. every: keep each K-th state, none if
    0. launches: records of PAIR, shape (member,), in place of the scene's launch. progress: called with the share of
    the steps done.

    Raises InputError for values out of range, for a scheme that does not apply, and for a trajectory of many launches.
    """
    check_scheme(scheme)
    validation.count("steps", steps)
    validation.count("every", every, at_least=0, at_most=steps)
    pairs = pair_start_of(scene) if launches is None else launches.copy()
    if every and len(pairs) > 1:
        raise InputError(f"every = {every}: allowed is 0 for many launches")
    physics, memory = pair_physics_of(scene), np.zeros(len(pairs), MEMORY)
    half = min(min(cube.half_sides) for cube in scene.cubes)
    h = scene.duration / steps
    limits = Limits(steps, every, h, schemes.LAGS[scheme] * h, half)
    samples = np.empty(steps // every + 1 if every else 1, PAIR)
    samples[0] = pairs[0]
    begin(physics, pairs, memory)
    while march(schemes.SCHEMES[scheme], physics, pairs, memory, samples, limits, schemes.TOLERANCE):
        if progress is not None:
            progress(float(memory["done"].mean()) / steps)
    ratio = 1.0 + (memory["airborne"] - memory["launch"]) / _scale(scene, memory["launch"])
    applies: dict[Verdict, Any] = {
        Verdict.ENERGY_GREW: ~(ratio <= 1.0 + TOLERANCE),
        Verdict.DEEP: memory["ending"] == DEEP,
        Verdict.LEFT_NUMERIC_RANGE: memory["ending"] == LOST,
    }
    return PairRun(
        scene=scene,
        scheme=scheme,
        steps=steps,
        verdict=gravest(applies),
        steps_done=memory["done"].copy(),
        energy_ratio=ratio,
        deepest=memory["deepest"].copy(),
        meetings=memory["meetings"].copy(),
        end=pairs,
        trajectory=_trajectory(scene, scheme, steps, every, samples, int(memory["done"][0])) if every else None,
    )


def _scale(scene: PairScene, launch: Array) -> Array:
    """Return the energy [J] that boxes could ever give back: that of the launch, less that at rest on the ground."""
    rest = sum(cube.mass * scene.gravity * min(cube.half_sides) for cube in scene.cubes)
    scale = launch - rest
    return np.where(scale > 0.0, scale, 1.0)


def _trajectory(scene: PairScene, scheme: str, steps: int, every: int, samples: Pairs, done: int) -> PairTrajectory:
    state, h = samples[: done // every + 1], scene.duration / steps
    step = np.arange(len(state), dtype=np.int64) * every
    parts = energy.energies(pair_physics_of(scene), state, schemes.LAGS[scheme] * h)
    return PairTrajectory(step, step / steps * scene.duration, state, *parts)

"""Fine runs, for coarser ones to be compared with."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import numpy.typing as npt

from stiffdice import schemes, theory
from stiffdice.errors import InputError
from stiffdice.reference import SAMPLES, tabulated
from stiffdice.scene import Scene
from stiffdice.simulate import simulate
from stiffdice.state import Array, Ensemble, States

# A step resolves the contact frequency, and what damping does in a step, to this.
FINENESS = 0.01
# At least so many steps between two samples, for scenes with no fast contact.
FEWEST = 16


def references(
    scene: Scene, model: str, scheme: str, launches: States, horizon: float
) -> tuple[npt.NDArray[np.void], float]:
    """Return what to compare with until `horizon` [s], a REFERENCE for each launch, and how far off they are [m].

    The error is the largest difference from runs at half the steps, of the first launch; a first-order scheme is off by
    about as much. Raises InputError if a fine run leaves the range of doubles.
    """
    steps = _steps(scene, horizon)
    places = np.empty((len(launches), SAMPLES + 1, 3))
    velocities = np.empty_like(places)
    for k in range(len(launches)):
        places[k], velocities[k] = _table(scene, model, scheme, launches[k : k + 1], horizon, steps)
    coarser, _ = _table(scene, model, scheme, launches[:1], horizon, steps // 2)
    with np.errstate(over="ignore"):  # of a scene at the extremes
        error = float(np.sqrt(((coarser - places[0]) ** 2).sum(axis=-1)).max())
    return tabulated(horizon, places, velocities), error


def _steps(scene: Scene, horizon: float) -> int:
    """Return how many steps a reference takes: twice a whole multiple of the samples."""
    ground, mass = scene.ground, scene.cube.mass
    rate = max(theory.contact_frequency(ground.stiffness, mass), 8 * ground.damping / mass)
    per_sample = math.ceil(rate * horizon / FINENESS / (2 * SAMPLES))
    return 2 * SAMPLES * max(FEWEST // 2, per_sample)


def _table(scene: Scene, model: str, scheme: str, launch: States, horizon: float, steps: int) -> tuple[Array, Array]:
    """Return positions [m] and velocities [m/s] at the samples, shape (SAMPLES + 1, 3) each."""
    ahead = launch.copy()
    # A velocity that starts where the scheme's lags makes the flight exact, as in leapfrog.
    ahead["velocity"][:, 2] += schemes.LAGS[scheme] * scene.gravity * horizon / steps
    shorter = dataclasses.replace(scene, duration=horizon)
    members = Ensemble(ahead, np.zeros(1))
    run = simulate(shorter, model=model, scheme=scheme, steps=steps, every=steps // SAMPLES, members=members)
    if run.steps_done[0] < steps or run.trajectory is None:
        raise InputError(f"trajectory: its reference, {steps} steps, left the range of doubles")
    return run.trajectory.state["position"], run.trajectory.state["velocity"]

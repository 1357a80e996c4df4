"""Runs that are as good as exact, for others to be compared with."""

from __future__ import annotations

import dataclasses

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.state import Array, Ensemble, States
from stiffdice.errors import InputError
from stiffdice.scene.scene import Scene
from stiffdice.simulation.criteria.trajectory import SAMPLES, empty
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate

# Errors at this tolerance do not matter: about a millionth of a step's, in contact. One made a hundred times as large
# tells how large they are.
TOLERANCE = 1e-10
COARSER = 100


def references(scene: Scene, model: str, launches: States, horizon: float) -> tuple[npt.NDArray[np.void], float]:
    """Return what to compare with until `horizon` [s], a REFERENCE for each launch, and a bound of their error [m].

    By the scheme `event`; the bound is the largest difference, for the first launch, from a run at a hundred times the
    tolerance. Raises InputError if a run leaves the range of doubles, or takes more than `registry.BUDGET`.
    """
    found = empty(len(launches), horizon)
    for k in range(len(launches)):
        found["position"][k], found["velocity"][k] = _table(scene, model, launches[k : k + 1], horizon, TOLERANCE)
    coarser, _ = _table(scene, model, launches[:1], horizon, COARSER * TOLERANCE)
    with np.errstate(over="ignore"):  # of a scene at the extremes
        bound = float(np.sqrt(((coarser - found["position"][0]) ** 2).sum(axis=-1)).max())
    return found, bound


def _table(scene: Scene, model: str, launch: States, horizon: float, tolerance: float) -> tuple[Array, Array]:
    """Return positions [m] and velocities [m/s] at the samples, shape (SAMPLES + 1, 3) each."""
    shorter, members = dataclasses.replace(scene, duration=horizon), Ensemble(launch, np.zeros(1))
    run = simulate(shorter, model=model, scheme="event", steps=SAMPLES, every=1, tolerance=tolerance, members=members)
    if run.steps_done[0] < SAMPLES or run.trajectory is None:
        raise InputError(f"trajectory: its reference ended early, {Verdict(run.verdict[0]).sentence}")
    return run.trajectory.state["position"], run.trajectory.state["velocity"]

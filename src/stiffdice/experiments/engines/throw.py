"""The paper's throw in every engine: how far each is from the reference over time, with the more steps the closer.

A throw is chaotic: at each landing the difference between two runs grows. So it is compared while it is small, and a
method's own convergence beside it: what no shorter step makes less is not the step's, but the contact's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import STATE, Array, start_of
from stiffdice.errors import InputError
from stiffdice.experiments.layout import AXIS, EFFORTS, Variable, method_axis, quantity
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import stepper

MODEL, REFERENCE = "tumbling", "event"

METHODS = ("symplectic_euler", "scipy", "numpy")

# Of the reference, and of the run that says how far it can be trusted.
_FINEST, _COARSER = schemes.FINEST, 1e-10

# A method's efforts, from the least: parts of its steps, or tolerances of one that takes its own.
_PARTS = (64, 16, 4, 1)
_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-11)


class _Made(NamedTuple):
    """One run: its places [m], shape (time, 3), its steps or tolerance, and its force evaluations."""

    place: Array
    steps: int
    tolerance: float
    evaluations: int


def measure(scene: Scene, *, methods: Sequence[str] = METHODS, steps: float = 4e7, samples: int = 400) -> xr.Dataset:
    """Return where the cube is, dimensions method, effort, time, axis, and its distance from the reference.

    methods: names of schemes and engines; one that cannot represent the scene is left out, and `unfit` says why.
    steps: of the simplest scheme at the most; of another so many less as its steps take longer (`Peer.dearness`),
    so that each is given about the same time. samples: equal parts of the duration; a state is stored after each.
    `reference_error` is how far the reference is from the same at a thousand times its tolerance.

    Raises InputError for a number out of range, an engine that is not installed, and a scene that none can represent.
    """
    samples = validation.count("samples", samples)
    most = validation.number("steps", steps, "1", at_least=samples)
    reasons = {name: stepper.unfit(name, scene, MODEL) for name in stepper.chosen_from(methods)}
    names = [name for name, why in reasons.items() if why is None]
    if not names:
        raise InputError(f"methods: none of them can represent the scene: {'; '.join(map(str, reasons.values()))}")
    reference, coarser = (_made(REFERENCE, scene, samples, samples, tolerance) for tolerance in (_FINEST, _COARSER))
    runs = [_runs(name, scene, samples, most) for name in names]
    attributes = dataset.provenance_attributes("The throw in every engine", scene, MODEL, "method", __name__)
    attributes |= stepper.attributes(names) | {
        "reference": REFERENCE,
        "unfit": "; ".join(f"{name}: {why}" for name, why in reasons.items() if why is not None),
    }
    time = np.arange(samples + 1) / samples * scene.duration
    return xr.Dataset(
        _variables(runs, reference.place, coarser.place),
        {
            "method": method_axis(names),
            "time": quantity("time", time, "time since the launch", "s"),
            "axis": AXIS,
        },
        attributes,
    )


def _runs(method: str, scene: Scene, samples: int, most: float) -> list[_Made]:
    if stepper.own_steps(method):
        return [_made(method, scene, samples, samples, tolerance) for tolerance in _TOLERANCES]
    finest = most / stepper.dearness(method)
    return [_made(method, scene, samples, samples * max(1, round(finest / part / samples))) for part in _PARTS]


def _made(method: str, scene: Scene, samples: int, steps: int, tolerance: float = np.nan) -> _Made:
    launch, states = start_of(scene, MODEL), np.zeros(samples, STATE)
    wanted = schemes.TOLERANCE if np.isnan(tolerance) else tolerance
    engine = stepper.start(method, scene, MODEL, launch, scene.duration / steps, wanted)
    evaluations = engine.advance(states, steps // samples)
    places = np.concatenate([launch["position"], states["position"]])
    return _Made(places, 0 if stepper.own_steps(method) else steps, tolerance, evaluations)


def _variables(runs: list[list[_Made]], reference: Array, coarser: Array) -> dict[str, Variable]:
    grid = ("method", "effort")
    place = np.array([[run.place for run in row] for row in runs])
    with np.errstate(all="ignore"):  # a run that blew up
        distance = np.linalg.norm(place - reference, axis=-1)
    return {
        "position": quantity((*grid, "time", "axis"), place, "centre of mass", "m"),
        "distance": quantity((*grid, "time"), distance, "distance of the centre from the reference", "m"),
        "reference_position": quantity(("time", "axis"), reference, "centre of mass by the reference", "m"),
        "reference_error": quantity(
            "time", np.linalg.norm(coarser - reference, axis=-1), "distance of the reference from a coarser one", "m"
        ),
        "evaluations": quantity(grid, [[run.evaluations for run in row] for row in runs], "evaluations of the force"),
        "steps": quantity(grid, [[run.steps for run in row] for row in runs], *EFFORTS["steps"]),
        "tolerance": quantity(grid, [[run.tolerance for run in row] for row in runs], *EFFORTS["tolerance"]),
    }

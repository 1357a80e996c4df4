"""The paper's throw in every engine: how far each is from the reference over time, with the more steps the closer.

A throw is chaotic: at each landing what two runs differ by grows. So it is told while it is small, and a method's own
convergence beside it: what no shorter step makes less is not the step's, but the contact's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import STATE, Array, States, start_of
from stiffdice.errors import InputError
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
    so that each is given about the same time. samples: equal parts of the duration, after each of which a state is
    kept. `reference_error` is how far the reference is from the same at a thousand times its tolerance.

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
    attributes = dataset.provenance_attributes(
        "The throw in every engine", scene, MODEL, "method", "stiffdice.experiments.engines.throw"
    )
    attributes |= stepper.attributes(names) | {
        "reference": REFERENCE,
        "unfit": "; ".join(f"{name}: {why}" for name, why in reasons.items() if why is not None),
    }
    time = np.arange(samples + 1) / samples * scene.duration
    return xr.Dataset(_variables(runs, reference.place, coarser.place), _coordinates(names, time), attributes)


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
    return _Made(_places(launch, states), 0 if stepper.own_steps(method) else steps, tolerance, evaluations)


def _places(launch: States, states: States) -> Array:
    return np.concatenate([launch["position"], states["position"]])


def _variables(runs: list[list[_Made]], reference: Array, coarser: Array) -> dict[str, Any]:
    grid = ("method", "effort")
    place = np.array([[run.place for run in row] for row in runs])
    with np.errstate(all="ignore"):  # a run that blew up
        distance = np.linalg.norm(place - reference, axis=-1)
    described: tuple[tuple[str, Any, Any, str, str], ...] = (
        ("position", (*grid, "time", "axis"), place, "centre of mass", "m"),
        ("distance", (*grid, "time"), distance, "distance of the centre from the reference", "m"),
        ("reference_position", ("time", "axis"), reference, "centre of mass by the reference", "m"),
        (
            "reference_error",
            ("time",),
            np.linalg.norm(coarser - reference, axis=-1),
            "distance of the reference from a coarser one",
            "m",
        ),
        ("evaluations", grid, [[run.evaluations for run in row] for row in runs], "evaluations of the force", "1"),
    )
    told: dict[str, Any] = {
        name: (dims, values, {"long_name": text, "units": unit}) for name, dims, values, text, unit in described
    }
    return told | {
        "steps": (grid, [[run.steps for run in row] for row in runs], dataset.EFFORT_ATTRIBUTES["steps"]),
        "tolerance": (grid, [[run.tolerance for run in row] for row in runs], dataset.EFFORT_ATTRIBUTES["tolerance"]),
    }


def _coordinates(names: list[str], time: Array) -> dict[str, Any]:
    return {
        "method": dataset.method_coordinates([1.0], names)["method"],
        "time": ("time", time, {"long_name": "time since the launch", "units": "s"}),
        "axis": ("axis", np.arange(3, dtype=np.int8), dataset.AXIS_ATTRIBUTES),
    }

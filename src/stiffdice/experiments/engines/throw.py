"""The paper's throw in every engine: how far each is from the reference over time, with the more steps the closer.

A throw is chaotic: at each landing the difference between two runs grows. So it is compared while it is small, and a
method's own convergence beside it: what no shorter step makes less is not the step's, but the contact's.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import coordinates, mapped, quantity
from stiffdice.experiments.work_precision.effort import EFFORTS
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import registry as engines

MODEL, REFERENCE = "tumbling", "event"

METHODS = ("symplectic_euler", "scipy", "numpy")

# Of the reference, and of the run that says how far it can be trusted.
_FINEST, _COARSER = schemes.FINEST, 1e-10

# A method's efforts, from the least: parts of its steps, or tolerances of one that takes its own.
_PARTS = (64, 16, 4, 1)
_TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-11)


_DESCRIBED = {
    "position": ("centre of mass", "m", "effort", "time", "axis"),
    "distance": ("distance of the centre from the reference", "m", "effort", "time"),
    "steps": (*EFFORTS["steps"], "effort"),
    "tolerance": (*EFFORTS["tolerance"], "effort"),
    "evaluations": ("evaluations of the force", "1", "effort"),
}


def measure(scene: Scene, *, methods: Sequence[str] = METHODS, steps: float = 4e7, samples: int = 400) -> xr.Dataset:
    """Return where the cube is, dimensions method, effort, time, axis, and its distance from the reference.

    methods: names of schemes and engines; one that cannot represent the scene is left out, and `unfit` says why.
    steps: of the simplest scheme at the most; of another so many less as its steps take longer (`Peer.dearness`).
    samples: equal parts of the duration, after which states are compared.
    `reference_error` is how far the reference is from the same at a thousand times its tolerance.
    Raises InputError for a number out of range, an engine that is not installed, and a scene that none can represent.
    """
    samples = validation.count("samples", samples)
    most = validation.number("steps", steps, "1", at_least=samples)
    reasons = {name: engines.adapter_of(name).unfit(scene, MODEL) for name in engines.chosen_from(methods)}
    names = [name for name, why in reasons.items() if why is None]
    if not names:
        raise InputError(f"methods: none of them can represent the scene: {'; '.join(map(str, reasons.values()))}")

    def path(method: str, steps: int, tolerance: float) -> tuple[Array, int]:
        found = engines.ready(method, scene, MODEL, steps, samples, tolerance)()()
        return found.states["position"], found.evaluations

    (reference, _), (coarser, _) = (path(REFERENCE, samples, size) for size in (_FINEST, _COARSER))

    def efforts(method: str) -> tuple[Any, ...]:
        own, finest = engines.METHODS[method].own_steps, most / engines.METHODS[method].dearness
        counts = [samples * max(1, round(finest / part / samples)) for part in _PARTS]
        tried = [(samples, size) for size in _TOLERANCES] if own else [(count, np.nan) for count in counts]
        places, evaluations = zip(*(path(method, *effort) for effort in tried), strict=True)
        with np.errstate(all="ignore"):  # a run that blew up
            distance = np.linalg.norm(np.array(places) - reference, axis=-1)
        steps, tolerances = zip(*tried, strict=True)
        return places, distance, np.zeros_like(steps) if own else steps, tolerances, evaluations

    time = np.arange(samples + 1) / samples * scene.duration
    found = mapped(efforts, _DESCRIBED, method=names) | coordinates(time=time, axis=dataset.AXES)
    apart = np.linalg.norm(coarser - reference, axis=-1)
    found["reference_position"] = quantity(("time", "axis"), reference, "centre of mass by the reference", "m")
    found["reference_error"] = quantity("time", apart, "distance of the reference from a coarser one", "m")
    attributes = dataset.provenance_attributes("The throw in every engine", scene, MODEL, "method", __name__)
    unfit = "; ".join(f"{name}: {why}" for name, why in reasons.items() if why is not None)
    return xr.Dataset(found, attrs=attributes | engines.attributes(names) | {"reference": REFERENCE, "unfit": unfit})

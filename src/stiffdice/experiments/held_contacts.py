"""How right `event` is where friction holds a corner: its error against its tolerance, and what that costs.

Friction that is strong beside the ground's slope of fall holds a corner that lands: from then on the motion is stiff.
Launches that differ in orientation are thrown on grounds from smooth to rough and from soft to stiff, by `event` and by
a method that shares nothing with it but the forces, SciPy's LSODA, which tells by a tenth of the tolerance how right it
is itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import STATE, Array
from stiffdice.experiments.measuring import coordinates, mapped, numbers, result
from stiffdice.experiments.placement import relaunched
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines import stepper
from stiffdice.simulation.initial_conditions import turned

MODEL, SCHEME = "tumbling", "event"

# Equal parts of the duration, after which paths are compared.
SAMPLES = 12

# Of LSODA: what is taken for right, and what tells how right it is.
_REFERENCE, _COARSER = 1e-13, 1e-12

_DESCRIBED = {
    "error": ("root mean square distance of the centre's path from LSODA's, in radii", "1", "tolerance"),
    "evaluations": ("evaluations of the force", "1", "tolerance"),
    "reference_error": ("the same of LSODA's path at ten times the tolerance", "1"),
    "reference_evaluations": ("evaluations by LSODA", "1"),
}


def measure(
    scene: Scene,
    *,
    friction: Sequence[float] = (0.0, 0.1, 0.3, 0.6, 1.0),
    stiffness: Sequence[float] = (1e2, 1e4, 1e6, 1e8, 1e10, 1e12),
    tolerance: Sequence[float] = (1e-5, 1e-7, 1e-9, 1e-11, 1e-13),
    launches: int = 8,
) -> xr.Dataset:
    """Return the error of `event` and its force evaluations, dimensions friction, stiffness, launch, tolerance.

    scene: gives the rest; the ground is gated and corners start as the body turns. friction [1], stiffness [kg/s²]:
    of the ground. tolerance [1]: of `event`. launches: so many orientations and axes of the spin, first the scene's.
    `error` [1] is the root mean square distance from LSODA's path, in radii; `reference_error` that of LSODA's at ten
    times its tolerance from its own; both are not-a-number where LSODA did not arrive. Raises InputError for a number
    out of range.
    """
    axes: dict[str, Any] = {
        "friction": numbers("friction", friction, "1", at_least=0),
        "stiffness": numbers("stiffness", stiffness, "kg/s²", above=0),
        "launch": range(validation.count("launches", launches)),
    }
    tolerances = numbers("tolerance", tolerance, "1", at_least=schemes.FINEST)
    scene = relaunched(scene.with_ground(contact="gated"), node_velocity="rigid")
    starts = turned(scene, MODEL, launches)

    def compared(friction: float, stiffness: float, launch: int) -> tuple[Array, Any, float, int]:
        rough, start = scene.with_ground(friction=friction, stiffness=stiffness), starts[launch : launch + 1]

        def path(method: str, size: float) -> tuple[Array, int]:
            states = np.zeros(SAMPLES, STATE)
            evaluations = stepper.start(method, rough, MODEL, start, scene.duration / SAMPLES, size).advance(states, 1)
            return states["position"], evaluations

        right, reference = path("scipy", _REFERENCE)
        paths, counts = zip(*(path(SCHEME, size) for size in tolerances), strict=True)
        away = np.array([*paths, path("scipy", _COARSER)[0]]) - right
        apart = np.sqrt((away**2).sum(axis=-1).mean(axis=-1)) / scene.cube.radius
        return apart[:-1], counts, apart[-1], reference

    found = mapped(compared, _DESCRIBED, **axes) | coordinates(tolerance=tolerances)
    note = "friction, stiffness and orientation are those of the dimensions"
    return result(found, "Corners held by friction", scene, MODEL, SCHEME, __name__, scene_note=note)

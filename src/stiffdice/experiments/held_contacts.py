"""How right `event` is where friction holds a corner: its error against its tolerance, and what that costs.

Friction that is strong beside the ground's slope of fall holds a corner that lands: from then on the motion is stiff.
Launches that differ in orientation are thrown on grounds from smooth to rough and from soft to stiff, by `event` and by
a method that shares nothing with it but the forces, SciPy's LSODA, which tells by a tenth of the tolerance how right it
is itself.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import STATE, Array, Ensemble, States
from stiffdice.experiments import options
from stiffdice.experiments.layout import of_cells, quantity
from stiffdice.experiments.placement import relaunched
from stiffdice.experiments.sampling import states_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import scipy_ivp
from stiffdice.simulation.initial_conditions import turned
from stiffdice.simulation.run import simulate

MODEL, SCHEME = "tumbling", "event"

# Equal parts of the duration, after which paths are compared.
SAMPLES = 12

# Of LSODA: what is taken for right, and what tells how right it is.
_REFERENCE, _COARSER = 1e-13, 1e-12


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
    coefficients = options.numbers("friction", friction, "1", at_least=0)
    grounds = options.stiffnesses(stiffness)
    tolerances = options.numbers("tolerance", tolerance, "1", at_least=schemes.FINEST)
    launches = validation.count("launches", launches)
    scene = relaunched(scene.with_ground(contact="gated"), node_velocity="rigid")
    starts = turned(scene, MODEL, launches)
    shape = len(coefficients), len(grounds), launches
    error, evaluations = np.full((*shape, len(tolerances)), np.nan), np.zeros((*shape, len(tolerances)), np.int64)
    reference_error, reference_evaluations = np.full(shape, np.nan), np.zeros(shape, np.int64)
    for i, j, k in np.ndindex(shape):
        rough = scene.with_ground(friction=coefficients[i], stiffness=grounds[j])
        start = starts[k : k + 1]
        right, reference_evaluations[i, j, k] = _by_lsoda(rough, start, _REFERENCE)
        reference_error[i, j, k] = _apart(rough, _by_lsoda(rough, start, _COARSER)[0], right)
        for t, size in enumerate(tolerances):
            path, evaluations[i, j, k, t] = _by_event(rough, start, size)
            error[i, j, k, t] = _apart(rough, path, right)
    grid = ("friction", "stiffness", "launch")
    by_tolerance = (*grid, "tolerance")
    attributes = dataset.provenance_attributes(
        "Corners held by friction", scene, MODEL, SCHEME, __name__, scipy_ivp.__name__
    )
    return xr.Dataset(
        {
            "error": quantity(
                by_tolerance, error, "root mean square distance of the centre's path from LSODA's, in radii"
            ),
            "evaluations": (by_tolerance, evaluations, dataset.EVALUATIONS_ATTRIBUTES),
            "reference_error": quantity(grid, reference_error, "the same of LSODA's path at ten times the tolerance"),
            "reference_evaluations": quantity(grid, reference_evaluations, "evaluations by LSODA"),
        },
        {
            "friction": quantity("friction", coefficients, "friction coefficient"),
            "stiffness": of_cells("stiffness", grounds),
            "launch": quantity("launch", np.arange(launches), "orientation of the launch, 0 the scene's"),
            "tolerance": quantity("tolerance", tolerances, "tolerance of the scheme event"),
        },
        attributes | {"scene_note": "friction, stiffness and orientation are those of the dimensions"},
    )


def _by_lsoda(scene: Scene, launch: States, tolerance: float) -> tuple[Array, int]:
    """Return the centre's places [m], shape (SAMPLES, 3), and evaluations."""
    states = np.zeros(SAMPLES, STATE)
    run = scipy_ivp.Lsoda(scene, MODEL, launch, scene.duration / SAMPLES, tolerance)
    evaluations = run.advance(states, 1)
    return states["position"], evaluations


def _by_event(scene: Scene, launch: States, tolerance: float) -> tuple[Array, int]:
    """Return the same by `event`."""
    members = Ensemble(launch, np.zeros(1))
    run = simulate(scene, model=MODEL, scheme=SCHEME, steps=SAMPLES, every=1, tolerance=tolerance, members=members)
    return states_of(run, SAMPLES)["position"][1:], int(run.evaluations[0])


def _apart(scene: Scene, one: Array, other: Array) -> float:
    return math.sqrt(float(((one - other) ** 2).sum(axis=1).mean())) / scene.cube.radius

"""How long a step of a method may be: one flat bounce, and a cube at rest, at one ωh after another.

A bounce is made at several phases of the step at touch-down, and told by its restitution. A cube at rest is nudged, and
told by how far it then gets from where it rests.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.dynamics.state import STATE, start_of
from stiffdice.errors import InputError
from stiffdice.experiments.engines.single_bounce import MODEL, OUTCOMES, Bounce, bounce, landing_speed, level
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import stepper

# The paper's scheme, the one that is like what engines do to contacts, and the engines that are always there.
METHODS = ("symplectic_euler", "implicit_euler", "scipy", "numpy")

# Magic steps, and those half way between them, are looked at down to this number of steps in a contact.
_MAGIC = 8

# Of a cube at rest: the nudge in units of the sag, and the steps for which it is followed.
_NUDGE, _FOLLOWED = 0.01, 200


def measure(
    scene: Scene,
    *,
    methods: Sequence[str] = METHODS,
    omega_h: Sequence[float] = (0.02, 20.0),
    count: int = 37,
    phases: int = 12,
) -> xr.Dataset:
    """Return restitution and outcome of bounces, dimensions method, omega_h and phase; and the growth of a nudge.

    scene: gives the cube, gravity, stiffness, damping, and the speed at which its launch meets the ground, which is
    level, gated and without friction. methods: names of schemes and engines. omega_h: ends of the span. count: values
    in it, evenly in their logarithm, to which the longest magic steps are added and those half way between them, at
    which symplectic Euler is at its best and worst. phases: how many, evenly over a step from 0 on.
    `restitution` is not-a-number unless the cube leaves the ground. `rest_growth` is the largest distance from where
    the cube would rest, over the nudge; infinite where it blows up.

    Raises InputError for a number out of range, an engine that is not installed, and a scene whose cube would not
    bounce flat and short.
    """
    names = stepper.chosen_from(methods)
    scan = _scan(omega_h, validation.count("count", count, at_least=2))
    phase = np.arange(validation.count("phases", phases)) / phases
    smooth = level(scene, friction=0.0)
    speed, omega = landing_speed(smooth), linear_theory.contact_frequency(scene.ground.stiffness, scene.cube.mass)
    bounces = [
        [[bounce(name, smooth, speed, value / omega, float(part)) for part in phase] for value in scan]
        for name in names
    ]
    growth = [[_growth(name, smooth, value / omega) for value in scan] for name in names]
    return _dataset(scene, names, scan, phase, bounces, growth).assign(
        exact_restitution=((), flat_bounce.restitution(smooth, speed), {"long_name": "exact restitution", "units": "1"})
    )


def _scan(span: Sequence[float], count: int) -> list[float]:
    ends = [validation.number("omega_h", value, "1", above=0) for value in span]
    if len(ends) != 2 or not ends[0] < ends[1]:
        raise InputError(f"omega_h = {validation.shown(list(span))}: allowed are two numbers, 0 < low < high [1]")
    low, high = ends
    special = [linear_theory.magic_step(n) for n in np.arange(1.5, _MAGIC + 1, 0.5)]
    inside = [value for value in special if low < value < high]
    return np.unique([low, *np.geomspace(low, high, count)[1:-1], high, *inside]).tolist()


def _growth(method: str, scene: Scene, h: float) -> float:
    sag = linear_theory.sag(scene)
    rest, nudge = scene.cube.side / 2 - sag, _NUDGE * sag
    launch = Launch((0.0, 0.0, rest + nudge), (0.0, 0.0, 0.0), node_velocity="rigid")
    resting = dataclasses.replace(scene, launch=launch, duration=_FOLLOWED * h)
    states = np.zeros(_FOLLOWED, STATE)
    stepper.start(method, resting, MODEL, start_of(resting, MODEL), h).advance(states, 1)
    away = float(np.abs(states["position"][:, 2] - rest).max()) / nudge
    return away if math.isfinite(away) else math.inf


def _dataset(
    scene: Scene,
    names: list[str],
    scan: list[float],
    phase: Any,
    bounces: list[list[list[Bounce]]],
    growth: list[list[float]],
) -> xr.Dataset:
    grid = ("method", "omega_h", "phase")
    told = {"restitution": [[[part.restitution for part in row] for row in table] for table in bounces]}
    outcome = [[[OUTCOMES.index(part.outcome) for part in row] for row in table] for table in bounces]
    attributes = dataset.provenance_attributes(
        "The longest steps", scene, MODEL, "method", "stiffdice.experiments.engines.limits"
    )
    attributes |= stepper.attributes(names) | {"scene_note": "ground: level, gated, without friction; an upright cube"}
    variables: dict[str, Any] = {
        "restitution": (grid, told["restitution"], {"long_name": "restitution of one flat bounce", "units": "1"}),
        "outcome": (grid, np.array(outcome, np.int8), enum_attributes("what becomes of the cube", OUTCOMES)),
        "rest_growth": (
            grid[:2],
            growth,
            {"long_name": f"growth of a nudge of a cube at rest in {_FOLLOWED} steps", "units": "1"},
        ),
    }
    coordinates: dict[str, Any] = {
        "method": dataset.method_coordinates([1.0], names)["method"],
        "omega_h": ("omega_h", scan, dataset.CELL_ATTRIBUTES["omega_h"]),
        "phase": ("phase", phase, {"long_name": "fraction of the step before the nodes meet the ground", "units": "1"}),
    }
    return xr.Dataset(variables, coordinates, attributes)

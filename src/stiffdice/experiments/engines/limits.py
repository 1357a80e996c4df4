"""How long a step of a method may be: one flat bounce, and a cube at rest, at one ωh after another.

Bounces at several phases of the step at touch-down are measured by their restitution. A cube at rest is nudged, and
measured by its largest distance from its place of rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.experiments import options
from stiffdice.experiments.engines.single_bounce import MODEL, OUTCOMES, bounce, flat, heights_at_rest
from stiffdice.experiments.layout import method_axis, of_cells, quantity
from stiffdice.experiments.placement import contact_frequency, landing_speed
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import stepper

# The paper's scheme, the one that is like what engines do to contacts, and the engines that are always there.
METHODS = ("symplectic_euler", "implicit_euler", "scipy", "numpy")

# Magic steps, and those half way between them, are in the scan down to this number of steps in a contact.
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
    special = [linear_theory.magic_step(n) for n in np.arange(1.5, _MAGIC + 1, 0.5)]
    scan = options.scan(*options.span(omega_h), validation.count("count", count, at_least=2), special).tolist()
    phase = np.arange(validation.count("phases", phases)) / phases
    smooth = flat(scene, friction=0.0)
    speed, omega = landing_speed(smooth), contact_frequency(scene)
    bounces = [
        [[bounce(name, smooth, speed, value / omega, float(part)) for part in phase] for value in scan]
        for name in names
    ]
    growth = [[_growth(name, smooth, value / omega) for value in scan] for name in names]
    grid = ("method", "omega_h", "phase")
    restitution = [[[part.restitution for part in row] for row in table] for table in bounces]
    outcome = [[[OUTCOMES.index(part.outcome) for part in row] for row in table] for table in bounces]
    attributes = dataset.provenance_attributes("The longest steps", scene, MODEL, "method", __name__)
    attributes |= stepper.attributes(names) | {"scene_note": "ground: level, gated, without friction; an upright cube"}
    return xr.Dataset(
        {
            "restitution": quantity(grid, restitution, "restitution of one flat bounce"),
            "outcome": (grid, np.array(outcome, np.int8), enum_attributes("what becomes of the cube", OUTCOMES)),
            "rest_growth": quantity(grid[:2], growth, f"growth of a nudge of a cube at rest in {_FOLLOWED} steps"),
            "exact_restitution": quantity((), flat_bounce.restitution(smooth, speed), "exact restitution"),
        },
        {
            "method": method_axis(names),
            "omega_h": of_cells("omega_h", scan),
            "phase": quantity("phase", phase, "fraction of the step before the nodes meet the ground"),
        },
        attributes,
    )


def _growth(method: str, scene: Scene, h: float) -> float:
    sag = linear_theory.sag(scene)
    nudge = _NUDGE * sag
    heights = heights_at_rest(method, scene, h, _FOLLOWED, nudge)
    away = float(np.abs(heights - (scene.cube.side / 2 - sag)).max()) / nudge
    return away if math.isfinite(away) else math.inf

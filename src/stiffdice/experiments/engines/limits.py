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
from stiffdice.experiments.engines.single_bounce import MODEL, OUTCOMES, bounce, flat, heights_at_rest
from stiffdice.experiments.measuring import coordinates, mapped, quantity, scan, span
from stiffdice.experiments.placement import contact_frequency, landing_speed
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import registry as engines

# The paper's scheme, the one that is like what engines do to contacts, and the engines that are always there.
METHODS = ("symplectic_euler", "implicit_euler", "scipy", "numpy")

# Magic steps, and those half way between them, are in the scan down to this number of steps in a contact.
_MAGIC = 8

# Of a cube at rest: the nudge in units of the sag, and the steps for which it is followed.
_NUDGE, _FOLLOWED = 0.01, 200

_DESCRIBED = {
    "restitution": ("restitution of one flat bounce", "1", "phase"),
    "outcome": ("what becomes of the cube", "1", "phase"),
    "rest_growth": (f"growth of a nudge of a cube at rest in {_FOLLOWED} steps", "1"),
}


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
    in it, evenly in their logarithm, besides the longest magic steps and those half way between them. phases: how many,
    evenly over a step from 0 on. `restitution` is not-a-number unless the cube leaves the ground; `rest_growth` the
    largest distance from where it would rest over the nudge, infinite where it blows up.
    Raises InputError for a number out of range, an engine that is not installed, and a scene whose cube would not
    bounce flat and short.
    """
    names = engines.chosen_from(methods)
    special = [linear_theory.magic_step(n) for n in np.arange(1.5, _MAGIC + 1, 0.5)]
    values = scan(*span(omega_h), validation.count("count", count, at_least=2), special).tolist()
    phase = np.arange(validation.count("phases", phases)) / phases
    smooth = flat(scene, friction=0.0)
    speed, omega = landing_speed(smooth), contact_frequency(scene)

    def fates(method: str, value: float) -> tuple[list[float], list[int], float]:
        h = value / omega
        bounces = [bounce(method, smooth, speed, h, part) for part in phase.tolist()]
        outcomes = [OUTCOMES.index(part.outcome) for part in bounces]
        return [part.restitution for part in bounces], outcomes, _growth(method, smooth, h)

    found = mapped(fates, _DESCRIBED, method=names, omega_h=values) | coordinates(phase=phase)
    dimensions, outcome, _ = found["outcome"]
    found["outcome"] = dimensions, outcome.astype(np.int8), enum_attributes("what becomes of the cube", OUTCOMES)
    found["exact_restitution"] = quantity((), flat_bounce.restitution(smooth, speed), "exact restitution")
    attributes = dataset.provenance_attributes("The longest steps", scene, MODEL, "method", __name__)
    note = "ground: level, gated, without friction; an upright cube"
    return xr.Dataset(found, attrs=attributes | engines.attributes(names) | {"scene_note": note})


def _growth(method: str, scene: Scene, h: float) -> float:
    sag = linear_theory.sag(scene)
    nudge = _NUDGE * sag
    heights = heights_at_rest(method, scene, h, _FOLLOWED, nudge)
    away = float(np.abs(heights - (scene.cube.side / 2 - sag)).max()) / nudge
    return away if math.isfinite(away) else math.inf

"""How a method's contact maps onto the gated law: the depth of a cube at rest, and one flat bounce, over the exact.

What is off and becomes less with the step is the step's; what stays is the contact's. A bounce is made twice: without
friction, and with the scene's, which takes mu times the normal impulse of a cube that slides all the while.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
import xarray as xr

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments.engines.limits import METHODS
from stiffdice.experiments.engines.single_bounce import MODEL, bounce, flat, heights_at_rest
from stiffdice.experiments.measuring import mapped, numbers
from stiffdice.experiments.placement import contact_frequency, landing_speed
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import registry as engines

# By name: what is stored of each method, over what is exact.
RATIOS = {
    "rest_depth": ("mean depth of a cube at rest over m g/(4S)", "1"),
    "restitution": ("restitution of a flat bounce without friction over the exact one", "1"),
    "contact_time": ("time below the surface in that bounce over the exact one", "1"),
    "rough_restitution": ("restitution of a sliding bounce with friction over the exact one, which is the same", "1"),
    "friction": ("horizontal over vertical impulse in that bounce, over mu", "1"),
}

# Periods of the contact over which the depth of a cube at rest is averaged, and the ωh at which the exact contact is
# sampled.
_PERIODS, _FINE = 10, 0.002


def measure(
    scene: Scene,
    *,
    methods: Sequence[str] = METHODS,
    stiffness: Sequence[float] = (1e4, 1e6),
    damping: Sequence[float] = (0.0, 0.1, 10.0),
    omega_h: Sequence[float] = (0.1, 0.02),
    phases: int = 4,
) -> xr.Dataset:
    """Return RATIOS, dimensions method, stiffness, damping, omega_h; not-a-number where a cube does not leave.

    scene: gives the cube, gravity, friction, and the speeds of the launch; the ground is level and gated. methods:
    names of schemes and engines. stiffness [kg/s²]. damping [kg/s]. omega_h [1]: contact frequency times step size.
    phases: of the step at touch-down, over which a bounce is averaged.
    Raises InputError for a number out of range, an engine that is not installed, and a scene whose cube would not
    bounce flat and short, or stops sliding in the bounce.
    """
    names = engines.chosen_from(methods)
    grounds = numbers("stiffness", stiffness, "kg/s²", above=0)
    dampings = numbers("damping", damping, "kg/s", at_least=0)
    steps = numbers("omega_h", omega_h, "1", above=0)
    phases = validation.count("phases", phases)

    def ratios(method: str, stiff: float, damping: float, omega_h: float) -> tuple[float, ...]:
        return _ratios(method, flat(scene, stiffness=stiff, damping=damping), omega_h, phases)

    found = mapped(ratios, RATIOS, method=names, stiffness=grounds, damping=dampings, omega_h=steps)
    attributes = dataset.provenance_attributes("Contacts over the exact ones", scene, MODEL, "method", __name__)
    note = "ground: level, gated, stiffness and damping as the dimensions say; an upright cube"
    return xr.Dataset(found, attrs=attributes | engines.attributes(names) | {"scene_note": note})


@cache
def _exact(scene: Scene) -> tuple[float, float]:
    """Return the restitution and the time below the surface [s] that are exact, of a cube that slides all the while."""
    speed, smooth, along = landing_speed(scene), scene.with_ground(friction=0.0), scene.launch.velocity[0]
    # Friction takes at most 2 mu times the speed down.
    if not (scene.launch.velocity[1] == 0 and along > 4 * scene.ground.friction * speed):
        raise InputError("launch.velocity: allowed is one along x, above 4 mu times the speed at the ground [m/s]")
    followed = bounce("exact", smooth, speed, _FINE / contact_frequency(scene), 0.5)
    return flat_bounce.restitution(smooth, speed), followed.contact_time


def _ratios(method: str, scene: Scene, omega_h: float, phases: int) -> tuple[float, ...]:
    """Return RATIOS of one method at one step size."""
    h, speed, mu = omega_h / contact_frequency(scene), landing_speed(scene), scene.ground.friction
    restitution, contact_time = _exact(scene)
    without = scene.with_ground(friction=0.0)
    smooth, rough = (
        np.mean([bounce(method, there, speed, h, k / phases)[1:] for k in range(phases)], axis=0)
        for there in (without, scene)
    )
    steps = math.ceil(_PERIODS * 2 * math.pi / (contact_frequency(scene) * h))
    depth = scene.cube.side / 2 - float(np.mean(heights_at_rest(method, without, h, steps)))
    return (
        depth / linear_theory.sag(scene),
        smooth[0] / restitution,
        smooth[1] / contact_time,
        rough[0] / restitution,
        rough[2] / mu if mu else 1.0,
    )

"""How a method's contact maps onto the gated law: the depth of a cube at rest, and one flat bounce, over the exact.

What is off and becomes less with the step is the step's; what stays is the contact's. A bounce is made twice: without
friction, and with the scene's, for a cube that slides all the while. Friction takes mu times the normal impulse then,
and leaves the bounce as it is.
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
from stiffdice.experiments.engines.limits import METHODS
from stiffdice.experiments.engines.single_bounce import MODEL, bounce, landing_speed, level
from stiffdice.scene import validation
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import stepper

# By name: what is stored of each method, over what is exact.
RATIOS = {
    "rest_depth": "mean depth of a cube at rest over m g/(4S)",
    "restitution": "restitution of a flat bounce without friction over the exact one",
    "contact_time": "time below the surface in that bounce over the exact one",
    "rough_restitution": "restitution of a sliding bounce with friction over the exact one, which is the same",
    "friction": "horizontal over vertical impulse in that bounce, over mu",
}

# Periods of the contact that a cube at rest is looked at, and the ωh at which the exact contact is followed.
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
    names = stepper.chosen_from(methods)
    grounds = [validation.number("stiffness", value, "kg/s²", above=0) for value in stiffness]
    steps = [validation.number("omega_h", value, "1", above=0) for value in omega_h]
    phases = validation.count("phases", phases)
    dampings = [validation.number("damping", value, "kg/s", at_least=0) for value in damping]
    found = np.full((len(RATIOS), len(names), len(grounds), len(dampings), len(steps)), np.nan)
    for s, d in np.ndindex(found.shape[2:4]):
        ground = level(scene, stiffness=grounds[s], damping=dampings[d])
        _check_slides(ground)
        wanted = _exactly(ground)
        for k, j in np.ndindex(len(names), len(steps)):
            found[:, k, s, d, j] = _ratios(names[k], ground, steps[j], phases, wanted)
    return _dataset(scene, names, grounds, dampings, steps, found)


def _check_slides(scene: Scene) -> None:
    """Friction takes at most 2 mu times the speed down."""
    speed, along = landing_speed(scene), scene.launch.velocity[0]
    if not (scene.launch.velocity[1] == 0 and along > 4 * scene.ground.friction * speed):
        raise InputError("launch.velocity: allowed is one along x, above 4 mu times the speed at the ground [m/s]")


def _exactly(scene: Scene) -> tuple[float, float]:
    """Return the restitution and the time below the surface [s] that are exact."""
    speed = landing_speed(scene)
    h = _FINE / linear_theory.contact_frequency(scene.ground.stiffness, scene.cube.mass)
    smooth = scene.with_ground(friction=0.0)
    return flat_bounce.restitution(smooth, speed), bounce("exact", smooth, speed, h, 0.5).contact_time


def _ratios(
    method: str, scene: Scene, omega_h: float, phases: int, wanted: tuple[float, float]
) -> tuple[float, float, float, float, float]:
    h = omega_h / linear_theory.contact_frequency(scene.ground.stiffness, scene.cube.mass)
    speed = landing_speed(scene)
    smooth, rough = (
        [bounce(method, scene.with_ground(friction=friction), speed, h, k / phases) for k in range(phases)]
        for friction in (0.0, scene.ground.friction)
    )
    restitution, contact_time = wanted
    friction = float(np.mean([part.slowed for part in rough])) / scene.ground.friction if scene.ground.friction else 1.0
    return (
        _rest_depth(method, scene.with_ground(friction=0.0), h) / linear_theory.sag(scene),
        float(np.mean([part.restitution for part in smooth])) / restitution,
        float(np.mean([part.contact_time for part in smooth])) / contact_time,
        float(np.mean([part.restitution for part in rough])) / restitution,
        friction,
    )


def _rest_depth(method: str, scene: Scene, h: float) -> float:
    """Return the mean depth [m] of a cube that is put where it would rest; one that would not swings about its own."""
    omega = linear_theory.contact_frequency(scene.ground.stiffness, scene.cube.mass)
    place = scene.cube.side / 2 - linear_theory.sag(scene)
    steps = math.ceil(_PERIODS * 2 * math.pi / (omega * h))
    launch = Launch((0.0, 0.0, place), (0.0, 0.0, 0.0), node_velocity="rigid")
    resting = dataclasses.replace(scene, launch=launch, duration=steps * h)
    states = np.zeros(steps, STATE)
    stepper.start(method, resting, MODEL, start_of(resting, MODEL), h).advance(states, 1)
    return scene.cube.side / 2 - float(np.mean(states["position"][:, 2]))


def _dataset(
    scene: Scene, names: list[str], grounds: list[float], dampings: list[float], steps: list[float], found: Any
) -> xr.Dataset:
    grid = ("method", "stiffness", "damping", "omega_h")
    coordinates: dict[str, Any] = dataset.method_coordinates(grounds, names) | {
        "damping": ("damping", dampings, {"long_name": "ground damping", "units": "kg s-1"}),
        "omega_h": ("omega_h", steps, dataset.CELL_ATTRIBUTES["omega_h"]),
    }
    attributes = dataset.provenance_attributes(
        "Contacts over the exact ones", scene, MODEL, "method", "stiffdice.experiments.engines.contact"
    )
    attributes |= stepper.attributes(names) | {
        "scene_note": "ground: level, gated, stiffness and damping as the dimensions say; an upright cube"
    }
    variables: dict[str, Any] = {
        name: (grid, values, {"long_name": text, "units": "1"})
        for (name, text), values in zip(RATIOS.items(), found, strict=True)
    }
    return xr.Dataset(variables, coordinates, attributes)

"""What leaving a piece of the full model out costs where a scene needs it.

Where friction acts on a flat landing, the paper's ground_cube (`sliding`) is an approximation: friction on the four
lower nodes tips the cube. It is compared with the full model, and with it `frictionless` sliding.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.experiments.measuring import coordinates, mapped, numbers
from stiffdice.scene import validation
from stiffdice.scene.ground import CONTACT_LAWS
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.run import Trajectory, simulate

MODEL, SCHEME = "tumbling", "event"
APPROXIMATIONS = ("sliding", "frictionless")

# Of a run, from the launch to the horizon.
_SAMPLES = 8000
# So many times the tolerance shows what is left of the error at it, and more.
_COARSER = 100

# Of each approximation, against the full model; then of the full model.
_DESCRIBED = {
    "parting_time": ("time at which the paths have parted", "s", "approximation"),
    "landing_error": ("distance of the places just before the second landing", "m", "approximation"),
    "spin": ("angular velocity that the first landing leaves, positive for a cube that rolls forwards", "rad s-1"),
    "spin_theory": ("the same by theory, for little friction and damping", "rad s-1"),
    "tilt": ("angle of the cube from upright just before the second landing", "rad"),
    "second_landing": ("time just before the second landing", "s"),
    "numerical_error": ("distance of that place from the one at a hundred times the tolerance", "m"),
}


def measure(
    scene: Scene,
    *,
    stiffness: Sequence[float] = tuple(np.logspace(2, 8, 13)),
    friction: Sequence[float] = (0.0, 0.003, 0.01, 0.03, 0.075, 0.15, 0.3),
    horizon: float = 4.0,
    tolerance: float = 1e-10,
    parted: float = 0.01,
) -> xr.Dataset:
    """Return what leaving out rotation, and friction with it, costs in accuracy.

    scene: a cube that lands flat and slides along x; gives cube, launch and damping. stiffness [kg/s²], friction [1]:
    of its ground. horizon [s]: until when runs are compared. tolerance [1]: of the scheme `event`, which makes them.
    parted [m]: the distance at which a path counts as another one.
    Dimensions approximation, contact, friction, stiffness; NaN where there is no parting, or no second landing.
    Raises InputError for a number out of range, and for a scene in which the cube does not land flat and slide.
    """
    grounds = numbers("stiffness", stiffness, "kg/s²", above=0)
    frictions = numbers("friction", friction, "1", at_least=0)
    horizon = validation.number("horizon", horizon, "s", above=0)
    tolerance = validation.number("tolerance", tolerance, "1", above=0)
    parted = validation.number("parted", parted, "m", above=0)
    flat = dataclasses.replace(_checked(scene), duration=horizon)

    def compared(law: str, mu: float, stiff: float) -> list[Any]:
        rough = flat.with_ground(contact=law, stiffness=stiff, friction=mu)
        full, coarse = (_run(rough, MODEL, part) for part in (tolerance, _COARSER * tolerance))
        after, before = _landings(rough, full)
        lesser = [_run(there, "sliding", tolerance) for there in (rough, rough.with_ground(friction=0.0))]
        errors = [_errors(run, full, before, parted) for run in lesser]
        return [*zip(*errors, strict=True), *_of_full_model(rough, full, coarse, after, before)]

    found = mapped(compared, _DESCRIBED, contact=CONTACT_LAWS, friction=frictions, stiffness=grounds)
    title = "What left out pieces of the model cost"
    attributes = dataset.provenance_attributes(title, scene, MODEL, SCHEME, __name__) | {
        "scene_note": "contact law, stiffness and friction are the dimensions'",
        "horizon": horizon,
        "tolerance": tolerance,
        "parted": parted,
    }
    variables = xr.Dataset(found | coordinates(approximation=APPROXIMATIONS), attrs=attributes)
    return variables.transpose("approximation", ...)


def _checked(scene: Scene) -> Scene:
    launch = scene.launch
    flat = scene.ground.normal == (0.0, 0.0, 1.0) and launch.orientation == (0.0, 0.0, 0.0)
    if not flat or any(launch.spin) or launch.velocity[0] <= 0 or launch.velocity[1] != 0:
        raise InputError("launch: allowed is an upright cube without spin, over level ground, that moves along x")
    return scene


def _run(scene: Scene, model: str, tolerance: float) -> Trajectory:
    run = simulate(scene, model=model, scheme=SCHEME, steps=_SAMPLES, every=1, tolerance=tolerance)
    if run.trajectory is None or run.steps_done[0] < _SAMPLES:
        raise InputError(f"ground.stiffness = {scene.ground.stiffness:g}: the run left the range of doubles")
    return run.trajectory


def _landings(scene: Scene, full: Trajectory) -> tuple[int, int]:
    """Return the samples in the air after the first landing, and before the second; -1 for none.

    A sample lands from which a node would be in the ground by the next: contact may be shorter than that.
    """
    state = full.state
    wx, wy = (state["angular_momentum"][:, :2].T / scene.cube.moment_of_inertia)[:, :, None]
    nodes = state["node_offset"]
    heights = state["position"][:, None, 2] + nodes[:, :, 2]
    speeds = state["velocity"][:, None, 2] + wx * nodes[:, :, 1] - wy * nodes[:, :, 0]
    lands = (heights + np.minimum(0.0, speeds) * full.time[1]).min(axis=1) <= 0
    _, after, second = [*np.flatnonzero(np.diff(lands, prepend=False)).tolist(), -1, -1, -1][:3]
    return after, second - 1 if second > 0 else -1


def _of_full_model(scene: Scene, full: Trajectory, coarse: Trajectory, after: int, before: int) -> list[float]:
    """Return spin, spin_theory, tilt, second_landing and numerical_error; coarse: the run at a larger tolerance."""
    found = [math.nan] * 5
    if after > 0:
        found[0] = full.state["angular_momentum"][after, 1] / scene.cube.moment_of_inertia
        found[1] = first_spin(scene, -full.state["velocity"][:after, 2].min())
    if before > 0:
        there = full.state[before]
        x, y, z = there["node_offset"][0] - there["node_offset"][4]  # along z at the launch
        apart = math.dist(there["position"], coarse.state[before]["position"])
        found[2:] = math.atan2(math.hypot(x, y), z), full.time[before], apart
    return found


def first_spin(scene: Scene, speed: float) -> float:
    """Return the spin [rad/s] that an undamped flat landing at `speed` [m/s] leaves if little friction acts all along.

    The bounce presses with N = m ω v sin ωt, ω² = 4 S/m, until ωt = π. Friction tips the cube forwards with the torque
    mu N s/2, and the springs right it with S s² per radian: I θ'' = mu N s/2 − S s² θ. With q² = S s²/(I ω²),
    m s²/(4 I), the end has θ' = (mu m v s/(2 I)) (1 + cos πq)/(1 − q²), at any stiffness. It is negative, the cube
    rolls backwards, for `solid` inertia (q² = 3/2): there the springs swing it back within the bounce.
    """
    cube = scene.cube
    ratio = cube.mass * cube.side**2 / (4 * cube.moment_of_inertia)
    tipped = scene.ground.friction * cube.mass * speed * cube.side / (2 * cube.moment_of_inertia)
    return tipped * (1 + math.cos(math.pi * math.sqrt(ratio))) / (1 - ratio)


def _errors(lesser: Trajectory, full: Trajectory, before: int, parted: float) -> tuple[float, float]:
    """Return parting_time and landing_error of a lesser model's run."""
    distance = np.linalg.norm(lesser.state["position"] - full.state["position"], axis=1)
    apart = np.flatnonzero(distance > parted)
    return full.time[apart[0]] if len(apart) else math.nan, distance[before] if before > 0 else math.nan

"""What each piece of the full model costs where a scene does not need it, and what leaving it out costs.

`measure`: where friction acts on a flat landing, the paper's ground_cube (`sliding`) is an approximation: friction on
the four lower nodes tips the cube. It is compared with the full model, and with it `frictionless` sliding. `time`:
seconds, which no two runs share. A cube needs no rotating tensor of inertia, and no model has one: it is written here,
to be timed.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.inertia import rotate
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models import sliding
from stiffdice.dynamics.state import Array, Physics, States, physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import coordinates, mapped, numbers, quantity, result
from stiffdice.experiments.placement import relaunched, upright
from stiffdice.experiments.timing import seconds_of
from stiffdice.scene import validation
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines import registry as engines
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
    launch, upward = scene.launch, scene.ground.normal == (0.0, 0.0, 1.0)
    if not upward or any((*launch.orientation, *launch.spin)) or launch.velocity[0] <= 0 or launch.velocity[1] != 0:
        raise InputError("launch: allowed is an upright cube without spin, over level ground, that moves along x")
    flat = dataclasses.replace(scene, duration=horizon)

    def compared(law: str, mu: float, stiff: float) -> list[Any]:
        rough = flat.with_ground(contact=law, stiffness=stiff, friction=mu)
        full, coarse = (_run(rough, MODEL, part) for part in (tolerance, _COARSER * tolerance))
        before, of_full = _of_full_model(rough, full, coarse)
        lesser = [_run(there, "sliding", tolerance) for there in (rough, rough.with_ground(friction=0.0))]
        apart = np.array([np.linalg.norm(run.state["position"] - full.state["position"], axis=1) for run in lesser])
        parting = np.where((apart > parted).any(axis=1), full.time[np.argmax(apart > parted, axis=1)], math.nan)
        landing = apart[:, before] if before > 0 else [math.nan] * len(lesser)
        return [parting, landing, *of_full]

    found = mapped(compared, _DESCRIBED, contact=CONTACT_LAWS, friction=frictions, stiffness=grounds)
    found |= coordinates(approximation=APPROXIMATIONS)
    told = {"horizon": horizon, "tolerance": tolerance, "parted": parted}
    note = "contact law, stiffness and friction are the dimensions'"
    title = "What left out pieces of the model cost"
    return result(found, title, scene, MODEL, SCHEME, __name__, scene_note=note, **told).transpose("approximation", ...)


def _run(scene: Scene, model: str, tolerance: float) -> Trajectory:
    run = simulate(scene, model=model, scheme=SCHEME, steps=_SAMPLES, every=1, tolerance=tolerance)
    if run.trajectory is None or run.steps_done[0] < _SAMPLES:
        raise InputError(f"ground.stiffness = {scene.ground.stiffness:g}: the run left the range of doubles")
    return run.trajectory


def _of_full_model(scene: Scene, full: Trajectory, coarse: Trajectory) -> tuple[int, list[float]]:
    """Return the sample before the second landing, -1 for none; and what _DESCRIBED has of the full model.

    coarse: the run at a larger tolerance. A sample lands from which a node would be in the ground by the next: contact
    may be shorter than that.
    """
    state = full.state
    wx, wy = (state["angular_momentum"][:, :2].T / scene.cube.moment_of_inertia)[:, :, None]
    nodes = state["node_offset"]
    heights = state["position"][:, None, 2] + nodes[:, :, 2]
    speeds = state["velocity"][:, None, 2] + wx * nodes[:, :, 1] - wy * nodes[:, :, 0]
    lands = (heights + np.minimum(0.0, speeds) * full.time[1]).min(axis=1) <= 0
    _, after, second = [*np.flatnonzero(np.diff(lands, prepend=False)).tolist(), -1, -1, -1][:3]
    before, found = second - 1 if second > 0 else -1, [math.nan] * 5
    if after > 0:
        found[0] = state["angular_momentum"][after, 1] / scene.cube.moment_of_inertia
        found[1] = first_spin(scene, -state["velocity"][:after, 2].min())
    if before > 0:
        there = state[before]
        x, y, z = there["node_offset"][0] - there["node_offset"][4]  # along z at the launch
        apart = math.dist(there["position"], coarse.state[before]["position"])
        found[2:] = math.atan2(math.hypot(x, y), z), full.time[before], apart
    return before, found


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


TIMED_SCHEME = "symplectic_euler"
ROLES = ("full", "least")

_KINDS = {
    "step": "a step of the bare model, nothing watched",
    "run": "a run, every step taken and watched",
    "leap": "a run, its known motion taken at once",
}


def pieces_of(scene: Scene) -> dict[str, tuple[Scene, str, str]]:
    """Return by name a scene that needs all but one piece of the full model, and the models with and without it.

    rotation: a flat landing without friction. friction: a flat cube dropped straight. contact: a flight that ends in
    the air, under a law without damping (of which `ungated` would drag on it). tensor: a throw with spin, by `tumbling`
    with a tensor that turns. all: the full model for a flat cube dropped straight.
    """
    down = scene.launch.velocity[2]
    flat = upright(scene.with_ground(normal=(0.0, 0.0, 1.0)))
    dropped = relaunched(flat, velocity=(0.0, 0.0, down))
    fall = abs(down) * scene.duration + scene.gravity * scene.duration**2
    high = relaunched(flat.with_ground(damping=0.0), position=(0.0, 0.0, fall + 2 * scene.cube.side))
    spin = scene.cube.moment_of_inertia
    spun = relaunched(flat, angular_momentum=(1.7 * spin, 2.8 * spin, 1.1 * spin))
    return {
        "rotation": (flat.with_ground(friction=0.0), "tumbling", "sliding"),
        "friction": (dropped, "sliding", "vertical"),
        "contact": (high, "tumbling", "flying"),
        "tensor": (spun, "tensor", "tumbling"),
        "all": (dropped, "tumbling", "vertical"),
    }


def time(scene: Scene, *, steps: int = 20_000, rounds: int = 25) -> xr.Dataset:
    """Return how long full and least model take, and their ratios; seconds of this machine, another at every call.

    scene: changed as `pieces_of` says. steps: of each run. rounds: of all runs in turn, of which the medians are taken,
    so that a busy moment falls on all alike; ratios are medians of the rounds' own. Variables as _KINDS says,
    dimensions piece and role; the tensor is timed in bare steps only. Raises InputError for a number out of range.
    """
    steps, rounds = validation.count("steps", steps), validation.count("rounds", rounds)
    pieces = pieces_of(scene)
    starts = [[_starts(there, model, steps) for model in both] for there, *both in pieces.values()]
    seconds = np.full((rounds + 1, len(_KINDS), len(starts), len(ROLES)), np.nan)
    for round_ in seconds:  # the first compiles
        for p, r in np.ndindex(len(starts), len(ROLES)):
            for k, start in enumerate(starts[p][r]):
                round_[k, p, r] = seconds_of(start())
    seconds[:, 0] /= steps
    variables = coordinates(piece=pieces, role=ROLES)
    for k, (name, text) in enumerate(_KINDS.items()):
        taken = seconds[1:, k]
        ratio = np.median(taken[:, :, 0] / taken[:, :, 1], axis=0)
        variables[f"{name}_time"] = quantity(("piece", "role"), np.median(taken, axis=0), text, "s")
        variables[f"{name}_ratio"] = quantity("piece", ratio, f"full over least model: {text}")
    told = {"scene_note": "pieces have scenes of their own", "steps": steps, "rounds": rounds}
    title = "What unneeded pieces of the model cost"
    return result(variables, title, scene, MODEL, TIMED_SCHEME, __name__, **told)


def _starts(scene: Scene, model: str, steps: int) -> list[Callable[[], Callable[[], object]]]:
    """Return what makes ready what is timed of a model, in the order of _KINDS; of `tensor` bare steps only."""
    if model == "tensor":
        take = partial(take_with_tensor, models.MODELS[MODEL], physics_of(scene))
        tensor, h = scene.cube.moment_of_inertia * np.eye(3), scene.duration / steps
        return [lambda: partial(take, start_of(scene, MODEL), tensor.copy(), h, steps)]
    plain = partial(simulate, scene, model=model, scheme=TIMED_SCHEME, steps=steps)
    return [engines.ready(TIMED_SCHEME, scene, model, steps, 1), lambda: partial(plain, every=steps), lambda: plain]


@njit(cache=True)
def take_with_tensor(model: Any, physics: Physics, states: States, tensor: Array, h: float, steps: int) -> None:
    """Take so many steps of symplectic Euler of a body whose tensor of inertia turns with it: I ← R I Rᵀ."""
    state = states[0]
    for _ in range(steps):
        wrench = models.force(model, physics, state)
        models.kick(model, physics, state, wrench, h)
        sliding.drift(physics, state, h)
        _solve_spin(state, tensor)
        wx, wy, wz = state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2]
        rate = math.sqrt(wx * wx + wy * wy + wz * wz)
        if rate > 0.0:
            ax, ay, az, angle = wx / rate, wy / rate, wz / rate, rate * h
            rotate(state.node_offset, ax, ay, az, angle)
            rotate(tensor, ax, ay, az, angle)
            rotate(tensor.T, ax, ay, az, angle)


@njit
def _solve_spin(state: Any, t: Array) -> None:
    """Solve I ω = L by Cramer's rule."""
    x, y, z = state.angular_momentum[0], state.angular_momentum[1], state.angular_momentum[2]
    xx, yy, zz = t[0, 0], t[1, 1], t[2, 2]
    xy, xz, yz = t[0, 1], t[0, 2], t[1, 2]
    cxx, cyy, czz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    cxy, cxz, cyz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    determinant = xx * cxx + xy * cxy + xz * cxz
    state.angular_velocity[0] = (cxx * x + cxy * y + cxz * z) / determinant
    state.angular_velocity[1] = (cxy * x + cyy * y + cyz * z) / determinant
    state.angular_velocity[2] = (cxz * x + cyz * y + czz * z) / determinant

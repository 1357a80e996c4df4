"""How long each piece of the full model takes where a scene does not need it: seconds, which no two runs share.

A cube needs no rotating tensor of inertia, and no model has one: it is written here, to be timed.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models import sliding, tumbling
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import Array, Physics, States, physics_of, start_of
from stiffdice.experiments.measuring import coordinates, quantity
from stiffdice.experiments.placement import relaunched, upright
from stiffdice.experiments.timing import Launched, seconds_of
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.run import simulate

MODEL, SCHEME = "tumbling", "symplectic_euler"

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
    runs = [[_runs(there, model, steps) for model in both] for there, *both in pieces.values()]
    seconds = np.full((rounds + 1, len(_KINDS), len(runs), len(ROLES)), np.nan)
    for round_ in seconds:  # the first compiles
        for p, r in np.ndindex(len(runs), len(ROLES)):
            for k, run in enumerate(runs[p][r]):
                round_[k, p, r] = seconds_of(run)
    seconds[:, 0] /= steps
    variables = coordinates(piece=pieces, role=ROLES)
    for k, (name, text) in enumerate(_KINDS.items()):
        taken = seconds[1:, k]
        ratio = np.median(taken[:, :, 0] / taken[:, :, 1], axis=0)
        variables[f"{name}_time"] = quantity(("piece", "role"), np.median(taken, axis=0), text, "s")
        variables[f"{name}_ratio"] = quantity("piece", ratio, f"full over least model: {text}")
    title = "What unneeded pieces of the model cost"
    attributes = dataset.provenance_attributes(title, scene, MODEL, SCHEME, __name__)
    note = "pieces have scenes of their own"
    return xr.Dataset(variables, attrs=attributes | {"scene_note": note, "steps": steps, "rounds": rounds})


def _runs(scene: Scene, model: str, steps: int) -> list[Callable[[], object]]:
    """Return what is timed of a model, in the order of _KINDS; of `tensor` bare steps only."""
    if model == "tensor":
        return [Launched(partial(_with_tensor, scene, steps))]
    plain = partial(simulate, scene, model=model, scheme=SCHEME, steps=steps)
    return [Launched(engines.ready(SCHEME, scene, model, steps, 1)), partial(plain, every=steps), plain]


def _with_tensor(scene: Scene, steps: int) -> Callable[[], object]:
    tags, h = (MODELS[MODEL], LAWS[scene.ground.contact]), scene.duration / steps
    return partial(take_with_tensor, *tags, physics_of(scene), start_of(scene, MODEL), tensor_of(scene), h, steps)


def tensor_of(scene: Scene) -> Array:
    """Return the cube's tensor of inertia [kg m²], shape (3, 3); isotropic, as it stays."""
    return np.asarray(scene.cube.moment_of_inertia * np.eye(3))


class _Rows(NamedTuple):
    """Vectors that `tumbling.rotate` turns, shape (3, 3)."""

    node_offset: Array


@njit(cache=True)
def take_with_tensor(
    model: Any, law: Any, physics: Physics, states: States, tensor: Array, h: float, steps: int
) -> None:
    """Take so many steps of symplectic Euler of a body whose tensor of inertia turns with it: I ← R I Rᵀ."""
    state = states[0]
    for _ in range(steps):
        wrench = models.force(model, law, physics, state)
        models.kick(model, physics, state, wrench, h)
        sliding.drift(physics, state, h)
        _solve_spin(state, tensor)
        wx, wy, wz = state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2]
        rate = math.sqrt(wx * wx + wy * wy + wz * wz)
        if rate > 0.0:
            ax, ay, az, angle = wx / rate, wy / rate, wz / rate, rate * h
            tumbling.rotate(state, ax, ay, az, angle)
            tumbling.rotate(_Rows(tensor), ax, ay, az, angle)
            tumbling.rotate(_Rows(tensor.T), ax, ay, az, angle)


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

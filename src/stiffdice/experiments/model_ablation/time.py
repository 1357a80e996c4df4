"""How long each piece of the full model takes where a scene does not need it: seconds, which no two runs share."""

from __future__ import annotations

import math
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models import sliding
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import Physics, States, physics_of, start_of
from stiffdice.experiments.layout import quantity
from stiffdice.experiments.model_ablation.pieces import ROLES, SCHEME, attributes, coordinates, pieces_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.run import simulate


def time(scene: Scene, *, steps: int = 20_000, rounds: int = 25) -> xr.Dataset:
    """Return how long full and least model take, and their ratios; seconds of this machine, another at every call.

    scene: changed as `pieces_of` says. steps: of each run. rounds: of all runs in turn, of which the medians are taken,
    so that a busy moment falls on all alike; ratios are medians of the rounds' own.
    `step_time` [s] is a step of the bare model, nothing watched; `run_time` [s] a run of `simulate`, every step taken;
    `leap_time` [s] one whose known motion is taken at once. The tensor is timed in bare steps only.
    Dimensions piece and role. Raises InputError for a number out of range.
    """
    steps, rounds = validation.count("steps", steps), validation.count("rounds", rounds)
    pieces = pieces_of(scene)
    kinds = {
        "step": (_step_seconds, "a step of the bare model, nothing watched"),
        "run": (_run_seconds, "a run, every step taken and watched"),
        "leap": (_leap_seconds, "a run, its known motion taken at once"),
    }
    grid = ("piece", "role")
    seconds = {name: np.full((rounds + 1, len(pieces), len(ROLES)), np.nan) for name in kinds}
    for k in range(rounds + 1):  # the first compiles
        for p, piece in enumerate(pieces.values()):
            for r, model in enumerate((piece.full, piece.least)):
                for name, (timed, _) in kinds.items():
                    if name == "step" or piece.full != "tensor":
                        seconds[name][k, p, r] = timed(piece.scene, model, steps)
    variables = {}
    for name, (_, text) in kinds.items():
        taken = seconds[name][1:]
        ratio = np.median(taken[:, :, 0] / taken[:, :, 1], axis=0)
        variables[f"{name}_time"] = quantity(grid, np.median(taken, axis=0), text, "s")
        variables[f"{name}_ratio"] = quantity("piece", ratio, f"full over least model: {text}")
    found = attributes("What unneeded pieces of the model cost", scene, __name__) | {"steps": steps, "rounds": rounds}
    return xr.Dataset(variables, coordinates(pieces), found)


def _step_seconds(scene: Scene, model: str, steps: int) -> float:
    """Return the seconds of one step of a model."""
    turning = model == "tensor"
    model = "tumbling" if turning else model
    tags = MODELS[model], LAWS[scene.ground.contact]
    physics, state, h = physics_of(scene), start_of(scene, model), scene.duration / steps
    begun = perf_counter()
    if turning:
        take_with_tensor(*tags, physics, state, tensor_of(scene), h, steps)
    else:
        take(schemes.SCHEMES[SCHEME], *tags, physics, state, h, steps)
    return (perf_counter() - begun) / steps


def _run_seconds(scene: Scene, model: str, steps: int) -> float:
    begun = perf_counter()
    simulate(scene, model=model, scheme=SCHEME, steps=steps, every=steps)
    return perf_counter() - begun


def _leap_seconds(scene: Scene, model: str, steps: int) -> float:
    begun = perf_counter()
    simulate(scene, model=model, scheme=SCHEME, steps=steps)
    return perf_counter() - begun


@njit(cache=True)
def take(scheme: Any, model: Any, law: Any, physics: Physics, states: States, h: float, steps: int) -> None:
    """Take so many steps of h [s]."""
    for _ in range(steps):
        schemes.step(scheme, model, law, physics, states[0], h, schemes.TOLERANCE)


# The moment of inertia [kg m²] and the last rotation [1] of a body.
_TENSOR = np.dtype([("inertia", np.float64, (3, 3)), ("rotation", np.float64, (3, 3))])


def tensor_of(scene: Scene) -> npt.NDArray[np.void]:
    """Return the cube's tensor, shape (1,); isotropic, as it stays."""
    tensor = np.zeros(1, _TENSOR)
    tensor["inertia"] = scene.cube.moment_of_inertia * np.eye(3)
    return tensor


@njit(cache=True)
def take_with_tensor(
    model: Any,
    law: Any,
    physics: Physics,
    states: States,
    tensors: npt.NDArray[np.void],
    h: float,
    steps: int,
) -> None:
    """Take so many steps of symplectic Euler of a body whose tensor of inertia turns with it."""
    state, tensor = states[0], tensors[0]
    for _ in range(steps):
        wrench = models.force(model, law, physics, state)
        models.kick(model, physics, state, wrench, h)
        sliding.drift(physics, state, h)
        _solve_spin(state, tensor)
        _turn_all(state, tensor, h)


@njit
def _solve_spin(state: Any, tensor: Any) -> None:
    """Solve I ω = L by Cramer's rule."""
    t, spin = tensor.inertia, state.angular_momentum
    xx, yy, zz = t[0, 0], t[1, 1], t[2, 2]
    xy, xz, yz = t[0, 1], t[0, 2], t[1, 2]
    cxx, cyy, czz = yy * zz - yz * yz, xx * zz - xz * xz, xx * yy - xy * xy
    cxy, cxz, cyz = xz * yz - xy * zz, xy * yz - xz * yy, xy * xz - xx * yz
    determinant = xx * cxx + xy * cxy + xz * cxz
    x, y, z = spin[0], spin[1], spin[2]
    state.angular_velocity[0] = (cxx * x + cxy * y + cxz * z) / determinant
    state.angular_velocity[1] = (cxy * x + cyy * y + cyz * z) / determinant
    state.angular_velocity[2] = (cxz * x + cyz * y + czz * z) / determinant


@njit
def _turn_all(state: Any, tensor: Any, h: float) -> None:
    """Turn nodes and tensor by ω h: X ← R X and I ← R I Rᵀ, with R of equation 9."""
    wx, wy, wz = state.angular_velocity[0], state.angular_velocity[1], state.angular_velocity[2]
    rate = math.sqrt(wx * wx + wy * wy + wz * wz)
    if rate == 0.0:
        return
    ax, ay, az = wx / rate, wy / rate, wz / rate
    c, s = math.cos(rate * h), math.sin(rate * h)
    d = 1 - c
    r = tensor.rotation
    r[0, 0], r[0, 1], r[0, 2] = c + d * ax * ax, d * ax * ay - s * az, d * ax * az + s * ay
    r[1, 0], r[1, 1], r[1, 2] = d * ay * ax + s * az, c + d * ay * ay, d * ay * az - s * ax
    r[2, 0], r[2, 1], r[2, 2] = d * az * ax - s * ay, d * az * ay + s * ax, c + d * az * az
    _turn_rows(r, state.node_offset)
    _turn_rows(r, tensor.inertia)
    _turn_rows(r, tensor.inertia.T)


@njit
def _turn_rows(r: Any, rows: Any) -> None:
    """Turn each row of three."""
    for k in range(rows.shape[0]):
        x, y, z = rows[k, 0], rows[k, 1], rows[k, 2]
        rows[k, 0] = r[0, 0] * x + r[0, 1] * y + r[0, 2] * z
        rows[k, 1] = r[1, 0] * x + r[1, 1] * y + r[1, 2] * z
        rows[k, 2] = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z

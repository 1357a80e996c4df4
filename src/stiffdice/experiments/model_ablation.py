"""What each piece of the full model costs where a scene does not need it, and what leaving it out costs where it does.

The pieces are rotation, friction, contact, and a rotating inertia tensor. A cube needs no such tensor, and no model has
one: it is written here, to be timed. `time` measures seconds, which no two runs share; `measure` what every run shares.

Where friction acts on a flat landing, the paper's ground_cube (`sliding`) is an approximation: friction on the four
lower nodes tips the cube. `measure` compares it with the full model, and with it `frictionless` sliding.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models import sliding
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import Array, Physics, States, physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.run import Trajectory, simulate

MODEL, SCHEME = "tumbling", "symplectic_euler"

APPROXIMATIONS = ("sliding", "frictionless")
ROLES = ("full", "least")

# Of a run, from the launch to the horizon.
_SAMPLES = 8000
# So many times the tolerance shows what is left of the error at it, and more.
_COARSER = 100

# By name: meaning and units. Of each approximation, against the full model; of the full model.
_ERRORS = {
    "parting_time": ("time at which the paths have parted", "s"),
    "landing_error": ("distance of the places just before the second landing", "m"),
    "horizon_error": ("distance of the places at the horizon", "m"),
    "energy_error": ("energy just before the second landing less that of the full model", "J"),
}
_OF_FULL = {
    "spin": ("angular velocity that the first landing leaves, positive for a cube that rolls forwards", "rad s-1"),
    "spin_theory": ("the same by theory, for little friction and damping", "rad s-1"),
    "tilt": ("angle of the cube from upright just before the second landing", "rad"),
    "second_landing": ("time just before the second landing", "s"),
    "numerical_error": (
        "distance of the place just before the second landing from that at a hundred times the tolerance",
        "m",
    ),
}


class Piece(NamedTuple):
    """A piece of the full model: a scene that does not need it, and the two models that differ by it.

    full: tensor is `tumbling` with a rotating tensor.
    """

    scene: Scene
    full: str
    least: str


def pieces_of(scene: Scene) -> dict[str, Piece]:
    """Return each piece with the given scene changed so that it needs all but that piece, by name.

    rotation: a flat landing without friction. friction: a flat cube dropped straight. contact: a flight that ends in
    the air, under a law without damping (of which `ungated` would drag on it). tensor: a throw with spin. all: the full
    model for a flat cube dropped straight.
    """
    launch = dataclasses.replace(scene.launch, angular_momentum=(0.0, 0.0, 0.0), orientation=(0.0, 0.0, 0.0))
    flat = dataclasses.replace(scene.with_ground(normal=(0.0, 0.0, 1.0)), launch=launch)
    dropped = _launched(flat, velocity=(0.0, 0.0, launch.velocity[2]))
    fall = abs(launch.velocity[2]) * scene.duration + scene.gravity * scene.duration**2
    high = _launched(flat.with_ground(damping=0.0), position=(0.0, 0.0, fall + 2 * scene.cube.side))
    spin = scene.cube.moment_of_inertia
    spun = _launched(flat, angular_momentum=(1.7 * spin, 2.8 * spin, 1.1 * spin))
    return {
        "rotation": Piece(flat.with_ground(friction=0.0), "tumbling", "sliding"),
        "friction": Piece(dropped, "sliding", "vertical"),
        "contact": Piece(high, "tumbling", "flying"),
        "tensor": Piece(spun, "tensor", "tumbling"),
        "all": Piece(dropped, "tumbling", "vertical"),
    }


def _launched(scene: Scene, **values: Any) -> Scene:
    return dataclasses.replace(scene, launch=dataclasses.replace(scene.launch, **values))


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
    kinds: dict[str, tuple[Callable[[Scene, str, int], float], str]] = {
        "step_time": (_bare, "a step of the bare model, nothing watched"),
        "run_time": (_watched, "a run, every step taken and watched"),
        "leap_time": (_leaping, "a run, its known motion taken at once"),
    }
    seconds = {name: np.full((rounds + 1, len(pieces), len(ROLES)), np.nan) for name in kinds}
    for k in range(rounds + 1):  # the first compiles
        for p, piece in enumerate(pieces.values()):
            for r, model in enumerate((piece.full, piece.least)):
                for name, (timed, _) in kinds.items():
                    if timed is _bare or piece.full != "tensor":
                        seconds[name][k, p, r] = timed(piece.scene, model, steps)
    grid = ("piece", "role")
    variables: dict[str, Any] = {}
    for name, (_, text) in kinds.items():
        ratios = seconds[name][1:, :, 0] / seconds[name][1:, :, 1]
        variables[name] = (grid, np.median(seconds[name][1:], axis=0), {"long_name": text, "units": "s"})
        variables[name.replace("time", "ratio")] = (
            grid[:1],
            np.median(ratios, axis=0),
            {"long_name": f"full over least model: {text}", "units": "1"},
        )
    attributes = _attributes(scene, "What unneeded pieces of the model cost") | {"steps": steps, "rounds": rounds}
    return xr.Dataset(variables, _piece_coordinates(pieces), attributes)


def _bare(scene: Scene, model: str, steps: int) -> float:
    """Return the seconds of one step of a model."""
    tags = schemes.SCHEMES[SCHEME], MODELS["tumbling" if model == "tensor" else model], LAWS[scene.ground.contact]
    state, h = start_of(scene, "tumbling" if model == "tensor" else model), scene.duration / steps
    begun = perf_counter()
    if model == "tensor":
        _take_with_tensor(*tags[1:], physics_of(scene), state, _tensor_of(scene), h, steps)
    else:
        _take(*tags, physics_of(scene), state, h, steps)
    return (perf_counter() - begun) / steps


def _watched(scene: Scene, model: str, steps: int) -> float:
    begun = perf_counter()
    simulate(scene, model=model, scheme=SCHEME, steps=steps, every=steps)
    return perf_counter() - begun


def _leaping(scene: Scene, model: str, steps: int) -> float:
    begun = perf_counter()
    simulate(scene, model=model, scheme=SCHEME, steps=steps)
    return perf_counter() - begun


@njit(cache=True)
def _take(scheme: Any, model: Any, law: Any, physics: Physics, states: States, h: float, steps: int) -> None:
    """Take so many steps of h [s]."""
    for _ in range(steps):
        schemes.step(scheme, model, law, physics, states[0], h, schemes.TOLERANCE)


# The moment of inertia [kg m²] and the last rotation [1] of a body.
_TENSOR = np.dtype([("inertia", np.float64, (3, 3)), ("rotation", np.float64, (3, 3))])


def _tensor_of(scene: Scene) -> npt.NDArray[np.void]:
    """Return the cube's tensor, shape (1,); isotropic, as it stays."""
    tensor = np.zeros(1, _TENSOR)
    tensor["inertia"] = scene.cube.moment_of_inertia * np.eye(3)
    return tensor


@njit(cache=True)
def _take_with_tensor(
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
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        _turn_row(r, nodes, k)
    # Rows, then columns, by R.
    for k in range(3):
        _turn_row(r, tensor.inertia, k)
    for k in range(3):
        _turn_row(r, tensor.inertia.T, k)


@njit
def _turn_row(r: Any, rows: Any, k: int) -> None:
    """Turn one row of three."""
    x, y, z = rows[k, 0], rows[k, 1], rows[k, 2]
    rows[k, 0] = r[0, 0] * x + r[0, 1] * y + r[0, 2] * z
    rows[k, 1] = r[1, 0] * x + r[1, 1] * y + r[1, 2] * z
    rows[k, 2] = r[2, 0] * x + r[2, 1] * y + r[2, 2] * z


class _Landings(NamedTuple):
    """Samples of the full model's run: in the air after the first landing, and before the second; -1 for none."""

    after_first: int
    before_second: int


def measure(
    scene: Scene,
    *,
    stiffness: Sequence[float] = tuple(np.logspace(2, 8, 13)),
    friction: Sequence[float] = (0.0, 0.003, 0.01, 0.03, 0.075, 0.15, 0.3),
    horizon: float = 4.0,
    tolerance: float = 1e-10,
    parted: float = 0.01,
) -> xr.Dataset:
    """Return what leaving out rotation, and friction with it, costs in accuracy, and the work that pieces are.

    scene: a cube that lands flat and slides along x; gives cube, launch and damping. stiffness [kg/s²], friction [1]:
    of its ground. horizon [s]: until when runs are compared. tolerance [1]: of the scheme `event`, which makes them.
    parted [m]: the distance at which a path counts as another one.
    Dimensions approximation, contact, friction, stiffness; of the work piece and role. Not-a-number where there is no
    parting, or no second landing, before the horizon.

    Raises InputError for a number out of range, and for a scene in which the cube does not land flat and slide.
    """
    stiffnesses = [validation.number("stiffness", value, "kg/s²", above=0) for value in stiffness]
    frictions = [validation.number("friction", value, "1", at_least=0) for value in friction]
    horizon = validation.number("horizon", horizon, "s", above=0)
    tolerance = validation.number("tolerance", tolerance, "1", above=0)
    parted = validation.number("parted", parted, "m", above=0)
    upright = dataclasses.replace(_checked(scene), duration=horizon)
    shape = (len(LAWS), len(frictions), len(stiffnesses))
    errors = {name: np.full((len(APPROXIMATIONS), *shape), np.nan) for name in _ERRORS}
    of_full = {name: np.full(shape, np.nan) for name in _OF_FULL}
    for c, law in enumerate(LAWS):
        for s, stiff in enumerate(stiffnesses):
            ground = upright.with_ground(contact=law, stiffness=stiff)
            frictionless = _run(ground.with_ground(friction=0.0), "sliding", tolerance)
            for f, mu in enumerate(frictions):
                rough = ground.with_ground(friction=mu)
                full = _run(rough, MODEL, tolerance)
                landings = _landings(rough, full)
                for name, value in _told(rough, full, _run(rough, MODEL, _COARSER * tolerance), landings).items():
                    of_full[name][c, f, s] = value
                for a, lesser in enumerate((_run(rough, "sliding", tolerance), frictionless)):
                    for name, value in _compared(lesser, full, landings, parted).items():
                        errors[name][a, c, f, s] = value
    return _dataset(scene, stiffnesses, frictions, errors, of_full).assign_attrs(
        horizon=horizon, horizon_units="s", tolerance=tolerance, parted=parted, parted_units="m"
    )


def _checked(scene: Scene) -> Scene:
    launch = scene.launch
    flat = scene.ground.normal == (0.0, 0.0, 1.0) and launch.orientation == (0.0, 0.0, 0.0)
    if not flat or any(launch.spin) or launch.velocity[0] <= 0 or launch.velocity[1] != 0:
        raise InputError("launch: allowed is an upright cube without spin, over level ground, that moves along x")
    return scene


def _run(scene: Scene, model: str, tolerance: float) -> Trajectory:
    run = simulate(scene, model=model, scheme="event", steps=_SAMPLES, every=1, tolerance=tolerance)
    if run.trajectory is None or run.steps_done[0] < _SAMPLES:
        raise InputError(f"ground.stiffness = {scene.ground.stiffness:g}: the run left the range of doubles")
    return run.trajectory


def _landings(scene: Scene, full: Trajectory) -> _Landings:
    """Find the samples from which a node would be in the ground by the next: contact may be shorter than that."""
    state = full.state
    wx, wy = (state["angular_momentum"][:, :2].T / scene.cube.moment_of_inertia)[:, :, None]
    nodes = state["node_offset"]
    heights = state["position"][:, None, 2] + nodes[:, :, 2]
    speeds = state["velocity"][:, None, 2] + wx * nodes[:, :, 1] - wy * nodes[:, :, 0]
    lands = (heights + np.minimum(0.0, speeds) * full.time[1]).min(axis=1) <= 0
    first = _next(lands, 0)
    after = _next(~lands, first)
    second = _next(lands, after)
    return _Landings(after, second - 1 if second > 0 else -1)


def _next(flags: npt.NDArray[np.bool_], start: int) -> int:
    """Return where the first flag is set from `start` on; -1 if none is, or `start` is negative."""
    if start < 0 or not flags[start:].any():
        return -1
    return start + int(flags[start:].argmax())


def _told(scene: Scene, full: Trajectory, coarse: Trajectory, landings: _Landings) -> dict[str, float]:
    """Return _OF_FULL of a run; coarse: the same at a larger tolerance."""
    after, before = landings
    told = dict.fromkeys(_OF_FULL, math.nan)
    if after > 0:
        told["spin"] = full.state["angular_momentum"][after, 1] / scene.cube.moment_of_inertia
        told["spin_theory"] = first_spin(scene, -full.state["velocity"][:after, 2].min())
    if before > 0:
        there = full.state[before]
        edge = there["node_offset"][0] - there["node_offset"][4]  # along z at the launch
        told["tilt"] = math.atan2(math.hypot(edge[0], edge[1]), edge[2])
        told["second_landing"] = full.time[before]
        told["numerical_error"] = math.dist(there["position"], coarse.state[before]["position"])
    return told


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


def _compared(lesser: Trajectory, full: Trajectory, landings: _Landings, parted: float) -> dict[str, float]:
    """Return _ERRORS of a lesser model's run."""
    distance = np.linalg.norm(lesser.state["position"] - full.state["position"], axis=1)
    apart = np.flatnonzero(distance > parted)
    found: dict[str, float] = dict.fromkeys(_ERRORS, math.nan) | {"horizon_error": float(distance[-1])}
    if len(apart):
        found["parting_time"] = float(full.time[apart[0]])
    before = landings.before_second
    if before > 0:
        found["landing_error"] = float(distance[before])
        energies = [run.energy_paper[before] + run.elastic_energy[before] for run in (lesser, full)]
        found["energy_error"] = float(energies[0] - energies[1])
    return found


# Numbers that a step of each model advances: place and velocity, angular momentum, spin and eight nodes, a tensor.
_NUMBERS = {"vertical": 2, "sliding": 6, "flying": 33, "tumbling": 36, "tensor": 45}


def _work(scene: Scene) -> tuple[dict[str, Piece], dict[str, Any]]:
    """Return the pieces, and what they cost in counts: the same in every rebuild, unlike seconds."""
    pieces = pieces_of(scene)
    grid = ("piece", "role")
    numbers = [[_NUMBERS[piece.full], _NUMBERS[piece.least]] for piece in pieces.values()]
    steps = 10_000
    taken = [
        [_evaluations(piece.scene, model, steps) for model in (piece.full, piece.least)] for piece in pieces.values()
    ]
    return pieces, {
        "numbers": (grid, numbers, {"long_name": "numbers that a step advances", "units": "1"}),
        "evaluations": (
            grid,
            taken,
            {"long_name": f"force evaluations of a run of {steps} steps, known motion taken at once", "units": "1"},
        ),
    }


def _evaluations(scene: Scene, model: str, steps: int) -> int:
    run = simulate(scene, model="tumbling" if model == "tensor" else model, scheme=SCHEME, steps=steps)
    return int(run.evaluations[0])


def _dataset(
    scene: Scene,
    stiffnesses: Sequence[float],
    frictions: Sequence[float],
    errors: dict[str, Array],
    of_full: dict[str, Array],
) -> xr.Dataset:
    grid = ("approximation", "contact", "friction", "stiffness")
    pieces, work = _work(scene)
    variables: dict[str, Any] = {
        name: (grid, errors[name], {"long_name": text, "units": unit}) for name, (text, unit) in _ERRORS.items()
    }
    variables |= {
        name: (grid[1:], of_full[name], {"long_name": text, "units": unit}) for name, (text, unit) in _OF_FULL.items()
    }
    coordinates = _piece_coordinates(pieces) | {
        "approximation": (
            "approximation",
            np.arange(len(APPROXIMATIONS), dtype=np.int8),
            enum_attributes("model without rotation: with friction, and without", APPROXIMATIONS),
        ),
        "contact": ("contact", np.arange(len(LAWS), dtype=np.int8), dataset.CONTACT_ATTRIBUTES),
        "friction": ("friction", frictions, {"long_name": "friction coefficient", "units": "1"}),
        "stiffness": ("stiffness", stiffnesses, dataset.CELL_ATTRIBUTES["stiffness"]),
    }
    return xr.Dataset(variables | work, coordinates, _attributes(scene, "What left out pieces of the model cost"))


def _piece_coordinates(pieces: dict[str, Piece]) -> dict[str, Any]:
    return {
        "piece": (
            "piece",
            np.arange(len(pieces), dtype=np.int8),
            enum_attributes("piece of the full model that the scene does not need", list(pieces)),
        ),
        "role": (
            "role",
            np.arange(len(ROLES), dtype=np.int8),
            enum_attributes("model with the piece, or without", ROLES),
        ),
    }


def _attributes(scene: Scene, title: str) -> dict[str, Any]:
    attributes = dataset.provenance_attributes(title, scene, MODEL, SCHEME, "stiffdice.experiments.model_ablation")
    attributes["scene_note"] = (
        "contact law, stiffness and friction are the dimensions'; pieces have scenes of their own"
    )
    return attributes

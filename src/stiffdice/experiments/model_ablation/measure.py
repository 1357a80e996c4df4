"""What leaving a piece of the full model out costs where a scene needs it, and how much work each piece is.

Where friction acts on a flat landing, the paper's ground_cube (`sliding`) is an approximation: friction on the four
lower nodes tips the cube. It is compared with the full model, and with it `frictionless` sliding.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.contact import LAWS
from stiffdice.errors import InputError
from stiffdice.experiments import options
from stiffdice.experiments.layout import CONTACT, Variable, enum, of_cells, quantity
from stiffdice.experiments.model_ablation.pieces import MODEL, SCHEME, Piece, attributes, coordinates, pieces_of
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.run import Trajectory, simulate

APPROXIMATIONS = ("sliding", "frictionless")

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

# Numbers that a step of each model advances: place and velocity, angular momentum, spin and eight nodes, a tensor.
_NUMBERS = {"vertical": 2, "sliding": 6, "flying": 33, "tumbling": 36, "tensor": 45}

# Steps of the runs whose force evaluations are counted.
_COUNTED = 10_000


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
    stiffnesses = options.stiffnesses(stiffness)
    frictions = options.numbers("friction", friction, "1", at_least=0)
    horizon = validation.number("horizon", horizon, "s", above=0)
    tolerance = validation.number("tolerance", tolerance, "1", above=0)
    parted = validation.number("parted", parted, "m", above=0)
    flat = dataclasses.replace(_checked(scene), duration=horizon)
    shape = (len(LAWS), len(frictions), len(stiffnesses))
    errors, of_full = np.empty((len(_ERRORS), len(APPROXIMATIONS), *shape)), np.empty((len(_OF_FULL), *shape))
    for c, law in enumerate(LAWS):
        for s, stiff in enumerate(stiffnesses):
            ground = flat.with_ground(contact=law, stiffness=stiff)
            frictionless = _run(ground.with_ground(friction=0.0), "sliding", tolerance)
            for f, mu in enumerate(frictions):
                rough = ground.with_ground(friction=mu)
                full, coarse = (_run(rough, MODEL, part) for part in (tolerance, _COARSER * tolerance))
                landings = _landings(rough, full)
                of_full[:, c, f, s] = _of_full_model(rough, full, coarse, landings)
                for a, lesser in enumerate((_run(rough, "sliding", tolerance), frictionless)):
                    errors[:, a, c, f, s] = _errors(lesser, full, landings, parted)
    grid, pieces = ("approximation", "contact", "friction", "stiffness"), pieces_of(scene)
    variables = {name: quantity(grid, part, *_ERRORS[name]) for name, part in zip(_ERRORS, errors, strict=True)}
    variables |= {name: quantity(grid[1:], part, *_OF_FULL[name]) for name, part in zip(_OF_FULL, of_full, strict=True)}
    axes = coordinates(pieces) | {
        "approximation": enum("approximation", APPROXIMATIONS, "model without rotation: with friction, and without"),
        "contact": CONTACT,
        "friction": quantity("friction", frictions, "friction coefficient"),
        "stiffness": of_cells("stiffness", stiffnesses),
    }
    return xr.Dataset(
        variables | _work(pieces),
        axes,
        attributes("What left out pieces of the model cost", scene, __name__)
        | {"horizon": horizon, "horizon_units": "s", "tolerance": tolerance, "parted": parted, "parted_units": "m"},
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


def _of_full_model(scene: Scene, full: Trajectory, coarse: Trajectory, landings: _Landings) -> list[float]:
    """Return _OF_FULL of a run; coarse: the same at a larger tolerance."""
    after, before = landings
    found = dict.fromkeys(_OF_FULL, math.nan)
    if after > 0:
        found["spin"] = full.state["angular_momentum"][after, 1] / scene.cube.moment_of_inertia
        found["spin_theory"] = first_spin(scene, -full.state["velocity"][:after, 2].min())
    if before > 0:
        there = full.state[before]
        edge = there["node_offset"][0] - there["node_offset"][4]  # along z at the launch
        found["tilt"] = math.atan2(math.hypot(edge[0], edge[1]), edge[2])
        found["second_landing"] = full.time[before]
        found["numerical_error"] = math.dist(there["position"], coarse.state[before]["position"])
    return list(found.values())


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


def _errors(lesser: Trajectory, full: Trajectory, landings: _Landings, parted: float) -> list[float]:
    """Return _ERRORS of a lesser model's run."""
    distance = np.linalg.norm(lesser.state["position"] - full.state["position"], axis=1)
    apart = np.flatnonzero(distance > parted)
    found: dict[str, float] = dict.fromkeys(_ERRORS, math.nan) | {"horizon_error": distance[-1]}
    if len(apart):
        found["parting_time"] = full.time[apart[0]]
    before = landings.before_second
    if before > 0:
        found["landing_error"] = distance[before]
        of_lesser, of_full = (run.energy_paper[before] + run.elastic_energy[before] for run in (lesser, full))
        found["energy_error"] = of_lesser - of_full
    return list(found.values())


def _work(pieces: dict[str, Piece]) -> dict[str, Variable]:
    """Return what pieces cost in counts: the same in every rebuild, unlike seconds."""
    grid = ("piece", "role")
    models = [(piece.full, piece.least) for piece in pieces.values()]
    numbers = [[_NUMBERS[model] for model in pair] for pair in models]
    taken = [
        [_evaluations(piece.scene, model) for model in pair]
        for piece, pair in zip(pieces.values(), models, strict=True)
    ]
    return {
        "numbers": quantity(grid, numbers, "numbers that a step advances"),
        "evaluations": quantity(
            grid, taken, f"force evaluations of a run of {_COUNTED} steps, known motion taken at once"
        ),
    }


def _evaluations(scene: Scene, model: str) -> int:
    run = simulate(scene, model="tumbling" if model == "tensor" else model, scheme=SCHEME, steps=_COUNTED)
    return int(run.evaluations[0])

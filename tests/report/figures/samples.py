"""Small data for every drawing of the catalogue: what its own experiment, run or sweep gives in a moment.

Times and machines are made up, so that the same code gives the same picture everywhere; so are engines, which need not
be installed: their numbers are ours under their names.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr
from tests import rounds, toss_files

from stiffdice.experiments import (
    apex_edge,
    bounce_map,
    energy_budget,
    engines,
    failure_map,
    friction_chatter,
    granular,
    held_contacts,
    model_ablation,
    rocking,
)
from stiffdice.experiments.dice import coarse_steps, landing, response, shapes
from stiffdice.experiments.pair import limits, outcomes, peers
from stiffdice.experiments.tosses import chaos, fit, models, single, steps
from stiffdice.experiments.work_precision import measure as work_precision
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene import scene as scenes
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate
from stiffdice.sweep import stability_limits
from stiffdice.sweep.collect import collect
from stiffdice.sweep.grid import Sweep
from stiffdice.sweep.shard import compute_shard

Data = dict[str, xr.Dataset]

_SCENES = Path(__file__).parents[3] / "config/scenes"
_METHODS = ["symplectic_euler", "velocity_verlet", "rk4"]
_NAMED = ["symplectic_euler", "mujoco", "drake"]
_STIFF = {"ground": {"stiffness": 1e6, "damping": 0.0}}


def _named(found: xr.Dataset, names: list[str], **attributes: str) -> xr.Dataset:
    """Return the same numbers under other methods' names."""
    words = found.method.attrs | enum_attributes("method", names)
    method = ("method", np.arange(len(names), dtype=np.int8), words)
    return found.assign_coords(method=method).assign_attrs(attributes)


def _run(model: str, preset: str, **keys: object) -> xr.Dataset:
    return run_dataset(simulate(from_mapping(keys, preset=preset), model=model, steps=3000, every=10))


@cache
def throw() -> Data:
    spin = {"angular_momentum": {"seed": 1}}
    return {name: _run("tumbling", name, launch=spin, duration=2) for name in ("as_listed", "as_written")}


@cache
def slide() -> Data:
    cases = {"as_listed": {}, "as_written": {}, "corrected": {"cube": {"inertia": "solid"}}}
    return {name: _run("sliding", name, ground={"stiffness": 1e5}, duration=4, **more) for name, more in cases.items()}


def _swept(damping: float, contact: tuple[str, ...], stiffness: tuple[float, float, int], **scan: object) -> xr.Dataset:
    low, high, count = stiffness
    plan = Sweep(
        scene=from_mapping({"ground": {"damping": damping}}),
        model="sliding",
        scheme="symplectic_euler",
        contact=contact,
        stiffness={"from": low, "to": high, "count": count},
        steps=scan.get("steps"),
        omega_h=scan.get("omega_h"),
        members=4,
        seed=1,
        refine=0,
        criteria={"energy": 0.05, "apex": 0.02, "restitution": 0.05},
        early_stop=True,
        horizon=10.0,
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "shard.h5"
        compute_shard(plan, rounds.scan(plan), path)
        with xr.open_dataset(path, engine="h5netcdf") as shard:
            return stability_limits.find(collect([shard], plan.criteria)).load()


@cache
def maps() -> Data:
    span = {"from": 2.5, "to": 0.2, "count": 24}
    return {
        "paper": _swept(0.2, ("ungated", "gated"), (1e2, 1e4, 5), omega_h=span),
        "undamped": _swept(0.0, ("gated",), (1e2, 1e4, 5), omega_h=span),
    }


@cache
def grids() -> Data:
    dense = _swept(0.2, ("ungated", "gated"), (1e2, 1e4, 5), omega_h={"from": 2.5, "to": 0.2, "count": 48})
    thin = _swept(0.2, ("ungated", "gated"), (1e2, 1e4, 5), omega_h={"from": 2.5, "to": 0.2, "count": 24})
    return {"dense": dense, "thin": thin}


@cache
def combs() -> Data:
    scan = {"from": 8e3, "to": 3e4, "count": 40}
    return {
        "undamped": _swept(0.0, ("gated",), (1e6, 1e6, 1), steps=scan),
        "paper": _swept(0.2, ("ungated", "gated"), (1e6, 1e6, 1), steps=scan),
    }


@cache
def _toss(measure: Callable[..., xr.Dataset], **options: object) -> xr.Dataset:
    with TemporaryDirectory() as folder:
        path = toss_files.stored(toss_files.some(6), Path(folder) / "few.h5")
        return measure(toss_files.SCENE, data=str(path), **options)


@cache
def work() -> Data:
    options = {"methods": _METHODS, "stiffness": [1e2, 1e4, 1e6], "per_decade": 1, "steps": 1e5}
    scene = from_mapping({"ground": {"damping": 0.1, "friction": 0.1}, "duration": 3.0}, "as_written")
    return {
        "flat": work_precision.measure(scene, problem="flat-bounce", **options),
        "rubbing": work_precision.measure(scene, problem="sliding-bounce", **options),
    }


@cache
def engine_limits() -> Data:
    scene = from_mapping(_STIFF, "as_written")
    found = engines.limits(scene, methods=_METHODS, omega_h=[0.1, 12.0], count=12, phases=4)
    return {"limits": _named(found, _NAMED, engine_versions="MuJoCo 3.0, Drake 1.0", missing="")}


@cache
def engine_speed() -> Data:
    found = engines.speed(from_mapping(_STIFF, "as_written"), methods=_METHODS, steps=120, rounds=1)
    found = found.assign(seconds=found.taken / (10.0 ** np.arange(5, 8) * np.array([[1.0], [0.3]])))
    return {"speed": _named(found, _NAMED, engine_versions="", missing="", machine_processor="a processor")}


@cache
def engine_throw() -> Data:
    """Two methods, one of which blows up, beside a cube that falls and rises."""
    time, grid = np.linspace(0, 4, 41), ("method", "effort")
    reference = np.zeros((41, 3))
    reference[:, 2] = 1 + np.abs(np.cos(2 * time))
    position = np.stack([np.stack([reference + 1e-3, reference + 1e-4 * time[:, None]])] * 2)
    position[1, 1, 20:] = np.nan
    variables = {
        "position": ((*grid, "time", "axis"), position),
        "distance": ((*grid, "time"), np.linalg.norm(position - reference, axis=-1)),
        "reference_position": (("time", "axis"), reference),
        "reference_error": ("time", np.full(41, 1e-9)),
        "evaluations": (grid, [[100, 1000], [120, 1500]]),
        "steps": (grid, [[100, 1000], [0, 0]]),
        "tolerance": (grid, [[np.nan, np.nan], [1e-4, 1e-8]]),
    }
    method = ("method", np.arange(2, dtype=np.int8), enum_attributes("method", ["symplectic_euler", "mujoco"]))
    about = {"reference": "event", "engine_versions": "MuJoCo 3.0", "unfit": "drake: no reason"}
    return {"throw": xr.Dataset(variables, {"method": method, "time": time}, about)}


@cache
def pieces_timed() -> Data:
    timed = model_ablation.time(Scene().with_ground(contact="gated"), steps=300, rounds=1)
    for kind, first in (("step", 1e-8), ("run", 1e-3), ("leap", 1e-5)):
        times = first * np.array([2.0, 1.0]) * (1 + np.arange(timed.sizes["piece"]))[:, None] ** [[0.5, 0.0]]
        known = np.isfinite(timed[f"{kind}_ratio"].values)
        timed[f"{kind}_time"] = timed[f"{kind}_time"].copy(data=times)
        timed[f"{kind}_ratio"] = timed[f"{kind}_ratio"].copy(data=np.where(known, times[:, 0] / times[:, 1], np.nan))
    return {"gated": timed}


@cache
def failures() -> Data:
    scene, counts = Scene().with_ground(friction=0.0), [1.0, 10.0, 100.0, 1e3, 1e4, 1e5]
    axes = {"damping": {"values": [0.0, 1.0, 10.0, 1e3]}, "start": {}, "mass": {"values": [0.01, 1.0, 1e6]}}
    return {axis: failure_map.measure(scene, axis=axis, steps=counts, **more) for axis, more in axes.items()}


@cache
def held() -> Data:
    launch = {"position": [0, 0, 2], "velocity": [2.6, -1.7, 1.4], "angular_momentum": [0, 0.3, 1.3]}
    scene = from_mapping({"launch": launch, "ground": {"damping": 1.0}, "duration": 0.9})
    few = {"friction": (0.0, 1.0), "stiffness": (1e4, 1e6), "tolerance": (1e-6, 1e-9), "launches": 1}
    return {"held": held_contacts.measure(scene, **few)}


@cache
def boxes() -> Data:
    scene = scenes.load(_SCENES / "thrown-die.yaml")
    known = {"measured_aspect": [0.8, 1.2], "measured_part": [0.5, 0.2], "measured_throws": [100, 200]}
    return {"ends": shapes.measure(scene, aspect=[0.5, 1.0, 2.0], friction=[0.1, 0.3], throws=200, **known)}


@cache
def pair_limits() -> Data:
    scene, few = scenes.load(_SCENES / "equal-cubes.yaml"), {"stiffness": [1e2, 1e3, 1e4], "count": 20, "members": 4}
    cases = {"meeting": ["head_on", "corner_face"], "stacked": ["stacked"]}
    return {name: limits.measure(scene, cases=some, **few) for name, some in cases.items()}


def _one(name: str, measure: Callable[..., xr.Dataset], scene: Scene | str, **options: object) -> Callable[[], Data]:
    """Return a function that measures once."""

    @cache
    def found() -> Data:
        read = scenes.load(_SCENES / scene) if isinstance(scene, str) else scene
        return {name: measure(read, **options)}

    return found


_DIE = "thrown-die.yaml"
_FEW_STEPS = {"omega_h": [1.5, 1.0], "finest": 0.6, "throws": 500, "path_omega_h": [1.0, 0.5], "paths": 5}
_FEW_PEERS = {"omega_h": (0.1, 8.0), "count": 5, "phases": 2, "depth": [0.1, 0.4, 0.6], "angle": [1e-9, 1e-6, 1e-3]}

# By drawing.
SAMPLES: dict[str, Callable[[], Data]] = {
    **dict.fromkeys(("cube-start", "cube-middle", "cube-end", "animation"), throw),
    **dict.fromkeys(("position", "energy"), slide),
    **dict.fromkeys(("work-precision", "work-restitution", "work-energy"), work),
    **dict.fromkeys(("cost", "cost-restitution", "cost-energy"), work),
    "frontier": maps,
    "stability-map": maps,
    "pass-fraction": combs,
    "refinement-check": grids,
    "bounce-map": _one(
        "map", bounce_map.measure, Scene().with_ground(stiffness=1e6), omega_h=(0.1, 1.9), count=30, phases=40
    ),
    "apex-edge": _one("edge", apex_edge.measure, Scene(), count=40, members=4, duration=(5.0, 10.0)),
    "rocking": _one("rocking", rocking.measure, Scene(), zeta=(0.0, 0.3, 1.0), omega_h_relative=(0.9, 0.97, 1.03, 1.1)),
    "energy-budget": _one(
        "books", energy_budget.measure, Scene().with_ground(stiffness=1e6), steps=[20_000, 23_000], bounces=3
    ),
    "failure-map": failures,
    "friction-chatter": _one("chatter", friction_chatter.measure, Scene()),
    "model-ablation": _one(
        "pieces", model_ablation.measure, Scene(), stiffness=(1e3, 1e4), friction=(0.0, 0.01, 0.15), horizon=3.3
    ),
    "model-ablation-time": pieces_timed,
    "held-contacts": held,
    "toss-steps": lambda: {"x": _toss(steps.measure, contact_time=(0.005, 0.01), omega_h=(0.1, 3.0), count=6)},
    "toss-time": lambda: {"x": _toss(models.measure)},
    "toss-fit": lambda: {"x": _toss(fit.measure, contact_time=(0.005, 0.01))},
    "toss-chaos": lambda: {"x": _toss(chaos.measure, sizes=(1.0, 10.0), draws=5)},
    "toss-animation": lambda: {"x": _toss(single.measure)},
    "faces": _one("fair", landing.measure, "die.yaml", throws=2000),
    "coarse-steps": _one("die", coarse_steps.measure, "die.yaml", **_FEW_STEPS),
    "pair-limits": pair_limits,
    "pair-outcomes": _one(
        "outcomes",
        outcomes.measure,
        "equal-cubes.yaml",
        offset=[0.0, 0.3, 0.6, 0.9],
        friction=[0.0, 0.2],
        stiffness=1e3,
    ),
    "pair-peers": _one("peers", peers.measure, Scene(), duration=0.1, **_FEW_PEERS),
    "granular-impacts": _one("impacts", granular.impacts, Scene(), step=[0.1, 0.2, 0.5, 1.0], phases=8),
    "engine-limits": engine_limits,
    "engine-throw": engine_throw,
    "engine-speed": engine_speed,
    "box-faces": boxes,
    "face-response": _one("tossed", response.measure, _DIE, restitution=[0.3, 0.6], friction=[0.1, 0.3], throws=500),
    "launch-response": _one(
        "launches", response.launches, _DIE, speed=[0.0, 1.0], spin=[10.0, 30.0], steps=20_000, throws=500
    ),
}

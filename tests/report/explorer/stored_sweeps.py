"""Small sweeps stored as the workflow stores those of `make stability`, for the page to be published from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import xarray as xr
from tests import rounds

from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.reader import parts
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.sweep.collect import collect
from stiffdice.sweep.grid import Sweep
from stiffdice.sweep.stability_limits import find

PLACE = Path("stability/sweeps")

_LAUNCH: dict[str, Any] = {"position": [0, 0, 3], "velocity": [5, 0, 5], "angular_momentum": [0, 0, 0]}
_TURNING = _LAUNCH | {"angular_momentum": [0.3, 0.5, 0.2], "node_velocity": "rigid"}


def scene_of(model: str) -> Scene:
    """Return the scene of Figure 13, that of a cube that turns for tumbling."""
    ground = {"stiffness": 1e4, "damping": 0.2, "friction": 0.075}
    launch = _LAUNCH if model == "sliding" else _TURNING
    return from_mapping({"ground": ground, "launch": launch, "duration": 10}, preset="as_listed")


def sweep_of(model: str) -> Sweep:
    """Return a sweep of some fifty cells, or of a few that turn, whose runs end once all is decided."""
    sliding = model == "sliding"
    both = {"energy": 0.05, "trajectory": 0.05}
    return Sweep(
        scene=scene_of(model),
        model=model,
        scheme="symplectic_euler",
        contact=("ungated", "gated") if sliding else ("gated",),
        stiffness={"from": 1e3, "to": 1e5, "count": 3 if sliding else 2},
        omega_h={"from": 2.6, "to": 0.1, "count": 10 if sliding else 5},
        members=4 if sliding else 10,
        seed=5,
        horizon=3.0 if sliding else 2.0,
        criteria=both | {"apex": 0.02, "restitution": 0.05} if sliding else both,
        early_stop=True,
    )


def write(results: Path, *models: str) -> Path:
    """Store the sweeps of some models, each under its name, in a folder of results; return that."""
    for model in models:
        plan, folder = sweep_of(model), results / PLACE / model
        (folder / "shards").mkdir(parents=True)
        made = rounds.compute(plan, folder / "shards")
        found = collect((part for path in made for part in parts(path)), plan.criteria, plan.config)
        write_dataset(found, folder / "sweep.h5")
        write_dataset(find(found), folder / "frontier.h5")
        (folder / "shards.csv").write_text("\n".join(["shard", *(path.stem for path in made)]) + "\n")
    return results


def place_of(frontier: xr.Dataset, column: dict[str, Any]) -> tuple[int, int]:
    """Return where a column lies along contact and stiffness of a frontier."""
    laws = [meanings_of(frontier.contact)[number] for number in frontier.contact.values]
    return laws.index(column["law"]), frontier.stiffness.values.tolist().index(column["stiffness"])

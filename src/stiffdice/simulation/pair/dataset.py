"""A run of two boxes as a dataset: names, units and attributes of its file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from stiffdice.dynamics.box_contact import law
from stiffdice.errors import InputError
from stiffdice.io import schema
from stiffdice.io.plain_dataset import PlainDataset
from stiffdice.scene.cube import SIGNS
from stiffdice.simulation import backend
from stiffdice.simulation.dataset import AXES, VERDICTS, config_attributes, provenance_attributes
from stiffdice.simulation.pair import linear_limit
from stiffdice.simulation.pair.run import TOLERANCE, PairRun

if TYPE_CHECKING:
    import xarray as xr

MODEL = "pair"


def pair_dataset(run: PairRun, title: str = "Two cubes") -> xr.Dataset:
    """Return a run of two boxes with its trajectory as a dataset; each variable says its unit.

    run: of one launch, with a trajectory. title: of the dataset. Dimensions are time, cube (2), node (8) and axis (3).

    Raises InputError for a run of many launches, and for one whose trajectory was not kept.
    """
    import xarray as xr

    return xr.Dataset(*plain_pair_dataset(run, title))


def plain_pair_dataset(run: PairRun, title: str = "Two cubes") -> PlainDataset:
    """Return the dataset of a run as `pair_dataset` does, without xarray."""
    trajectory = run.trajectory
    if trajectory is None:
        raise InputError("run: has no trajectory of one launch; simulate_pair(..., every=K) keeps one")
    a, b = trajectory.state["a"], trajectory.state["b"]
    values: dict[str, Any] = {"step": trajectory.step}
    of_both = "position", "velocity", "angular_momentum", "node_offset"
    values |= {name: np.stack([a[name], b[name]], axis=1) for name in of_both}
    energies = "kinetic_energy", "potential_energy", "elastic_energy", "contact_energy", "mechanical_energy"
    values |= {name: getattr(trajectory, name) for name in energies}
    values |= {"energy_ratio": run.energy_ratio[0], "deepest_contact": run.deepest[0], "meetings": run.meetings[0]}
    values |= {"verdict": run.verdict[0], "steps_done": run.steps_done[0], "time": trajectory.time}
    values |= {"cube": np.arange(2, dtype=np.int8), "axis": np.arange(3, dtype=np.int8)}
    values["node"] = np.arange(1, len(SIGNS) + 1, dtype=np.int8)
    config = {"model": MODEL, "simulator": backend.OURS, "scheme": run.scheme, "steps": run.steps}
    config["every"] = int(trajectory.step[1]) if len(trajectory.step) > 1 else run.steps
    attributes = provenance_attributes(title, run.scene, MODEL, run.scheme, "stiffdice.simulation.pair.run")
    h = run.scene.duration / run.steps
    attributes |= config_attributes("pair", config)
    attributes |= {
        "formula": f"{law.FORMULA}; {attributes['formula']}",
        "simulator": backend.OURS,
        "simulator_version": backend.version_of(backend.OURS),
        "steps": run.steps,
        "step_size": h,
        "step_size_units": "s",
        "omega_h": linear_limit.hardest(run.scene).omega * h,
        "criteria": f"energy: energy_ratio <= {1 + TOLERANCE:g}",
    }
    if run.scene.derived:
        attributes["scene_derived"] = "; ".join(run.scene.derived)
    return schema.plain_dataset("pair", values, {"axis": AXES, "verdict": VERDICTS}, attributes)

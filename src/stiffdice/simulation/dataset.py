"""What is in a file: dimensions, names, units and attributes, in one place."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from stiffdice import __version__
from stiffdice.dynamics import contact, linear_theory
from stiffdice.dynamics.code_digest import code_digest
from stiffdice.dynamics.state import TURNING
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.io import schema
from stiffdice.io.plain_dataset import PlainDataset
from stiffdice.io.structure_check import FORMAT_VERSION
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.pair import PairScene
from stiffdice.scene.scene import Scene
from stiffdice.simulation import backend
from stiffdice.simulation.criteria.registry import CRITERIA, criteria_of
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import Run

if TYPE_CHECKING:
    import xarray as xr

VERDICTS = [verdict.name.lower() for verdict in Verdict]
VERDICT_ATTRIBUTES = schema.attributes_of("shard", "verdict", VERDICTS)
# What computes and writes the numbers besides our code; Python does neither.
_LIBRARIES = "; ".join(
    f"{name} {version(name)}" for name in ("numpy", "numba", "llvmlite", "h5py", "h5netcdf", "xarray")
)

AXES = ("x", "y", "z")
AXIS_ATTRIBUTES = schema.attributes_of("run", "axis", AXES)

# By the measure's name.
MEASURE_ATTRIBUTES = {
    criterion.MEASURE: {"long_name": criterion.LONG_NAME, "units": "1"} for criterion in CRITERIA.values()
}
CELL_ATTRIBUTES: dict[str, dict[str, Any]] = {
    "contact": schema.attributes_of("shard", "contact", list(CONTACT_LAWS)),
    **{name: schema.attributes_of("shard", name) for name in ("stiffness", "steps", "omega_h")},
}


def criteria_text(tolerances: Mapping[str, float]) -> str:
    """Return the criteria asked as one line of text."""
    return "; ".join(
        f"{name}: {CRITERIA[name].MEASURE} <= {CRITERIA[name].BASE + tolerance:g}"
        for name, tolerance in tolerances.items()
    )


def provenance_attributes(title: str, scene: Scene | PairScene, model: str, scheme: str, *code: str) -> dict[str, Any]:
    """Return the global attributes that say what made a file; nothing that two rebuilds would not share.

    code: the modules whose numbers the file holds.
    """
    return {
        "Conventions": "CF-1.11",
        "title": title,
        "history": f"made by stiffdice {__version__}",
        "source": f"simulation, model {model}, scheme {scheme}",
        "references": "Modeling and Simulating Dice (student paper, New York University)",
        "format_version": FORMAT_VERSION,
        "stiffdice_version": __version__,
        "libraries": _LIBRARIES,
        "code_digest": code_digest(*code),
        "scene": json.dumps(scene.as_mapping(), sort_keys=True),
        "scene_digest": scene.digest,
        "model": model,
        "scheme": scheme,
        "formula": "; ".join([contact.FORMULA, *([schemes.FORMULAS[scheme]] if scheme in schemes.FORMULAS else [])]),
    }


def config_attributes(kind: str, config: Mapping[str, Any]) -> dict[str, str]:
    """Return the attributes that say of which kind a file is, and what was asked: plain data, none of it the scene."""
    text = json.dumps(config, sort_keys=True)
    return {"kind": kind, "config": text, "config_digest": hashlib.sha256(text.encode()).hexdigest()}


def run_dataset(run: Run, title: str = "A thrown cube") -> xr.Dataset:
    """Return one run with its trajectory as a dataset; each variable says its unit.

    run: of one launch, with a trajectory. title: of the dataset. Dimensions are time, axis (3) and, of a cube that
    turns, node (8).

    Raises InputError for an ensemble, and for a run whose trajectory was not kept.
    """
    import xarray as xr

    return xr.Dataset(*plain_run_dataset(run, title))


def plain_run_dataset(run: Run, title: str = "A thrown cube") -> PlainDataset:
    """Return the dataset of a run as `run_dataset` does, without xarray."""
    trajectory = run.trajectory
    if trajectory is None or len(run.verdict) != 1:
        raise InputError("run: has no trajectory of one launch; simulate(..., every=K) keeps one")
    turns, state = run.model in TURNING, trajectory.state
    energies = "kinetic_energy", "potential_energy", "elastic_energy", "energy_paper", "mechanical_energy"
    values: dict[str, Any] = {"step": trajectory.step, "position": state["position"], "velocity": state["velocity"]}
    values |= {name: getattr(trajectory, name) for name in energies if getattr(trajectory, name) is not None}
    if turns:
        values |= {name: state[name] for name in ("angular_momentum", "node_offset")}
    measures = {part.MEASURE: run.measures[part.MEASURE][0] for part in criteria_of(run.model).values()}
    values |= {name: ((), value, MEASURE_ATTRIBUTES[name]) for name, value in measures.items() if not np.isnan(value)}
    outcome = "touchdown_phase", "verdict", "ending", "steps_done", "evaluations"
    values |= {name: getattr(run, name)[0] for name in outcome}
    values |= {"time": trajectory.time, "axis": np.arange(3, dtype=np.int8)}
    if turns:
        values["node"] = np.arange(1, len(SIGNS) + 1, dtype=np.int8)
    config = {name: getattr(run, name) for name in ("model", "simulator", "scheme", "steps", "tolerance")}
    config["every"] = int(trajectory.step[1]) if len(trajectory.step) > 1 else run.steps
    code = "stiffdice.simulation.run", *backend.code_of(run.simulator)
    attributes = provenance_attributes(title, run.scene, run.model, run.scheme, *code)
    attributes |= config_attributes("run", config)
    attributes |= {
        "simulator": run.simulator,
        "simulator_version": run.simulator_version,
        "model_reason": run.model_reason,
        "steps": run.steps,
        "step_size": run.scene.duration / run.steps,
        "step_size_units": "s",
        "tolerance": run.tolerance,
        "omega_h": linear_theory.omega_h(run.scene, run.steps),
        "angular_momentum_at_launch": np.array(run.scene.launch.spin),
        "criteria": criteria_text(run.tolerances),
        "hop_height": run.hop_height,
        "hop_height_units": "m",
    }
    if run.scene.derived:
        attributes["scene_derived"] = "; ".join(run.scene.derived)
    return schema.plain_dataset("run", values, {"axis": AXES, "verdict": VERDICTS, "ending": VERDICTS}, attributes)

"""What is in a file: dimensions, names, units and attributes, in one place."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.metadata import version
from typing import Any

import numpy as np
import xarray as xr

from stiffdice import __version__
from stiffdice.dynamics import contact, linear_theory
from stiffdice.dynamics.code_digest import code_digest
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.state import TURNING
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.io.attribute_check import FORMAT_VERSION
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.scene import Scene
from stiffdice.simulation import backend
from stiffdice.simulation.criteria.registry import CRITERIA, criteria_of
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import Run, Trajectory

CONTACT_ATTRIBUTES = enum_attributes("contact law", list(LAWS))
VERDICT_ATTRIBUTES = enum_attributes("verdict", [verdict.name.lower() for verdict in Verdict])
ENDING_ATTRIBUTES = VERDICT_ATTRIBUTES | {"long_name": "how the run ended whatever it was asked, passed if well"}
# What numbers and files depend on besides our code.
_LIBRARIES = ("numpy", "numba", "llvmlite", "h5py", "h5netcdf", "xarray")

AXES = ("x", "y", "z")
AXIS_ATTRIBUTES = enum_attributes("Cartesian axis, z up", AXES)


# By the measure's name; those of steps that are counted.
MEASURE_ATTRIBUTES = {
    criterion.MEASURE: {"long_name": criterion.LONG_NAME, "units": "1"} for criterion in CRITERIA.values()
}
PHASE_ATTRIBUTES = {"long_name": "phase of the first touch-down within its time step", "units": "1"}
STEPS_DONE_ATTRIBUTES = {"long_name": "steps done when the run ended", "units": "1"}
STEPS_COMPUTED_ATTRIBUTES = {"long_name": "steps computed one by one, not many at once", "units": "1"}
EVALUATIONS_ATTRIBUTES = {"long_name": "evaluations of the force", "units": "1"}
DECIDED_ATTRIBUTES = {"long_name": "step that decided the criterion, 0 if none before the end", "units": "1"}
MEMBER_ATTRIBUTES = {"long_name": "member: number k of n is launched k/n of a time step late", "units": "1"}
CELL_ATTRIBUTES: dict[str, dict[str, Any]] = {
    "contact": CONTACT_ATTRIBUTES,
    "stiffness": {"long_name": "ground stiffness", "units": "kg s-2"},
    "steps": {"long_name": "number of time steps", "units": "1"},
    "omega_h": {"long_name": "contact frequency of a flat landing times step size", "units": "1"},
}


def criterion_attributes(names: Sequence[str]) -> dict[str, Any]:
    """Return the attributes of a dimension of the criteria asked."""
    return enum_attributes("criterion", names)


def criteria_text(tolerances: Mapping[str, float]) -> str:
    """Return the criteria asked as one line of text."""
    return "; ".join(
        f"{name}: {CRITERIA[name].MEASURE} <= {CRITERIA[name].BASE + tolerance:g}"
        for name, tolerance in tolerances.items()
    )


def run_variables(members: int) -> dict[str, Any]:
    """Return the variables that a shard keeps of its runs, for one cell of so many members, without values."""
    table = ("cell", "member")
    numbers = np.zeros((1, members))
    counts = np.zeros((1, members), np.int64)
    return {name: (table, numbers, attributes) for name, attributes in MEASURE_ATTRIBUTES.items()} | {
        "touchdown_phase": (table, numbers, PHASE_ATTRIBUTES),
        "verdict": (table, np.zeros((1, members), np.int8), VERDICT_ATTRIBUTES),
        "ending": (table, np.zeros((1, members), np.int8), ENDING_ATTRIBUTES),
        "steps_done": (table, counts, STEPS_DONE_ATTRIBUTES),
        "steps_computed": (table, counts, STEPS_COMPUTED_ATTRIBUTES),
        "decided": ((*table, "criterion"), np.zeros((1, members, len(CRITERIA)), np.int64), DECIDED_ATTRIBUTES),
    }


def provenance_attributes(title: str, scene: Scene, model: str, scheme: str, *code: str) -> dict[str, Any]:
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
        "libraries": libraries(),
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


@cache
def libraries() -> str:
    """Return the versions of what computes and writes the numbers; Python's own is not among them: it does neither."""
    return "; ".join(f"{name} {version(name)}" for name in _LIBRARIES)


def simulator_attributes(simulator: str, version: str) -> dict[str, str]:
    """Return the attributes that say who made the runs of a file, and of which version."""
    return {"simulator": simulator, "simulator_version": version}


def run_dataset(run: Run, title: str = "A thrown cube") -> xr.Dataset:
    """Return one run with its trajectory as a dataset; each variable says its unit.

    run: of one launch, with a trajectory. title: of the dataset. Dimensions are time, axis (3) and, of a cube that
    turns, node (8).

    Raises InputError for an ensemble, and for a run whose trajectory was not kept.
    """
    trajectory = run.trajectory
    if trajectory is None or len(run.verdict) != 1:
        raise InputError("run: has no trajectory of one launch; simulate(..., every=K) keeps one")
    variables: dict[str, Any] = _trajectory_variables(trajectory)
    coordinates: dict[str, Any] = {
        "time": ("time", trajectory.time, {"long_name": "time since the launch", "units": "s"}),
        "axis": ("axis", np.arange(3, dtype=np.int8), AXIS_ATTRIBUTES),
    }
    if run.model in TURNING:
        variables |= _rotation_variables(trajectory)
        nodes = np.arange(1, len(SIGNS) + 1, dtype=np.int8)
        coordinates["node"] = ("node", nodes, {"long_name": "node, numbered as in cube.m", "units": "1"})
    variables |= {
        part.MEASURE: ((), run.measures[part.MEASURE][0], MEASURE_ATTRIBUTES[part.MEASURE])
        for part in criteria_of(run.model).values()
        if not np.isnan(run.measures[part.MEASURE][0])
    }
    variables["touchdown_phase"] = ((), run.touchdown_phase[0], PHASE_ATTRIBUTES)
    variables["verdict"] = ((), run.verdict[0], VERDICT_ATTRIBUTES)
    variables["ending"] = ((), run.ending[0], ENDING_ATTRIBUTES)
    variables["steps_done"] = ((), run.steps_done[0], STEPS_DONE_ATTRIBUTES)
    variables["evaluations"] = ((), run.evaluations[0], EVALUATIONS_ATTRIBUTES)
    code = "stiffdice.simulation.run", *backend.code_of(run.simulator)
    attributes = provenance_attributes(title, run.scene, run.model, run.scheme, *code)
    attributes |= config_attributes("run", _config(run, trajectory))
    attributes |= simulator_attributes(run.simulator, run.simulator_version) | {
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
    return xr.Dataset(variables, coordinates, attributes)


def _config(run: Run, trajectory: Trajectory) -> dict[str, Any]:
    kept = trajectory.step[:2].tolist()
    return {
        "model": run.model,
        "simulator": run.simulator,
        "scheme": run.scheme,
        "steps": run.steps,
        "tolerance": run.tolerance,
        "every": kept[1] - kept[0] if len(kept) == 2 else run.steps,
    }


def _trajectory_variables(trajectory: Trajectory) -> dict[str, Any]:
    place = ("time", "axis")
    energies = {
        "kinetic_energy": (trajectory.kinetic_energy, "kinetic energy, of translation and rotation"),
        "potential_energy": (trajectory.potential_energy, "potential energy m g z of the centre of mass"),
        "elastic_energy": (trajectory.elastic_energy, "energy in the ground's springs, S d²/2 per node"),
        "energy_paper": (trajectory.energy_paper, "kinetic and potential energy, the paper's total"),
    }
    if trajectory.mechanical_energy is not None:
        text = "kinetic, potential and elastic energy, the velocity taken at the time of the place"
        energies["mechanical_energy"] = trajectory.mechanical_energy, text
    return {
        "step": ("time", trajectory.step, {"long_name": "number of time steps done", "units": "1"}),
        "position": (place, trajectory.state["position"], {"long_name": "centre of mass", "units": "m"}),
        "velocity": (place, trajectory.state["velocity"], {"long_name": "velocity of it", "units": "m s-1"}),
    } | {name: ("time", values, {"long_name": text, "units": "J"}) for name, (values, text) in energies.items()}


def _rotation_variables(trajectory: Trajectory) -> dict[str, Any]:
    return {
        "angular_momentum": (
            ("time", "axis"),
            trajectory.state["angular_momentum"],
            {"long_name": "angular momentum about the centre", "units": "kg m2 s-1"},
        ),
        "node_offset": (
            ("time", "node", "axis"),
            trajectory.state["node_offset"],
            {"long_name": "node relative to the centre", "units": "m"},
        ),
    }

"""What is in a file: dimensions, names, units and attributes, in one place."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice import __version__, theory
from stiffdice.contact import LAWS
from stiffdice.cube import SIGNS
from stiffdice.io import FORMAT_VERSION
from stiffdice.io.enums import enum_attributes
from stiffdice.measures import MEASURES
from stiffdice.provenance import code_digest
from stiffdice.scene import Scene
from stiffdice.simulate import Run, Trajectory
from stiffdice.state import TURNING
from stiffdice.verdict import Verdict, criteria_of

CONTACT_ATTRIBUTES = enum_attributes("contact law", list(LAWS))
VERDICT_ATTRIBUTES = enum_attributes("verdict", [verdict.name.lower() for verdict in Verdict])
AXIS_ATTRIBUTES = enum_attributes("Cartesian axis, z up", ["x", "y", "z"])


def measure_variables(measures: Mapping[str, npt.NDArray[np.float64]], dims: tuple[str, ...]) -> dict[str, Any]:
    """Return the variables of all measures, on the dimensions given."""
    return {
        name: (dims, values, {"long_name": MEASURES[name].LONG_NAME, "units": "1"}) for name, values in measures.items()
    }


def provenance_attributes(title: str, scene: Scene, model: str, scheme: str, code: str) -> dict[str, Any]:
    """Return the global attributes that say what made a file; nothing that two rebuilds would not share.

    code: the module whose numbers the file holds.
    """
    return {
        "Conventions": "CF-1.11",
        "title": title,
        "format_version": FORMAT_VERSION,
        "stiffdice_version": __version__,
        "code_digest": code_digest(code),
        "scene": json.dumps(scene.as_mapping(), sort_keys=True),
        "scene_digest": scene.digest,
        "model": model,
        "scheme": scheme,
        "verdict_criteria": "; ".join(
            f"{name}: {criterion.measure} <= {1 + criterion.tolerance:g}"
            for name, criterion in criteria_of(model).items()
        ),
    }


def run_dataset(run: Run, title: str = "A thrown cube") -> xr.Dataset:
    """Return one run with its trajectory as a dataset; dimensions time, axis and, for tumbling, node."""
    trajectory = run.trajectory
    if trajectory is None or len(run.verdict) != 1:
        raise ValueError("a run's file holds the trajectory of one member")
    variables: dict[str, Any] = _trajectory_variables(trajectory)
    coordinates: dict[str, Any] = {
        "time": ("time", trajectory.time, {"long_name": "time since the launch", "units": "s", "axis": "T"}),
        "axis": ("axis", np.arange(3, dtype=np.int8), AXIS_ATTRIBUTES),
    }
    if run.model in TURNING:
        variables |= _rotation_variables(trajectory)
        nodes = np.arange(1, len(SIGNS) + 1, dtype=np.int8)
        coordinates["node"] = ("node", nodes, {"long_name": "node, numbered as in cube.m", "units": "1"})
    variables |= measure_variables({name: value[0] for name, value in run.measures.items()}, ())
    variables["verdict"] = ((), run.verdict[0], VERDICT_ATTRIBUTES)
    variables["steps_done"] = (
        (),
        run.steps_done[0],
        {"long_name": "steps within double range", "units": "1"},
    )
    attributes = provenance_attributes(title, run.scene, run.model, run.scheme, "stiffdice.simulate") | {
        "steps": run.steps,
        "step_size": run.scene.duration / run.steps,
        "step_size_units": "s",
        "omega_h": theory.omega_h(run.scene, run.steps),
        "angular_momentum_at_launch": np.array(run.scene.launch.spin),
        "verdict_text": Verdict(run.verdict[0]).sentence,
    }
    return xr.Dataset(variables, coordinates, attributes)


def _trajectory_variables(trajectory: Trajectory) -> dict[str, Any]:
    place = ("time", "axis")
    energies = {
        "kinetic_energy": (trajectory.kinetic_energy, "kinetic energy, of translation and rotation"),
        "potential_energy": (trajectory.potential_energy, "potential energy m g z of the centre of mass"),
        "elastic_energy": (trajectory.elastic_energy, "energy in the ground's springs, S d²/2 per node"),
        "energy_paper": (trajectory.energy_paper, "kinetic and potential energy, the paper's total"),
    }
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

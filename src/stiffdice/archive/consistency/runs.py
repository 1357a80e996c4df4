"""One run: its counts, energies, rigid body, verdict and ledger, from its scene and its states."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from stiffdice.archive.consistency import energy as books
from stiffdice.archive.consistency import verdicts
from stiffdice.archive.consistency.tolerance import ROUNDING, outside, unequal
from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.state import TURNING, physics_of, start_of
from stiffdice.scene import scene as scenes
from stiffdice.scene.scene import Scene
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.outcome import SEVERITY, Verdict


def problems(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a run's file that cannot be so."""
    scene = scenes.from_mapping(json.loads(dataset.attrs["scene"]))
    found = [*_attributes(dataset, scene), *_counts(dataset, scene)]
    if found:  # what follows stands on them
        return found
    found += [*_energies(dataset, scene), *_rigid(dataset, scene), *_judged(dataset)]
    if "launch_energy" in dataset:
        sizes = [np.abs(dataset[f"{name}_energy"].values) for name in ("kinetic", "potential", "elastic")]
        steps = int(dataset.attrs["steps"])
        found += books.problems(dataset, steps, scene.duration, float(np.sum(sizes, axis=0).max()))
    return found


def _attributes(dataset: xr.Dataset, scene: Scene) -> list[str]:
    steps = int(dataset.attrs["steps"])
    h, omega_h = scene.duration / steps, linear_theory.omega_h(scene, steps)
    found = unequal("step_size", dataset.attrs["step_size"], h, 2 * ROUNDING * h, "duration / steps")
    why = "√(4 S/m) times the step size"
    return found + unequal("omega_h", dataset.attrs["omega_h"], omega_h, 8 * ROUNDING * omega_h, why)


def _counts(dataset: xr.Dataset, scene: Scene) -> list[str]:
    """Every K-th step from the launch on, as far as the run went; the time of a step is step/steps of the duration."""
    steps, done = int(dataset.attrs["steps"]), int(dataset["steps_done"])
    found = outside("steps_done", done, 0 <= done <= steps, f"a number from 0 to {steps}")
    step = dataset["step"].values
    every = max(1, int(step[1] - step[0])) if len(step) > 1 else 1
    found += unequal("step", step, np.arange(len(step)) * every, 0.0, f"every {every}th step from the launch on")
    if len(step) > 1 and len(step) != done // every + 1:
        found.append(f"step: {len(step)} states; allowed are {done // every + 1}, as steps_done is")
    right = step / steps * scene.duration
    return found + unequal("time", dataset["time"].values, right, 2 * ROUNDING * right, "step / steps * duration")


def _energies(dataset: xr.Dataset, scene: Scene) -> list[str]:
    """State by state, from velocities and places, to the rounding of their sums.

    A depth d of the 8 nodes is off by up to b, the rounding of six products, five sums and of turning the nodes; so the
    sum of S d²/2 is by up to 4 b √(S ΣS d²/2) + 4 S b², by the inequality of Cauchy and Schwarz.
    """
    physics, model = physics_of(scene), str(dataset.attrs["model"])
    states = np.repeat(start_of(scene, model), dataset.sizes["time"])
    for name in ("position", "velocity", *(("angular_momentum", "node_offset") if model in TURNING else ())):
        states[name] = dataset[name].values
    kinetic, potential, elastic = energies(physics, states)
    blur = 16 * ROUNDING * (np.abs(states["position"]) @ np.abs(scene.ground.normal) + 2 * physics.reach)
    room = 4 * blur * np.sqrt(physics.stiffness * elastic) + 4 * physics.stiffness * blur**2 + 16 * ROUNDING * elastic
    paper = dataset["kinetic_energy"].values + dataset["potential_energy"].values
    return [
        *unequal("kinetic_energy", dataset["kinetic_energy"], kinetic, 8 * ROUNDING * kinetic, "m u²/2 + L²/(2 I)"),
        *unequal("potential_energy", dataset["potential_energy"], potential, 4 * ROUNDING * np.abs(potential), "m g z"),
        *unequal("elastic_energy", dataset["elastic_energy"], elastic, room, "the sum of S d²/2 over the nodes"),
        *unequal("energy_paper", dataset["energy_paper"], paper, 0.0, "kinetic_energy + potential_energy"),
    ]


# Of one rotation of the nodes: the rounding of its axis, of sine and cosine, of the matrix, and of three products.
_ROUNDINGS_OF_A_TURN = 32


def _rigid(dataset: xr.Dataset, scene: Scene) -> list[str]:
    """Distances between nodes are the cube's, but for the rounding of every turn since the launch.

    A turn needs a force, so there are not more of them than evaluations, or than steps of free flight.
    """
    if str(dataset.attrs["model"]) not in TURNING:
        return []
    nodes, offsets = scene.cube.node_offsets(), dataset["node_offset"].values
    first, second = np.triu_indices(len(nodes), 1)
    right = np.linalg.norm(nodes[first] - nodes[second], axis=1)
    found = np.linalg.norm(offsets[:, first] - offsets[:, second], axis=2)
    turns = 16 + max(int(dataset["steps_done"]), int(dataset["evaluations"]))
    room = _ROUNDINGS_OF_A_TURN * ROUNDING * turns * physics_of(scene).reach
    return [
        *unequal("distances between nodes of node_offset", found, right, room, "the cube's, which is rigid"),
        *unequal("sum of node_offset", offsets.sum(axis=1), 0.0, 8 * room, "the centre is amid the nodes"),
    ]


# How a run ended that ended early: its budget was spent, or what is graver.
_EARLY = SEVERITY[SEVERITY.index(Verdict.UNDECIDED) :]


def _judged(dataset: xr.Dataset) -> list[str]:
    whole = int(dataset["steps_done"]) == int(dataset.attrs["steps"]) or int(dataset["verdict"]) in _EARLY
    found = outside("steps_done", dataset["steps_done"].values, whole, "all steps, or a verdict that ends a run early")
    names = [criterion.MEASURE for criterion in CRITERIA.values()]
    measures = {name: float(dataset[name]) if name in dataset else np.nan for name in names}
    return found + verdicts.problems(dataset, measures, verdicts.limits_in(str(dataset.attrs["criteria"])))

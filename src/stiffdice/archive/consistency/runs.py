"""One run: its counts, energies, rigid body, verdict and ledger, from its scene and its states."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from stiffdice.archive.consistency import energy as books
from stiffdice.archive.consistency import verdicts
from stiffdice.archive.consistency.tolerance import ROUNDING, outside, unequal
from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import TURNING, Array, Physics, physics_of, start_of
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


def _turns(dataset: xr.Dataset) -> bool:
    return str(dataset.attrs["model"]) in TURNING


def _energies(dataset: xr.Dataset, scene: Scene) -> list[str]:
    """State by state, from velocities and places, to the rounding of their sums; a depth is a difference."""
    physics = physics_of(scene)
    kinetic, potential, elastic, both = (
        dataset[name].values for name in ("kinetic_energy", "potential_energy", "elastic_energy", "energy_paper")
    )
    moving = 0.5 * physics.mass * _squares(dataset["velocity"].values)
    if _turns(dataset):
        moving = moving + 0.5 * _squares(dataset["angular_momentum"].values) / physics.inertia
    high = physics.mass * physics.gravity * dataset["position"].values[:, 2]
    depth, blur = _depths(dataset, scene, physics)
    pressed = 0.5 * physics.stiffness * (np.maximum(0.0, depth) ** 2).sum(axis=1)
    room = (physics.stiffness * blur * np.maximum(0.0, depth + blur)).sum(axis=1) + 16 * ROUNDING * pressed
    return [
        *unequal("kinetic_energy", kinetic, moving, 8 * ROUNDING * moving, "m u²/2 + L²/(2 I)"),
        *unequal("potential_energy", potential, high, 4 * ROUNDING * np.abs(high), "m g z"),
        *unequal("elastic_energy", elastic, pressed, room, "the sum of S d²/2 over the nodes"),
        *unequal("energy_paper", both, kinetic + potential, 0.0, "kinetic_energy + potential_energy"),
    ]


def _squares(vectors: Array) -> Array:
    return np.asarray(vectors[:, 0] ** 2 + vectors[:, 1] ** 2 + vectors[:, 2] ** 2)


def _depths(dataset: xr.Dataset, scene: Scene, physics: Physics) -> tuple[Array, Array]:
    """Return how deep each node is in the ground [m], shape (time, node), and how much of it may be rounding.

    That is of six products and five sums, and of turning the nodes; shape (time, 1).
    """
    n, x = np.array(scene.ground.normal), dataset["position"].values
    start = start_of(scene, str(dataset.attrs["model"]))[0]
    r = dataset["node_offset"].values if _turns(dataset) else start["node_offset"][None]
    blur = 16 * ROUNDING * (np.abs(x) @ np.abs(n) + 2 * physics.reach)
    return -((x @ n)[:, None] + r @ n), blur[:, None]


# Of one rotation of the nodes: the rounding of its axis, of sine and cosine, of the matrix, and of three products.
_ROUNDINGS_OF_A_TURN = 32


def _rigid(dataset: xr.Dataset, scene: Scene) -> list[str]:
    """Distances between nodes are the cube's, but for the rounding of every turn since the launch.

    A turn needs a force, so there are not more of them than evaluations, or than steps of free flight.
    """
    if not _turns(dataset):
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

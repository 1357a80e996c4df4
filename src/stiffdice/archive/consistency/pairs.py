"""Equations that the numbers of a run of two cubes must fulfil: counts, energies, rigid bodies, verdict and ledger."""

from __future__ import annotations

import json

import numpy as np
import xarray as xr

from stiffdice.archive.consistency.equations import ROUNDING, counts, outside, rigid, unequal
from stiffdice.dynamics.box_contact.pair_state import pair_physics_of, pair_start_of
from stiffdice.scene import pair
from stiffdice.scene.pair import PairScene
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.pair import energy, linear_limit
from stiffdice.simulation.pair.energy_budget import WORKS
from stiffdice.simulation.pair.run import TOLERANCE

_STATE = ("position", "velocity", "angular_momentum", "node_offset")
# Of a step, at most: rk4's.
_TURNS = 4
# Σ w of a contact, at most, to be safe: it is 4 of two faces.
_MOST_SPRINGS = 8


def of_pair(dataset: xr.Dataset) -> list[str]:
    """Return a line for everything in a file of two cubes that cannot be so."""
    scene = pair.from_mapping(json.loads(dataset.attrs["scene"]))
    steps, done = int(dataset.attrs["steps"]), int(dataset["steps_done"])
    omega_h = linear_limit.hardest(scene).omega * (scene.duration / steps)
    if found := counts(dataset, scene.duration, omega_h, "the fastest contact of a stack times the step size"):
        return found
    passed = int(dataset["verdict"]) == Verdict.PASSED
    fine = float(dataset["energy_ratio"]) <= 1 + TOLERANCE and done == steps
    found = _energies(dataset, scene)
    for number, part in enumerate(scene.parts):
        lines = rigid(dataset["node_offset"].values[:, number], part, _TURNS * done)
        found += [f"cube {number}: {line}" for line in lines]
    found += outside("verdict", int(dataset["verdict"]), passed == fine, "what energy_ratio and steps_done say")
    return found + (_ledger(dataset) if "booked_energy" in dataset else [])


def _energies(dataset: xr.Dataset, scene: PairScene) -> list[str]:
    """State by state, from velocities and places, to the rounding of their sums (as `equations` bounds them)."""
    physics, states = pair_physics_of(scene), np.repeat(pair_start_of(scene), dataset.sizes["time"])
    for number, body in enumerate("ab"):
        for name in _STATE:
            states[body][name] = dataset[name].values[:, number]
    kinetic, potential, elastic, contact = energy.energies(physics, states, 0.0)[:4]
    reach = physics.a.reach + physics.b.reach
    far = sum(np.abs(states[body]["position"]).sum(axis=1) for body in "ab")
    blur = 64 * ROUNDING * (far + 2 * reach)
    high = sum(
        part.cube.mass * scene.gravity * np.abs(states[body]["position"][:, 2])
        for part, body in zip(scene.parts, "ab", strict=True)
    )
    found = []
    for name, right, room, why in (
        ("kinetic_energy", kinetic, 16 * ROUNDING * kinetic, "m u²/2 + L·ω/2 of both"),
        ("potential_energy", potential, 8 * ROUNDING * high, "m g z of both"),
        ("elastic_energy", elastic, _room(physics.stiffness, elastic, blur), "the sum of S d²/2 over the nodes"),
        ("contact_energy", contact, _room(physics.stiffness, contact, blur), "the sum of S w d²/2 over the contacts"),
    ):
        found += unequal(name, dataset[name], right, room, why)
    return found


def _room(stiffness: float, springs: np.ndarray, blur: np.ndarray) -> np.ndarray:
    """Return how far S Σ w d²/2 [J] may be off where each d is by `blur` [m], by Cauchy and Schwarz."""
    return (
        _MOST_SPRINGS * blur * np.sqrt(stiffness * springs)
        + _MOST_SPRINGS * stiffness * blur**2
        + 32 * ROUNDING * springs
    )


def _ledger(dataset: xr.Dataset) -> list[str]:
    """What is booked adds up to what the energies changed by, to sixteen roundings of the largest in every step."""
    kinetic, whole = dataset["body_kinetic_energy"].values, dataset["booked_energy"].values
    steps = 1 + dataset["step"].values
    room = 16 * ROUNDING * steps * np.abs(whole).max()
    works = sum(dataset[f"body_{name}"].values for name in WORKS)
    lost = sum(dataset[f"{name}_work"].values for name in ("damping", "friction", "scheme"))
    both = dataset["kinetic_energy"].values
    return [
        *unequal("sum of works on a cube", works, kinetic - kinetic[0], room[:, None], "the kinetic energy gained"),
        *unequal("sum of works", lost, whole - whole[0], room, "the change of booked_energy"),
        *unequal("sum of body_kinetic_energy", kinetic.sum(axis=1), both, 16 * ROUNDING * both, "kinetic_energy"),
    ]

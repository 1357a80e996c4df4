"""Boxes thrown many times: dice of any sides with their mass off centre, and how often each face comes up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from stiffdice.errors import InputError
from stiffdice.experiments.dice.counts import Counts
from stiffdice.experiments.dice.throws import many
from stiffdice.scene import scene as scenes
from stiffdice.scene import validation
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.scene import Scene
from stiffdice.simulation.landing import BATCHED
from stiffdice.simulation.launch_distribution import LaunchDistribution

MODEL, SCHEME = "tumbling", BATCHED


@dataclass(frozen=True)
class Throwing:
    """How boxes are thrown: launches about the scene's, and the numerics.

    velocity_spread [m/s], spin_spread [rad/s]: standard deviations of each component (`LaunchDistribution`); every
    orientation is as likely. contact_time [s]: of a flat landing. steps: in the scene's duration. throws: of each box.
    Raises InputError for values out of range.
    """

    velocity_spread: float
    spin_spread: float
    contact_time: float
    steps: int
    throws: int

    def __post_init__(self) -> None:
        LaunchDistribution(velocity_spread=self.velocity_spread, spin_spread=self.spin_spread)
        validation.number("contact_time", self.contact_time, "s", above=0)
        validation.count("steps", self.steps)
        validation.count("throws", self.throws)


def box_of(
    scene: Scene,
    restitution: float,
    friction: float,
    contact_time: float,
    *,
    stretch: Sequence[float] = (0.0, 0.0, 0.0),
    offset: Sequence[float] = (0.0, 0.0, 0.0),
) -> Scene:
    """Return a scene with another body on another ground, all else as it is.

    stretch [1]: logarithm of each side over the cube root of the volume, which stays that of the scene's cube. offset
    [1]: of the centre of mass from the box's, over the side along it. The mass and its moments of inertia are those of
    a solid box. restitution, friction, contact_time [s]: of a flat landing, gated. Raises InputError for a body that
    cannot be.
    """
    mass, volume = scene.cube.mass, math.prod(2 * half for half in scene.cube.half_sides)
    sides = volume ** (1 / 3) * np.exp(np.array(stretch) - np.mean(stretch))
    squares = sides * sides
    masses = mass / 8 * (1 + 2 * SIGNS @ np.array(offset))
    if not masses.min() >= 0:
        raise InputError(f"offset = {list(offset)}: allowed are numbers whose sizes sum to 0.5 at most")
    keys = scene.as_mapping() | {
        "cube": {
            "sides": sides.tolist(),
            "node_masses": masses.tolist(),
            "moments": (mass / 12 * (squares.sum() - squares)).tolist(),
        },
        "ground": {
            "restitution": restitution,
            "friction": friction,
            "contact_time": contact_time,
            "contact": "gated",
        },
    }
    return scenes.from_mapping(keys)


def faces_up(scene: Scene, throwing: Throwing, seed: int) -> tuple[Counts, int]:
    """Return how often each face came up, shape (6,), of the throws that settled, and how many did not.

    Raises InputError for a scene that cannot be thrown, and where no face came up at all.
    """
    launches = LaunchDistribution(velocity_spread=throwing.velocity_spread, spin_spread=throwing.spin_spread, seed=seed)
    found = many(scene, launches, SCHEME, throwing.steps, throwing.throws, empty=True)
    if not found.counts.any():
        raise InputError(f"duration = {scene.duration:g}: no throw settles; allowed is a longer one [s]")
    return found.counts, throwing.throws - int(found.counts.sum())

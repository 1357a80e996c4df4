"""Two equal boxes where an experiment puts them."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from stiffdice.dynamics.box_contact.pair_state import Pairs, pair_start_of
from stiffdice.dynamics.state import Array
from stiffdice.scene.pair import PairScene
from stiffdice.scene.scene import Launch, Scene

UPRIGHT = (0.0, 0.0, 0.0)
# Where nothing else is touched, in units of the side.
IN_THE_AIR = 10.0


def pair_of(scene: Scene, launches: Sequence[Launch], *, gravity: float | None = None, **ground: Any) -> PairScene:
    """Return two boxes as the scene's, each with a launch, on its ground made level and gated, with these values."""
    level = scene.with_ground(normal=(0.0, 0.0, 1.0), contact="gated", **ground)
    weight = scene.gravity if gravity is None else gravity
    a, b = (dataclasses.replace(level, launch=launch, gravity=weight) for launch in launches)
    return PairScene((a, b))


def still(position: Sequence[float] = UPRIGHT, orientation: Sequence[float] = UPRIGHT) -> Launch:
    """Return the launch of a box at rest, its nodes moving with its spin."""
    x, y, z = position
    turn_x, turn_y, turn_z = orientation
    return Launch((x, y, z), (0.0, 0.0, 0.0), orientation=(turn_x, turn_y, turn_z), node_velocity="rigid")


def above(scene: PairScene, height: float, gap: float) -> Pairs:
    """Return both boxes as launched but one above the other, shape (1,).

    height [m]: of the lower one's lowest node above the ground. gap [m]: between its highest and the other's lowest.
    """
    pair = pair_start_of(scene)
    lower, upper = (pair[name]["node_offset"][0, :, 2] for name in "ab")
    pair["a"]["position"] = 0.0, 0.0, height - lower.min()
    pair["b"]["position"] = 0.0, 0.0, height - lower.min() + lower.max() + gap - upper.min()
    return pair


def speeds(pairs: Pairs, a: Sequence[float] | Array, b: Sequence[float] | Array) -> Pairs:
    """Return pairs whose boxes move at these velocities [m/s], shape (3,) each."""
    moving = pairs.copy()
    moving["a"]["velocity"], moving["b"]["velocity"] = np.asarray(a), np.asarray(b)
    return moving

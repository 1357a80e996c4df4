"""Scenes that experiments make of a given one: level ground, an upright cube, another launch."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import start_of
from stiffdice.errors import InputError
from stiffdice.scene.scene import Scene

# How deep a flat cube goes, in units of the side: so that round-off in its height, 1e-16, is none in the phase of the
# touch-down, and its upper nodes stay above the ground.
_DEPTHS = 1e-4, 0.5


def level(scene: Scene, **ground: float) -> Scene:
    """Return the scene on level ground under the gated law, with these numbers of the ground."""
    return scene.with_ground(normal=(0.0, 0.0, 1.0), contact="gated", **ground)


def relaunched(scene: Scene, **launch: Any) -> Scene:
    """Return the scene with other values of its launch."""
    return dataclasses.replace(scene, launch=dataclasses.replace(scene.launch, **launch))


def upright(scene: Scene, **launch: Any) -> Scene:
    """Return the scene with an upright cube without spin, and other values of its launch."""
    return relaunched(scene, angular_momentum=(0.0, 0.0, 0.0), orientation=(0.0, 0.0, 0.0), **launch)


def clearance(scene: Scene) -> float:
    """Return how far above the ground the lowest node is at the launch [m]."""
    nodes = start_of(scene, "sliding")["node_offset"][0]
    return float(((nodes + scene.launch.position) @ np.array(scene.ground.normal)).min())


def at_clearance(scene: Scene, height: float) -> Scene:
    """Return the scene moved along the ground's normal until its lowest node is so high above the ground [m]."""
    normal, place = np.array(scene.ground.normal), np.array(scene.launch.position)
    # The height anew, not a difference: it shall be exact to the last bit on level ground.
    height -= float((start_of(scene, "sliding")["node_offset"][0] @ normal).min())
    return relaunched(scene, position=tuple((place - normal * (normal @ place) + normal * height).tolist()))


def _still(scene: Scene, height: float) -> Scene:
    return at_clearance(relaunched(scene, velocity=(0.0, 0.0, 0.0), angular_momentum=(0.0, 0.0, 0.0)), height)


# By name: the scene's own launch, and starts without motion.
STARTS: Mapping[str, Callable[[Scene], Scene]] = {
    "launch": lambda scene: scene,
    "at_rest": lambda scene: _still(scene, -min(linear_theory.sag(scene), scene.cube.side)),
    "touching": lambda scene: _still(scene, 0.0),
    "deep": lambda scene: _still(scene, -scene.cube.side / 2),
    "far_below": lambda scene: _still(scene, -3 * scene.cube.side),
}


def contact_frequency(scene: Scene) -> float:
    """Return ω [rad/s] of a flat landing."""
    return linear_theory.contact_frequency(scene.ground.stiffness, scene.cube.mass)


def fall_speed(scene: Scene, fall: float) -> float:
    """Return the vertical speed [m/s] of the launch in free flight, so far [m] below its place."""
    return math.sqrt(max(0.0, scene.launch.velocity[2] ** 2 + 2 * scene.gravity * fall))


def height_above(scene: Scene) -> float:
    """Return how far above level ground the lower face of the upright cube is launched [m]."""
    return scene.launch.position[2] - scene.cube.side / 2


def landing_speed(scene: Scene) -> float:
    """Return the speed [m/s] at which the launch, in free flight, meets level ground with its lower face.

    Raises InputError unless it does, and goes in by a length that is neither lost in the side nor all of it.
    """
    fall = height_above(scene)
    speed, omega = fall_speed(scene, fall), contact_frequency(scene)
    low, high = (part * scene.cube.side for part in _DEPTHS)
    if not (fall > 0 and low * omega <= speed <= high * omega):
        raise InputError(
            f"launch: the cube meets the ground at v = {speed:.3g} m/s, with ω = {omega:.3g} rad/s; allowed is "
            f"a launch above it and a depth v/ω of {low:.3g} to {high:.3g} [m]"
        )
    return speed

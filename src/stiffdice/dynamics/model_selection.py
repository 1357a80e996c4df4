"""What a scene requires: the least model that is exact for it, and why, in one sentence.

A model leaves something out, and is exact where that would do nothing:

- contact (`flying`), where no node reaches the ground, nor, under the `ungated` law with damping, moves towards it;
- rotation (`sliding`, `vertical`), for a cube without spin where every torque cancels: while all eight nodes feel the
  same, as the drag of the `ungated` law in the air, and in a flat landing, four nodes level, unless friction acts on
  those four alone;
- friction and the place on the ground (`vertical`), where nothing moves the cube along level ground.

Exact is meant of the motion, not of round-off, which the full model may amplify (docs/explanation/method.md). A flat
cube whose centre stays above the ground is righted by every contact. On an edge or a corner, or with its centre below
the ground, the ground turns it further from the slightest tilt, so that no model without rotation stands for it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import Array, physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.scene import validation
from stiffdice.scene.rotation import along
from stiffdice.scene.scene import Scene

AUTO, AS_ASKED = "auto", "as asked"
CHOICES = (*MODELS, AUTO)

# From the least on. Where a scene requires one of the last three, whatever else it requires on other ground is exact,
# too: without spin every cube that is `flying` here slides, or moves straight up and down.
_ORDER = ("flying", "vertical", "sliding", "tumbling")

# In units of the side: what rounding a normal, a rotation vector of up to 15 digits and the rotation itself can do to
# the height of a node, some 40 units in the last place.
ROUND_OFF = 1e-14
# In units of all lengths in a flight: far above what its round-off can add up to.
_MARGIN = 1e-9

# Why the ground turns a cube that touches it without spin.
_CENTRE = "the centre of mass is not that of the nodes, so that the ground turns the cube"
_TILT = (
    "the cube does not land flat, and on an edge or a corner the ground turns it, from the slightest tilt if it is "
    "balanced"
)


def least_model(scene: Scene, longest_step: float = 0.0) -> tuple[str, str]:
    """Return the least model that is exact for a scene, and a sentence that says why.

    longest_step [s]: of the runs it is for. A scheme's flight may leave the parabola by what gravity adds in a step to
    the speed, and members fly on for up to a step; only a flight that clears the ground even so is `flying`.
    """
    ground, clear, speed = scene.ground, _clears(scene, longest_step), _along(scene, scene.launch.velocity)
    # Exactly nothing moves it along the ground: the friction of a sliding speed of round-off is above round-off.
    sliding = any(part - speed * along for part, along in zip(scene.launch.velocity, ground.normal, strict=True))
    straight = not sliding and not (scene.gravity > 0 and (ground.normal[0] != 0 or ground.normal[1] != 0))
    if ground.stiffness == 0 and ground.damping == 0:
        name, reason = "flying", "ground without stiffness and damping does nothing to the cube"
    elif clear and (ground.contact == "gated" or ground.damping == 0):
        name, reason = "flying", "the cube never reaches the ground, so its weight alone moves it"
    elif clear and _recedes(scene, longest_step):
        name = "flying"
        reason = "the cube never reaches the ground nor moves towards it, so its weight alone moves it"
    elif any(scene.launch.spin):
        name, reason = "tumbling", "the cube spins"
    elif scene.cube.distribution.centre.any() or not (clear or lands_flat(scene)):
        name, reason = "tumbling", _CENTRE if scene.cube.distribution.centre.any() else _TILT
    elif not clear and ground.friction > 0 and not straight:
        name, reason = "tumbling", "the cube lands flat, but friction tips it as it slides"
    elif not clear and not _stays_above(scene):
        name, reason = "tumbling", "the cube lands flat, but may sink to its centre, past which the ground turns it"
        reason += " from the slightest tilt"
    else:
        level = straight and ground.normal == (0.0, 0.0, 1.0)
        name, aside = ("vertical", "sideways") if level else ("sliding", "along the ground")
        if clear:
            reason = "the cube never reaches the ground, and drag, the same on every node, gives it no spin"
            reason += f", nor does anything move it {aside}" if straight else ""
        else:
            reason = "the cube lands flat without spin and "
            reason += f"nothing moves it {aside}" if straight else "there is no friction to tip it"
    if name == "tumbling" and scene.cube.distribution.is_isotropic:
        reason += "; its inertia, the same about every axis, needs no tensor that turns with it"
    elif name == "tumbling":
        reason += "; its tensor of inertia turns with it"
    return name, f"{name}: {reason}"


def chosen(model: str, scenes: Iterable[Scene], longest_step: float) -> tuple[str, str]:
    """Return the model to compute, and why: `auto` resolved to the least that is exact for all of these scenes.

    scenes: one launch on one or several grounds. longest_step [s]: as in `least_model`.
    Raises InputError for an unknown name, and for `flying` where the ground acts on the cube.
    """
    validation.choice("model", model, CHOICES)
    if model not in (AUTO, "flying"):
        return model, AS_ASKED
    needed = max((least_model(scene, longest_step) for scene in scenes), key=lambda least: _ORDER.index(least[0]))
    if model == AUTO:
        return needed
    if needed[0] != "flying":
        raise InputError(
            "model = flying: allowed for scenes in which the ground never acts on the cube, in steps of up to "
            f"{longest_step:.3g} s; this one requires {needed[1]}"
        )
    return model, AS_ASKED


def lands_flat(scene: Scene, tolerance: float = ROUND_OFF) -> bool:
    """Return whether four nodes of a cube that keeps its orientation meet the ground at once.

    tolerance: of their heights, in units of the side.
    """
    heights = np.sort(_heights(scene))
    return bool(heights[3] - heights[0] <= tolerance * 2 * min(scene.cube.half_sides) < heights[4] - heights[0])


def _heights(scene: Scene) -> Array:
    """Return how high above the centre each node is at the launch [m], shape (node,)."""
    return along(start_of(scene, "tumbling")["node_offset"][0], scene.ground.normal)


def _along(scene: Scene, vector: validation.Vector) -> float:
    """Return the part of a vector along the ground's normal."""
    return float(along(np.array(vector), scene.ground.normal))


def _clears(scene: Scene, longest_step: float) -> bool:
    """Return whether no node reaches the ground before the end in a flight under gravity, nor then under drag."""
    height, speed = _along(scene, scene.launch.position), _along(scene, scene.launch.velocity)
    pull, time = scene.gravity * scene.ground.normal[2], scene.duration + longest_step
    slow = speed - abs(pull) * longest_step
    turn = min(max(0.0, slow / pull), time) if pull < 0 else time
    lowest = min([height, *(height + slow * end - pull * end * end / 2 for end in (turn, time))])
    extent = physics_of(scene).reach if any(scene.launch.spin) else -float(_heights(scene).min())
    margin = _MARGIN * (extent + abs(height) + abs(slow) * time + abs(pull) * time * time)
    return lowest > extent + margin


def _recedes(scene: Scene, longest_step: float) -> bool:
    """Return whether no node moves towards the ground before the end in a flight under gravity alone."""
    physics, spin = physics_of(scene), scene.launch.spin
    speed, pull = _along(scene, scene.launch.velocity), scene.gravity * scene.ground.normal[2]
    slowest = min(speed, speed - pull * (scene.duration + longest_step))
    # Along the normal n a node at r moves by n·(ω × r) = r·(n × ω).
    turning = math.hypot(*np.cross(scene.ground.normal, spin).tolist()) / physics.inertia * physics.reach
    return slowest >= turning


def _stays_above(scene: Scene) -> bool:
    """Return whether the centre of a flat cube that nothing tips stays above the plane of the ground.

    It needs the energy 2 S (s/2)² of four springs to get there. What it has along the normal nothing adds to.
    """
    height, speed = _along(scene, scene.launch.position), _along(scene, scene.launch.velocity)
    pull, half, springs = (
        scene.gravity * scene.ground.normal[2],
        -float(_heights(scene).min()),
        2 * scene.ground.stiffness,
    )
    depth = max(0.0, half - height)
    energy = scene.cube.mass * (speed * speed / 2 + pull * height) + springs * depth * depth
    return height > 0 and energy < springs * half * half

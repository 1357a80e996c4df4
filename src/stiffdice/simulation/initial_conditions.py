"""Members: launches that differ in where within a time step the cube first touches down, and how it is turned.

What one bounce gains or loses depends on the phase of the step at touch-down; so each member enters the scene's own
flight a fraction of a step later. Energy, aim and touch-down are those of the scene, and the phase is spread evenly.
For a cube that turns, orientation and the axis of its spin are spread evenly, too.
"""

from __future__ import annotations

import math

import numpy as np

from stiffdice.dynamics.state import TOUCHING, TURNING, Ensemble, States, spin_of, start_of
from stiffdice.errors import InputError
from stiffdice.scene.rotation import along, rotated
from stiffdice.scene.scene import Scene


def turned(scene: Scene, model: str, count: int) -> States:
    """Return `count` launches at the scene's place, shape (count,), that differ in orientation and in the spin's axis.

    The first is the scene's own. The others are spread evenly, by a sequence without randomness: orientations over all
    rotations (Shoemake, Graphics Gems III, 1992, p. 124), the axis of the spin over all directions, its magnitude kept.
    A model that does not turn the cube gets copies, and so does one of which the ground never feels how it is turned.
    """
    members = np.repeat(start_of(scene, model), count)
    if model not in TURNING & TOUCHING:
        return members
    spin = math.hypot(*scene.launch.spin)
    offsets = scene.cube.node_offsets()
    # Points that fill the unit cube evenly: an additive recurrence whose steps are powers of the root of x⁶ = x + 1
    # (Roberts 2018, "The unreasonable effectiveness of quasirandom sequences"), the golden ratio's generalisation.
    root = 2.0
    for _ in range(64):
        root = (1 + root) ** (1 / 6)
    points = (0.5 + np.outer(np.arange(1, count), root ** -np.arange(1.0, 6))) % 1
    for member, (u, v, w, p, q) in zip(members[1:], points, strict=True):
        a, b = math.sqrt(1 - u), math.sqrt(u)
        vector = np.array([a * math.sin(2 * math.pi * v), a * math.cos(2 * math.pi * v), b * math.sin(2 * math.pi * w)])
        length = math.hypot(*vector)
        angle = 2 * math.atan2(length, b * math.cos(2 * math.pi * w))
        member["node_offset"] = rotated(offsets, vector / length * angle if length > 0 else vector)
        across = math.sqrt(1 - (2 * p - 1) ** 2)
        axis = np.array([across * math.cos(2 * math.pi * q), across * math.sin(2 * math.pi * q), 2 * p - 1])
        member["angular_momentum"] = spin * axis
        if scene.launch.node_velocity == "rigid":
            member["angular_velocity"] = spin_of(scene.cube, member)
    return members


def phased(
    scene: Scene, model: str, steps: int, count: int, launches: States | None = None, block: slice = slice(None)
) -> Ensemble:
    """Return members, of `count` the k-th of which enters its flight k/count of a time step late.

    launches: those of each member, shape (count,); None takes the scene's for all. block: which members to return.
    The flight is the free one, gravity alone. (The `ungated` law drags on a falling cube, too: a scene that launches
    downwards gets members whose energies differ by that drag over less than a step.)
    Raises InputError if a cube is not clear of the ground from the launch on for a whole step.
    """
    members = (np.repeat(start_of(scene, model), count) if launches is None else launches)[block].copy()
    late = (np.arange(count) / count * (scene.duration / steps))[block]
    if count == 1:
        return Ensemble(members, late)
    down = np.array([0.0, 0.0, -scene.gravity])
    members["position"] += members["velocity"] * late[:, None] + 0.5 * down * late[:, None] ** 2
    members["velocity"] += down * late[:, None]
    for member, delay in zip(members, late, strict=True):
        turn = spin_of(scene.cube, member) * delay
        if turn.any():
            half = rotated(member["node_offset"], turn / 2)  # where the spin of a box is about the mean of the delay's
            turn = spin_of(scene.cube, member, half) * delay
            member["node_offset"] = rotated(member["node_offset"], turn)
    heights = along(members["position"][:, None, :] + members["node_offset"], scene.ground.normal)
    if not heights.min() > 0:
        raise InputError(
            f"members = {count}: they are spread over the phase of the first touch-down, so the launch must clear the "
            f"ground for a whole time step; the lowest node is at {heights.min():.3g} m"
        )
    return Ensemble(members, late)

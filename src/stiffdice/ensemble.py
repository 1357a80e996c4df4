"""Members: launches that differ only in where within a time step the cube first touches down.

Each is the scene's own flight, entered a fraction of a step later. Energy, aim and touch-down are those of the scene;
the phase of the first touch-down, which decides what a bounce gains or loses, is spread evenly over one step.
"""

from __future__ import annotations

import numpy as np

from stiffdice.errors import InputError
from stiffdice.scene import Scene
from stiffdice.state import States, rotated, start_of


def phased(scene: Scene, model: str, steps: int, count: int) -> States:
    """Return `count` launches, shape (count,), the k-th being k/count of a time step along the scene's flight.

    The flight is the free one, gravity alone. (The `ungated` law drags on a falling cube, too: a scene that launches
    downwards gets members whose energies differ by that drag over less than a step.)
    Raises InputError if the cube is not clear of the ground from the launch on for a whole step.
    """
    (start,) = launched = start_of(scene, model)
    members = np.repeat(launched, count)
    if count == 1:
        return members
    delay = np.arange(count) / count * (scene.duration / steps)
    down = np.array([0.0, 0.0, -scene.gravity])
    members["position"] += start["velocity"] * delay[:, None] + 0.5 * down * delay[:, None] ** 2
    members["velocity"] += down * delay[:, None]
    spin = start["angular_momentum"] / scene.cube.moment_of_inertia
    if spin.any():
        for member, late in zip(members, delay, strict=True):
            member["node_offset"] = rotated(start["node_offset"], spin * late)
    heights = (members["position"][:, None, :] + members["node_offset"]) @ np.array(scene.ground.normal)
    if not heights.min() > 0:
        raise InputError(
            f"members = {count}: they are spread over the phase of the first touch-down, so the launch must clear the "
            f"ground for a whole time step; the lowest node is at {heights.min():.3g} m"
        )
    return members

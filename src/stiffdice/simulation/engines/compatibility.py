"""What an engine cannot represent whose ground acts on nothing above it and whose nodes move with the cube."""

from __future__ import annotations

import numpy as np

from stiffdice.dynamics.state import TOUCHING, TURNING, start_of
from stiffdice.scene.scene import Scene


def gated_rigid(engine: str, scene: Scene, model: str) -> str | None:
    """Return in one sentence why such an engine cannot represent a scene and model, or None if it can.

    Without damping the contact laws are one; above the ground it does not matter how fast a node moves.
    """
    ground, launch = scene.ground, scene.launch
    if model not in TOUCHING:
        return None
    if ground.contact == "ungated" and ground.damping > 0:
        return (
            f"ground.contact = ungated, ground.damping = {ground.damping:g}: allowed is contact gated, or damping 0, "
            f"as {engine}'s ground acts on nothing above it"
        )
    if model in TURNING and launch.node_velocity == "translation" and any(launch.spin) and _touches(scene, model):
        return (
            "launch.node_velocity = translation: allowed is rigid where a spinning cube is launched in the ground, as "
            f"{engine}'s nodes move with the cube"
        )
    return None


def _touches(scene: Scene, model: str) -> bool:
    (state,) = start_of(scene, model)
    return bool(((state["position"] + state["node_offset"]) @ np.array(scene.ground.normal)).min() < 0)

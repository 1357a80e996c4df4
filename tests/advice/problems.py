"""Scenes to ask advice for. Gated and tumbling unless told otherwise: one law and model, compiled once."""

from __future__ import annotations

from stiffdice.scene.scene import from_mapping

SPIN = {"angular_momentum": [0.3, 0.5, 0.2], "node_velocity": "rigid"}


def scene(duration=3.0, stiffness=1e4, launch=None, **ground):
    ground = {"contact": "gated", "stiffness": stiffness, **ground}
    return from_mapping({"ground": ground, "launch": SPIN if launch is None else launch, "duration": duration})


def flat(**ground):
    return scene(launch={"node_velocity": "rigid"}, friction=0, **ground)


def resting(**ground):
    return scene(launch={"position": [0, 0, 0.5177], "velocity": [0.3, 0, 0], "node_velocity": "rigid"}, **ground)


def held(**changes):
    """Friction so strong that it holds corners, each landing at another phase of it."""
    keys = {
        "ground": {"stiffness": 2e4, "damping": 6, "friction": 0.86, "contact": "gated"},
        "launch": {
            "position": [0, 0, 2.124],
            "velocity": [2.61, -1.72, 1.43],
            "angular_momentum": [-0.04, 0.34, 1.3],
            "orientation": [0.53, -0.35, 1.28],
            "node_velocity": "rigid",
        },
        "duration": 3,
    }
    return from_mapping(keys | changes)

"""The pieces of the full model, each with a scene that does not need it: rotation, friction, contact, a tensor.

A cube needs no rotating tensor of inertia, and no model has one: it is written in `time`, to be timed.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from stiffdice.experiments.layout import Variable, enum
from stiffdice.experiments.placement import relaunched, upright
from stiffdice.scene.scene import Scene
from stiffdice.simulation import dataset

MODEL, SCHEME = "tumbling", "symplectic_euler"

ROLES = ("full", "least")


class Piece(NamedTuple):
    """A piece of the full model: a scene that does not need it, and the two models that differ by it.

    full: tensor is `tumbling` with a rotating tensor.
    """

    scene: Scene
    full: str
    least: str


def pieces_of(scene: Scene) -> dict[str, Piece]:
    """Return each piece with the given scene changed so that it needs all but that piece, by name.

    rotation: a flat landing without friction. friction: a flat cube dropped straight. contact: a flight that ends in
    the air, under a law without damping (of which `ungated` would drag on it). tensor: a throw with spin. all: the full
    model for a flat cube dropped straight.
    """
    down = scene.launch.velocity[2]
    flat = upright(scene.with_ground(normal=(0.0, 0.0, 1.0)))
    dropped = relaunched(flat, velocity=(0.0, 0.0, down))
    fall = abs(down) * scene.duration + scene.gravity * scene.duration**2
    high = relaunched(flat.with_ground(damping=0.0), position=(0.0, 0.0, fall + 2 * scene.cube.side))
    spin = scene.cube.moment_of_inertia
    spun = relaunched(flat, angular_momentum=(1.7 * spin, 2.8 * spin, 1.1 * spin))
    return {
        "rotation": Piece(flat.with_ground(friction=0.0), "tumbling", "sliding"),
        "friction": Piece(dropped, "sliding", "vertical"),
        "contact": Piece(high, "tumbling", "flying"),
        "tensor": Piece(spun, "tensor", "tumbling"),
        "all": Piece(dropped, "tumbling", "vertical"),
    }


def coordinates(pieces: dict[str, Piece]) -> dict[str, Variable]:
    """Return the coordinates of what was found of each piece, with it and without."""
    return {
        "piece": enum("piece", list(pieces), "piece of the full model that the scene does not need"),
        "role": enum("role", ROLES, "model with the piece, or without"),
    }


def attributes(title: str, scene: Scene, code: str) -> dict[str, Any]:
    """Return the attributes of a file; code: the module whose numbers it holds."""
    return dataset.provenance_attributes(title, scene, MODEL, SCHEME, code) | {
        "scene_note": "contact law, stiffness and friction are the dimensions'; pieces have scenes of their own"
    }

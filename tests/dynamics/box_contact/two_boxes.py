"""Two boxes wherever a test wants them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from stiffdice.dynamics.box_contact import law
from stiffdice.dynamics.box_contact.pair_state import pair_physics_of, pair_start_of
from stiffdice.scene.pair import from_mapping

UNIT = [1.0, 1.0, 1.0]


def scene(first, second, *, stiffness=1.0, damping=0.0, friction=0.0, sides=(UNIT, UNIT), **more):
    """Return a scene of two launches without gravity; a launch is what the keys of `launch` say, or a position."""
    launches = [launch if isinstance(launch, dict) else {"position": list(launch)} for launch in (first, second)]
    cubes = [
        {"cube": {"sides": list(side)}, "launch": {"velocity": [0, 0, 0], **launch}}
        for side, launch in zip(sides, launches, strict=True)
    ]
    ground = {"stiffness": stiffness, "damping": damping, "friction": friction}
    return from_mapping({"cubes": cubes, "ground": ground, "gravity": 0, "duration": 1, **more})


def placed(sides, places, turns):
    """Return the physics of two boxes with springs of 1 kg/s², and a state for each of several places and turns.

    places [m]: of the second, shape (state, 3), the first being at 0; turns: of both, two lists of Rotation.
    """
    two = scene([0, 0, 0], [5, 0, 0], sides=sides)
    physics, start = pair_physics_of(two), pair_start_of(two)[0]
    states = np.repeat(pair_start_of(two), len(places))
    states["b"]["position"] = places
    for name, turned in zip("ab", turns, strict=True):
        states[name]["node_offset"] = np.array([turn.apply(start[name]["node_offset"]) for turn in turned])
    return physics, states


def energies(sides, places, turns):
    """Return the energies of such states [J]."""
    return law.evaluate(*placed(sides, places, turns))[0]


def stiffness(place, turn=None, first=None):
    """Return Σ w of a contact [1]: the energy of two unit cubes with springs of 1 kg/s², over d²/2."""
    none = Rotation.identity()
    *across, (height, depth) = place
    turns = [first or none], [turn or none]
    return float(2 * energies((UNIT, UNIT), np.array([[*across, height - depth]]), turns)[0] / depth**2)

"""Chatter: what friction makes of a cube at rest, against the step size.

Friction is regularised: a step takes k v/(v + cutoff) from a sliding speed v, with k = mu g h for the cube's weight. At
k > 2 cutoff standing still is unstable, and the cube swings to and fro from step to step by k/2 − cutoff, whatever its
stiffness, damping and launch; below, it comes to rest.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import physics_of
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import mapped, numbers, result
from stiffdice.experiments.placement import STARTS, contact_frequency, level, relaunched
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines import stepper

MODEL, SCHEME = "sliding", "symplectic_euler"

# The last steps of a run, whose largest speed is the swing.
_LAST = 200

# ωh of the cube on its ground: above, the bounce is unstable, too.
_LONGEST = 1.5

_SWINGS = {
    "swing": ("largest sliding speed of a cube at rest", "m s-1"),
    "swing_theory": ("mu g h/2 - cutoff, or nothing", "m s-1"),
}
_LEAST = {"least_step": ("step size from which on a cube at rest chatters, 2 cutoff/(mu g)", "s")}


def measure(
    scene: Scene,
    *,
    friction: Sequence[float] = (0.01, 0.075, 1.0),
    step_size: Sequence[float] = tuple(np.logspace(-8, -2.5, 23)),
    steps: int = 4000,
) -> xr.Dataset:
    """Return the swing of the sliding speed of a cube at rest [m/s], measured and by theory, and `least_step` [s].

    scene: gives the cube, gravity, stiffness and damping; the cube rests on level ground under the gated law, sliding
    at first with three steps' friction. friction: coefficients. step_size [s]: up to ωh = 1.5. steps: how many are
    taken, and more where the swing needs them to settle; it is that of the last 200. Dimensions friction, step_size.
    Raises InputError for a number out of range, and for a scene in which the cube does not rest on four nodes.
    """
    coefficients = numbers("friction", friction, "1", above=0)
    steps = validation.count("steps", steps, at_least=2 * _LAST)
    flat, cutoff = level(scene), physics_of(scene).cutoff
    stiffness, weight = scene.ground.stiffness, scene.cube.mass * scene.gravity
    if not 0 < weight < linear_theory.BOUNCE_NODES * stiffness * scene.cube.side / 2:
        raise InputError(
            f"ground.stiffness = {stiffness:g}, gravity = {scene.gravity:g}: allowed are those with which the cube "
            "rests on its lower face"
        )
    longest = _LONGEST / contact_frequency(scene)
    sizes = numbers("step_size", step_size, "s", above=0)
    if max(sizes, default=0) > longest:
        raise InputError(f"step_size = {max(sizes):g}: allowed are numbers <= {longest:.3g} [s], ωh = {_LONGEST:g}")

    def swings(mu: float, h: float) -> tuple[float, float]:
        # In a step what is off the swing shrinks by 1 − 4 cutoff/k: to 1e-4 in so many.
        taken = steps + round(2.5 * mu * scene.gravity * h / cutoff)
        sliding = relaunched(
            STARTS["at_rest"](flat.with_ground(friction=mu)), velocity=(3 * mu * scene.gravity * h, 0.0, 0.0)
        )
        start = stepper.ready(SCHEME, dataclasses.replace(sliding, duration=h * taken), MODEL, taken, taken)
        return np.abs(start()().states["velocity"][-_LAST:, 0]).max(), max(0.0, mu * scene.gravity * h / 2 - cutoff)

    found = mapped(swings, _SWINGS, friction=coefficients, step_size=sizes)
    found |= mapped(lambda mu: [2 * cutoff / (mu * scene.gravity)], _LEAST, friction=coefficients)
    note = "friction and launch are the experiment's, not the scene's; ground: level, gated"
    return result(found, "Chatter of a cube at rest", flat, MODEL, SCHEME, __name__, scene_note=note)

"""One flat bounce by any method, launched so that a step meets the ground at a chosen phase."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import STATE, Array, States, start_of
from stiffdice.errors import InputError
from stiffdice.experiments.placement import contact_frequency, level, upright
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation.engines import registry as engines

MODEL = "sliding"

# What becomes of the cube, from mild to grave: it leaves the ground; it is still on it after so many contacts' time;
# with all nodes below it; or it left the range of doubles.
OUTCOMES = ("leaves", "stays", "sinks", "blows_up")
_PATIENCE = 5


class Bounce(NamedTuple):
    """What came of a bounce; numbers are not-a-number unless the cube leaves the ground.

    restitution [1]: speed up over speed down at the surface. contact_time [s]: for how long the lowest nodes were below
    the surface, by straight lines between the states. slowed [1]: horizontal over normal impulse, the weight's part
    being the ground's, too; friction's mu, if the cube slides throughout.
    """

    outcome: str
    restitution: float
    contact_time: float
    slowed: float


def flat(scene: Scene, **ground: float) -> Scene:
    """Return the scene on level ground under the `gated` law, with an upright cube and these numbers of the ground."""
    return upright(level(scene, **ground), node_velocity="rigid")


def heights_at_rest(method: str, scene: Scene, h: float, steps: int, nudge: float = 0.0) -> Array:
    """Return the centre's heights [m] in steps of h [s], of a cube put where it would rest, or a nudge [m] above."""
    height = scene.cube.side / 2 - linear_theory.sag(scene) + nudge
    launch = Launch((0.0, 0.0, height), (0.0, 0.0, 0.0), node_velocity="rigid")
    resting = dataclasses.replace(scene, launch=launch, duration=steps * h)
    states = np.zeros(steps, STATE)
    engines.adapter_of(method)(resting, MODEL, start_of(resting, MODEL), h).advance(states, 1)
    return np.asarray(states["position"][:, 2])


def bounce(method: str, scene: Scene, speed: float, h: float, phase: float) -> Bounce:
    """Return what becomes of a flat cube that comes down at a speed [m/s], in steps of h [s].

    scene: of `flat`. phase [1]: how much of a step has passed when the lowest nodes meet the surface.
    """
    contact = math.pi / contact_frequency(scene)
    chunk = 3 + math.ceil(1.2 * contact / h)
    scene, launch = _launched(scene, method, speed, h, phase, chunk * _PATIENCE)
    engine = engines.adapter_of(method)(scene, MODEL, launch, h)
    states, outcome = launch, "stays"
    for _ in range(_PATIENCE):
        more = np.zeros(chunk, STATE)
        engine.advance(more, 1)
        states = np.concatenate([states, more])
        outcome = _outcome(scene, states)
        if outcome != "stays":
            break
    if outcome != "leaves":
        return Bounce(outcome, math.nan, math.nan, math.nan)
    low = states["position"][:, 2] - scene.cube.side / 2
    # The slope of the path, which the velocity is behind: in the air by gravity's pull.
    up = states["velocity"][-1, 2] - engines.adapter_of(method).LAG * h * scene.gravity
    leaving = math.sqrt(up**2 + 2 * scene.gravity * low[-1])
    contact_time = _below(low) * h
    slowed = states["velocity"][0, 0] - states["velocity"][-1, 0]
    normal = leaving + speed + scene.gravity * contact_time
    return Bounce("leaves", leaving / speed, contact_time, float(slowed / normal))


def _launched(scene: Scene, method: str, speed: float, h: float, phase: float, steps: int) -> tuple[Scene, States]:
    height = speed * h * (1 + phase)
    if 2 * scene.gravity * height >= speed**2:
        raise InputError(f"omega_h: a step of {h:.3g} s is too long for a fall that ends at {speed:.3g} m/s")
    down = math.sqrt(speed**2 - 2 * scene.gravity * height) - engines.adapter_of(method).LAG * h * scene.gravity
    x, y, _ = scene.launch.velocity
    placed = Launch((0.0, 0.0, scene.cube.side / 2 + height), (x, y, -down), node_velocity="rigid")
    scene = dataclasses.replace(scene, launch=placed, duration=h * steps)
    return scene, start_of(scene, MODEL)


def _outcome(scene: Scene, states: States) -> str:
    last = states[-1]
    if not (np.isfinite(last["position"]).all() and np.isfinite(last["velocity"]).all()):
        return "blows_up"
    low = last["position"][2] - scene.cube.side / 2
    if low > 0 and last["velocity"][2] > 0:
        return "leaves"
    return "sinks" if low < -scene.cube.side else "stays"


def _below(heights: Array) -> float:
    """Return for how many steps a line through these heights, one a step, is below zero."""
    before, after = heights[:-1], heights[1:]
    share = np.where(before < 0, before, after) / np.where(before == after, 1.0, np.abs(after - before))
    return float(np.where((before < 0) & (after < 0), 1.0, np.abs(share) * ((before < 0) ^ (after < 0))).sum())

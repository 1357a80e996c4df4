"""How many steps of a run are free flight for certain, so that a scheme's closed form can take them at once."""

from __future__ import annotations

import math
from typing import Any

from stiffdice import models
from stiffdice.compiled import by_tag, njit
from stiffdice.contact import Gated, Ungated
from stiffdice.state import Physics

# Fewer than this are stepped: looking ahead costs about as much.
WORTHWHILE = 8

# In units in the last place of the height: a step that moves the cube by less is taken, because stepping loses part of
# it to round-off, half a unit at most, and the same again in the next step.
_LOST = 1024


@njit
def lost(sight: Any) -> bool:
    """Return whether steps are so short that round-off shows in the distance they go."""
    return sight.step_size * abs(sight.speed) < _LOST * 2.0**-52 * abs(sight.height)


@njit
def _rising(model: Any, speed: float, sight: Any) -> float:
    """Ungated: the force on a node is zero as long as it rises, which is known of all only where none turns."""
    if not models.touches(model):
        return math.inf
    if models.turns(model) or speed < 0.0:
        return 0.0
    return speed / (sight.step_size * sight.pull) if sight.pull > 0.0 else math.inf


@njit
def _always(model: Any, speed: float, sight: Any) -> float:
    """Gated: a node above the ground feels nothing."""
    return math.inf


# (law, model, speed, sight) -> for how many steps a body in the air at this speed along the normal [m/s] feels nothing.
_undisturbed = by_tag({Ungated: _rising, Gated: _always})


@njit
def _until(room: Any, speed: Any, pull: Any, h: Any) -> Any:
    """Return after how many steps of h [s] a body at `speed` [m/s] under `pull` [m/s²] has fallen by `room` [m]."""
    if pull > 0.0:
        root = math.sqrt(speed * speed + 2 * pull * room)
        return ((speed + root) / pull if speed > 0.0 else 2 * room / (root - speed)) / h
    if pull < 0.0 or speed >= 0.0:
        return 0.0 if speed < 0.0 else math.inf
    return room / -speed / h


@njit
def free_steps(model: Any, law: Any, physics: Physics, state: Any, sight: Any, most: int) -> int:
    """Return a number of steps, at most `most`, in which no node touches the ground and no force but weight acts.

    It need not be the greatest. Along the ground's normal the path is a parabola, open downwards, so that over any
    number of steps it is lowest at an end.
    """
    if sight.flight < 2.0 or most < WORTHWHILE or lost(sight):
        return 0
    h = sight.step_size
    # A scheme's path may be off the parabola by a step's move or two.
    margin = 4 * h * (abs(sight.speed) + h * abs(sight.pull))
    room = sight.height - models.extent(model, physics, state) - margin
    steps = _until(room, sight.speed - h * sight.pull, sight.pull, h) if room > 0.0 else 0.0
    undisturbed = _undisturbed(law, model, sight.speed, sight)
    steps = min(steps, undisturbed)
    if models.turns(model) and steps < most and undisturbed > steps:
        steps = max(steps, _turning(physics, state, sight, margin))
    return 0 if steps < WORTHWHILE else int(min(steps, float(most)))


@njit
def _turning(physics: Physics, state: Any, sight: Any, margin: float) -> float:
    """Return for how many steps no node of a turning body touches the ground, each on a bound of its own.

    A node at r moves up at n·(u + ω × r), and what turning adds to its acceleration is (n × ω)·(ω × r), at most
    |n × ω| |ω| |r|. So its path stays above a parabola, the closer the shorter it is.
    """
    n, w = (physics.nx, physics.ny, physics.nz), state.angular_momentum
    wx, wy, wz = w[0] / physics.inertia, w[1] / physics.inertia, w[2] / physics.inertia
    ax, ay, az = n[1] * wz - n[2] * wy, n[2] * wx - n[0] * wz, n[0] * wy - n[1] * wx
    bend = math.sqrt((ax * ax + ay * ay + az * az) * (wx * wx + wy * wy + wz * wz)) * physics.reach
    pull, h = sight.pull + bend, sight.step_size
    if not pull > 0.0:
        return 0.0
    soonest = math.inf
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        rx, ry, rz = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        room = sight.height + (n[0] * rx + n[1] * ry + n[2] * rz) - margin
        if not room > 0.0:
            return 0.0
        # n·(ω × r) = (n × ω)·r
        speed = sight.speed - h * pull + (ax * rx + ay * ry + az * rz)
        soonest = min(soonest, _until(room, speed, pull, h))
    return soonest

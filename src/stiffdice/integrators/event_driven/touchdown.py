"""When a body in free flight touches the ground: the first time, to round-off.

Node k is above the ground by c_k(t) = c + u t − g t²/2 + n·R(t) r_k, R(t) turning at a constant spin. A node that is c
high and rises at c' now, under an acceleration of no more than A = g + Ω²ρ towards the ground, ρ its distance from the
spin's axis, is not below c + c' s − A s²/2 after s; to go to that bound's zero, again and again, passes over no
touch-down and converges as Newton's method does (conservative advancement).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import height_of, normal_of, speed_of, upward
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import Vector, cross, dot, norm, row, vector
from stiffdice.integrators.free_flight import landing

# Enough for any touch-down; a node that grazes the ground so long is taken to touch it.
_ADVANCES = 1000

_ULPS = 4 * 2.0**-52

# A node that a contact has let go may be below the ground by the round-off that `active_set.py` allows, and a little
# more: were it taken to touch, neither flight nor contact would ever move it.
_BELOW = 4


@njit
def free_time(model: Any, physics: Physics, state: Any, most: float) -> tuple[float, int]:
    """Return for how long [s], at most `most`, no node of a body in free flight goes below the ground; and advances.

    At the time returned, if it is less, a node is at the ground but for round-off and about to go below; 0 if one is
    below already.
    """
    pull = physics.gravity * physics.nz
    height, speed = height_of(physics, state), speed_of(physics, state)
    time = 0.0
    if height > physics.reach:
        time = landing(pull, height - physics.reach, speed)
        if time >= most:
            return most, 0
    momentum = vector(state.angular_momentum)
    spin = Vector(momentum.x / physics.inertia, momentum.y / physics.inertia, momentum.z / physics.inertia)
    rate = norm(spin) if models.turns(model) else 0.0
    # The nodes' levels [m] as constant, cosine and sine of the angle turned, and the latters' amplitude.
    parts = np.zeros((len(state.node_offset), 4))
    for k in range(len(parts)):
        node = row(state.node_offset, k)
        parts[k, 0] = level = upward(physics, node)
        if rate != 0.0:
            axis = Vector(spin.x / rate, spin.y / rate, spin.z / rate)
            parts[k, 0] = dot(axis, node) * upward(physics, axis)
            parts[k, 1], parts[k, 2] = level - parts[k, 0], upward(physics, cross(axis, node))
            parts[k, 3] = math.hypot(parts[k, 1], parts[k, 2])
    n, place = normal_of(physics), vector(state.position)
    length = abs(n.x * place.x) + abs(n.y * place.y) + abs(n.z * place.z)
    small = _ULPS * (length + abs(speed) * time + physics.reach)
    advances = 0
    while advances < _ADVANCES:
        advances += 1
        centre = height + time * (speed - 0.5 * pull * time)
        rising = speed - pull * time
        cosine, sine = math.cos(rate * time), math.sin(rate * time)
        pace, touches = math.inf, False
        for k in range(parts.shape[0]):
            clearance = centre + parts[k, 0] + cosine * parts[k, 1] + sine * parts[k, 2]
            turning = rate * (cosine * parts[k, 2] - sine * parts[k, 1])
            touches = touches or clearance < -_BELOW * small or (clearance <= small and rising + turning < 0.0)
            hardest = pull + rate * rate * parts[k, 3]
            pace = min(pace, landing(hardest, max(0.0, clearance), rising + turning))
        if touches:
            break
        time += pace
        if time >= most:
            return most, advances
    return time, advances

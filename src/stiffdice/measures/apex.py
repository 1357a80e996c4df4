"""The largest rise of a rebound: how high the cube gets in a flight, against the flight before.

Heights are the centre's above the ground plane, m g times which is the energy of the motion that bounces: friction
cannot hide a gain here by draining the sliding. The first flight is measured against what the launch can reach.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.compiled import njit

LONG_NAME = "largest apex over the apex before it"
SLOTS = 5  # height two steps ago, one step ago, clearance one step ago, last apex [m], largest ratio so far


@njit
def start(memory: Any, physics: Any, state: Any, height: float, clearance: float) -> None:
    """Begin to watch a run that stands at its launch."""
    speed = physics.nx * state.velocity[0] + physics.ny * state.velocity[1] + physics.nz * state.velocity[2]
    pull = physics.gravity * physics.nz
    memory[0] = height
    memory[1] = height
    memory[2] = clearance
    memory[3] = height + speed * speed / (2 * pull) if pull > 0.0 else math.inf
    memory[4] = 0.0


@njit
def observe(memory: Any, physics: Any, state: Any, height: float, clearance: float) -> None:
    """Look at the state after a step: was the state before it the top of a flight?"""
    before, top = memory[0], memory[1]
    if before < top >= height and memory[2] > 0.0:
        # The vertex of the parabola through three successive heights: exact in free flight.
        apex = top - (height - before) ** 2 / (8 * (height - 2 * top + before))
        if memory[3] > 0.0:
            memory[4] = max(memory[4], apex / memory[3])
        memory[3] = apex
    memory[0] = top
    memory[1] = height
    memory[2] = clearance


def value(memory: Any) -> Any:
    """Return the largest ratio, shape as the memory's without its last axis; 0 if there was no flight."""
    return memory[..., 4]

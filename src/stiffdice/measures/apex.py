"""The largest rise of a rebound: how high the cube gets in a flight, against the flight before.

Heights are the centre's above the ground plane, m g times which is the energy of the motion that bounces: friction
cannot hide a gain here by draining the sliding. The first flight is measured against what the launch reaches, and a
flight that is still rising at the end counts with the top it is bound for.

All heights come from the parabola through successive positions, which is exact in free flight under any scheme.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice import energy
from stiffdice.compiled import njit
from stiffdice.contact import speed_of

LONG_NAME = "largest apex over the apex before it"
# Height two steps ago and one step ago, clearance two steps ago and one step ago [m], last apex [m], largest ratio
# so far, pull of gravity along the normal [m/s²], step size [s].
SLOTS = 8


@njit
def start(memory: Any, physics: Any, state: Any, height: float, clearance: float, h: float) -> None:
    """Begin to watch a run that stands at its launch."""
    speed = speed_of(physics, state)
    pull = physics.gravity * physics.nz
    memory[0] = math.nan
    memory[1] = height
    memory[2] = 0.0
    memory[3] = clearance
    memory[4] = math.inf
    if pull > 0.0:
        memory[4] = height + speed * speed / (2 * pull) + energy.elastic(physics, state) / (physics.mass * pull)
    memory[5] = 0.0
    memory[6] = pull
    memory[7] = h


@njit
def observe(memory: Any, height: float, clearance: float) -> None:
    """Look at the state after a step: was the state before it the top of a flight?"""
    before, top = memory[0], memory[1]
    if math.isnan(before):
        if clearance > 0.0 and memory[3] > 0.0 and memory[6] > 0.0:
            memory[4] = _bound_for(top, height, memory[6], memory[7])
    elif before < top >= height and memory[3] > 0.0:
        apex = top - (height - before) ** 2 / (8 * (height - 2 * top + before))
        if memory[4] > 0.0:
            memory[5] = max(memory[5], apex / memory[4])
        memory[4] = apex
    memory[0] = top
    memory[1] = height
    memory[2] = memory[3]
    memory[3] = clearance


@njit
def _bound_for(before: Any, now: Any, pull: Any, h: Any) -> Any:
    """Return the top of the flight through two successive heights under a known pull [m/s²]."""
    speed = (now - before) / h
    return (before + now) / 2 + pull * h * h / 8 + speed * speed / (2 * pull)


def value(memory: Any) -> Any:
    """Return the largest ratio, shape as the memory's without its last axis; 0 if there was no flight."""
    before, now, clearance_before, clearance, last, ratio, pull, h = np.moveaxis(memory, -1, 0)
    with np.errstate(all="ignore"):
        coming = _bound_for.py_func(before, now, pull, h) / last
    rising = (now > before) & (clearance_before > 0) & (clearance > 0) & (pull > 0) & (last > 0)
    return np.where(rising, np.maximum(ratio, coming), ratio)

"""What is watched while a run goes on, so that millions of runs can be judged without storing them.

A measure is a module with SLOTS, `start`, `observe` and `value`. To add one: its file, its
line in MEASURES, and its calls in `start` and `observe` below. Criteria (`verdict.py`) are limits on measures.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.compiled import njit
from stiffdice.contact import height_of, speed_of
from stiffdice.measures import apex, energy, touchdown
from stiffdice.state import Array, Physics

MEASURES: dict[str, Any] = {
    "touchdown_phase": touchdown,
    "energy_ratio": energy,
    "apex_ratio": apex,
}


# What all measures remember of a run: one record a member.
MEMORY = np.dtype([(name, np.float64, measure.SLOTS) for name, measure in MEASURES.items()])


def values(memory: npt.NDArray[np.void]) -> dict[str, Array]:
    """Return each measure's value, shape (member,), from an array of MEMORY records."""
    return {name: measure.value(memory[name]) for name, measure in MEASURES.items()}


@njit
def clearance_of(physics: Physics, state: Any, height: float, h: float) -> float:
    """Return the lowest node's height above the ground [m]; a lower bound where it is far from touching."""
    far = height - physics.reach
    # Farther than it can fall in the next step, so that the step in which it touches down starts exact.
    if far > 0.0 and far > 2 * h * (abs(speed_of(physics, state)) + h * physics.gravity):
        return far
    lowest = physics.reach
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        lowest = min(lowest, physics.nx * nodes[k, 0] + physics.ny * nodes[k, 1] + physics.nz * nodes[k, 2])
    return height + lowest


@njit
def start(memory: Any, physics: Physics, state: Any, h: float) -> None:
    """Begin to watch a run that stands at its launch."""
    height = height_of(physics, state)
    clearance = clearance_of(physics, state, height, h)
    touchdown.start(memory.touchdown_phase, clearance)
    energy.start(memory.energy_ratio, physics, state, height, clearance)
    apex.start(memory.apex_ratio, physics, state, height, clearance, h)


@njit
def observe(memory: Any, physics: Physics, state: Any, h: float) -> None:
    """Look at the state after a step of h [s]."""
    height = height_of(physics, state)
    clearance = clearance_of(physics, state, height, h)
    touchdown.observe(memory.touchdown_phase, clearance)
    energy.observe(memory.energy_ratio, physics, state, clearance)
    apex.observe(memory.apex_ratio, height, clearance)

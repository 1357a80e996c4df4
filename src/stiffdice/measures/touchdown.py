"""Where in a time step the cube first touches down: 0 at the step's start, 1 at its end.

This phase decides what one bounce gains or loses, so an ensemble has to be spread evenly over it.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.compiled import njit

LONG_NAME = "phase of the first touch-down within its time step"
SLOTS = 2  # clearance one step ago, phase


@njit
def start(memory: Any, clearance: float) -> None:
    """Begin to watch a run that stands at its launch."""
    memory[0] = clearance
    memory[1] = math.nan


@njit
def observe(memory: Any, clearance: float) -> None:
    """Look at the state after a step."""
    if clearance <= 0.0 and memory[0] > 0.0 and math.isnan(memory[1]):
        memory[1] = memory[0] / (memory[0] - clearance)
    memory[0] = clearance


def value(memory: Any) -> Any:
    """Return the phase, shape as the memory's without its last axis; NaN where there was no touch-down."""
    return memory[..., 1]

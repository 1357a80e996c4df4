"""The most energy the cube ever has in the air, against what it started with.

In the air the springs hold nothing, so kinetic energy + m g z is all there is, and neither contact law can add to it.
It is taken at the steps, as the paper plots it. There a rising cube reads m g h v more than a falling one at the same
height (symplectic Euler keeps E − m g h v/2 in free flight), so that at coarse steps a launch at rest or downwards
seems to gain.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffdice import energy
from stiffdice.compiled import njit

LONG_NAME = "largest airborne energy over the energy at launch"
SLOTS = 3  # energy at launch [J], what one is measured by [J], largest ratio so far


@njit
def start(memory: Any, physics: Any, state: Any, height: float, clearance: float) -> None:
    """Begin to watch a run that stands at its launch."""
    held = energy.kinetic(physics, state) + energy.elastic(physics, state)
    memory[0] = held + energy.potential(physics, state)
    # On flat ground this is the energy at launch; on a slope, where the zero of m g z means nothing, it is
    # the energy counted from the ground right below.
    memory[1] = held + physics.mass * physics.gravity * abs(physics.nz * height)
    if memory[1] <= 0.0:
        memory[1] = 1.0
    memory[2] = 1.0 if clearance > 0.0 else 0.0


@njit
def observe(memory: Any, physics: Any, state: Any, clearance: float) -> None:
    """Look at the state after a step."""
    if clearance > 0.0:
        now = energy.kinetic(physics, state) + energy.potential(physics, state)
        memory[2] = max(memory[2], 1.0 + (now - memory[0]) / memory[1])


def value(memory: Any) -> Any:
    """Return the largest ratio, shape as the memory's without its last axis; 0 if it never was in the air.

    Not-a-number where the energy at launch is past the range of doubles.
    """
    return np.where(np.isfinite(memory[..., 1]), memory[..., 2], np.nan)

"""The most energy the cube ever has in the air, against what it started with.

In the air the springs hold nothing, so kinetic energy + m g z is all there is, and neither contact law can add to it.
It is taken at the steps, as the paper plots it. There a rising cube reads m g h v more than a falling one at the same
height (symplectic Euler keeps E − m g h v/2 in free flight), so that at coarse steps a launch at rest or downwards
seems to gain.
"""

from __future__ import annotations

import math
from typing import Any

from stiffdice.compiled import njit

LONG_NAME = "largest airborne energy over the energy at launch"
SLOTS = 3  # energy at launch [J], what one is measured by [J], largest ratio so far


@njit
def start(memory: Any, physics: Any, state: Any, height: float, clearance: float, elastic: float) -> None:
    """Begin to watch a run that stands at its launch."""
    moving = _kinetic(physics, state)
    memory[0] = moving + physics.mass * physics.gravity * state.position[2] + elastic
    # On flat ground this is the energy at launch; on a slope, where the zero of m g z means nothing, it is
    # the energy counted from the ground right below.
    memory[1] = moving + physics.mass * physics.gravity * abs(physics.nz * height) + elastic
    if memory[1] <= 0.0:
        memory[1] = 1.0
    memory[2] = 1.0 if clearance > 0.0 else 0.0


@njit
def observe(memory: Any, physics: Any, state: Any, clearance: float) -> None:
    """Look at the state after a step."""
    if clearance > 0.0:
        energy = _kinetic(physics, state) + physics.mass * physics.gravity * state.position[2]
        memory[2] = max(memory[2], 1.0 + (energy - memory[0]) / memory[1])


@njit
def _kinetic(physics: Any, state: Any) -> float:
    ux, uy, uz = state.velocity[0], state.velocity[1], state.velocity[2]
    lx, ly, lz = state.angular_momentum[0], state.angular_momentum[1], state.angular_momentum[2]
    return 0.5 * physics.mass * (ux * ux + uy * uy + uz * uz) + 0.5 * (lx * lx + ly * ly + lz * lz) / physics.inertia


def value(memory: Any) -> Any:
    """Return the largest ratio, shape as the memory's without its last axis; 0 if it never was in the air.

    Where the energies are past the range of doubles the ratio is infinite.
    """
    ratio = memory[..., 2].copy()
    ratio[~(abs(memory[..., 1]) < math.inf)] = math.inf
    return ratio

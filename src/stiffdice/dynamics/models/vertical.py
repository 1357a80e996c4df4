"""`vertical`: the height alone, on level ground. The cube keeps its orientation and its place on the ground.

Where `sliding` has no tangential motion it is the same to the last bit: friction is then nothing, and the forces on the
nodes are summed in the same order.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench, normal_force, reaches
from stiffdice.dynamics.state import Physics

Vertical = namedtuple("Vertical", ())
TAG = Vertical()


@njit
def force(physics: Physics, state: Any) -> Wrench:
    """Return the normal forces and the weight [N]; friction and torque are left out."""
    z, speed = state.position[2], state.velocity[2]
    if not reaches(physics, z - physics.reach):
        return 0.0, 0.0, -physics.weight, 0.0, 0.0, 0.0
    nodes = state.node_offset
    fz = 0.0
    for k in range(nodes.shape[0]):
        fz += normal_force(physics, -(z + nodes[k, 2]), speed) - physics.node_weight
    return 0.0, 0.0, fz, 0.0, 0.0, 0.0


@njit
def kick(physics: Physics, state: Any, wrench: Wrench, h: float) -> None:
    """Advance the vertical velocity by h [s] under a force (equation 6)."""
    state.velocity[2] += h * wrench[2] / physics.mass


@njit
def drift(physics: Physics, state: Any, h: float) -> None:
    """Advance the height by h [s] at the state's velocity (equation 7)."""
    state.position[2] += h * state.velocity[2]

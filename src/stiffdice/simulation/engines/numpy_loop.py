"""The paper's loop in plain NumPy, as one would write it from the text: a step at a time, the eight nodes at once.

Symplectic Euler in the order of equations 3 to 10 and section 4.2. It agrees with our compiled scheme to round-off,
which each contact makes larger; what sets it apart is the time of some forty calls of NumPy a step.
"""

from __future__ import annotations

import math

import numpy as np

from stiffdice.dynamics.state import TOUCHING, TURNING, Array, States, physics_of
from stiffdice.simulation.engines.adapter import Engine


class NumpyLoop(Engine):
    """One run, standing where the last step left it."""

    PACKAGE = "numpy"

    def __post_init__(self) -> None:
        self._physics, self._gated = physics_of(self.scene), self.scene.ground.contact == "gated"
        self._normal = np.array(self.scene.ground.normal)
        self._weight = np.array([0.0, 0.0, -self._physics.node_weight])
        (state,) = self.launch.copy()
        self._x, self._u, self._nodes = state["position"], state["velocity"], state["node_offset"]
        self._spin, self._turning = state["angular_momentum"], state["angular_velocity"]

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations."""
        with np.errstate(all="ignore"):  # a run that blows up is a result
            for state in states:
                for _ in range(every):
                    self._step()
                state["position"], state["velocity"], state["node_offset"] = self._x, self._u, self._nodes
                state["angular_momentum"], state["angular_velocity"] = self._spin, self._turning
        return len(states) * every

    def _step(self) -> None:
        forces = self._forces()
        self._u = self._u + self.h * forces.sum(axis=0) / self._physics.mass  # equation 6
        self._x = self._x + self.h * self._u  # equation 7
        if self.model in TURNING:
            self._spin = self._spin + self.h * _cross(self._nodes, forces).sum(axis=0)  # equations 8 and 10
            self._turning = self._spin / self._physics.inertia
            self._nodes = _rotated(self._nodes, self._turning * self.h)

    def _forces(self) -> Array:
        """Return the force on each node [N], shape (8, 3): its weight, and what the ground does (section 4.2)."""
        nodes, normal, physics = self._nodes, self._normal, self._physics
        if self.model not in TOUCHING:
            return np.tile(self._weight, (len(nodes), 1))
        depth = -((self._x + nodes) @ normal)
        velocity = self._u + (_cross(self._turning, nodes) if self.model in TURNING else np.zeros_like(nodes))
        speed = velocity @ normal
        push = np.maximum(0.0, physics.stiffness * np.maximum(0.0, depth) - physics.damping * speed)
        if self._gated:
            push[depth <= 0.0] = 0.0
        if self.model == "vertical":
            return push[:, None] * normal + self._weight
        along = velocity - speed[:, None] * normal
        length = np.sqrt((along * along).sum(axis=1)) + physics.cutoff
        return push[:, None] * (normal - physics.friction * along / length[:, None]) + self._weight


def _cross(a: Array, b: Array) -> Array:
    """Return a × b along the last axis; `numpy.cross` takes several times as long."""
    ax, ay, az, bx, by, bz = *np.moveaxis(a, -1, 0), *np.moveaxis(b, -1, 0)
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)


def _rotated(nodes: Array, rotation: Array) -> Array:
    """Return nodes turned by a rotation vector [rad] (equation 9)."""
    angle = math.hypot(*rotation)
    if angle == 0.0:
        return nodes
    if not math.isfinite(angle):
        return np.full_like(nodes, np.nan)
    axis = rotation / angle
    along = (nodes @ axis)[:, None] * axis
    return np.asarray(along + math.cos(angle) * (nodes - along) + math.sin(angle) * _cross(axis, nodes))

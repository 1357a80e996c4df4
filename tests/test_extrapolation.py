"""The extrapolated linearly implicit Euler method: its order, and that it holds what friction holds."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice import dormand_prince, extrapolation, regime
from stiffdice.compiled import njit
from stiffdice.scene import from_mapping
from stiffdice.state import physics_of, rotated, start_of

OMEGA = 2 * np.sqrt(1e4)


@njit(cache=True)
def begin(physics, state, nodes, motion, bits, rate):
    regime.take(True, state[0], motion)
    small = np.zeros(2)
    regime.vanishing(physics, motion, small)
    regime.begin(True, False, physics, nodes, motion, bits, small)
    regime.derivative(True, physics, nodes, bits, motion, rate)


@njit(cache=True)
def rate_of(physics, nodes, bits, motion, rate):
    regime.derivative(True, physics, nodes, bits, motion, rate)


@njit(cache=True)
def implicit(physics, nodes, bits, start, rate, h, end):
    table, scale = np.zeros((extrapolation.COLUMNS, regime.SIZE)), np.ones(regime.SIZE)
    return extrapolation.step(True, physics, nodes, bits, start, rate, h, table, end, scale)


@njit(cache=True)
def explicit(physics, nodes, bits, start, h, stages, end):
    dormand_prince.step(True, physics, nodes, bits, start, h, stages, end)


def pressed(slip):
    """A tilted cube, one corner in the ground, that slides at `slip` [m/s] there."""
    scene = from_mapping(
        {
            "ground": {"stiffness": 1e4, "damping": 1.0, "friction": 0.5, "contact": "gated"},
            "launch": {
                "position": [0, 0, 0.82],
                "velocity": [slip, 0, -1],
                "orientation": [0.5, 0.4, 0],
                "node_velocity": "rigid",
            },
        }
    )
    motion, rate, bits = np.zeros(regime.SIZE), np.zeros(regime.SIZE), np.zeros(8, np.int8)
    state, physics = start_of(scene, "tumbling"), physics_of(scene)
    nodes = state["node_offset"][0].copy()
    begin(physics, state, nodes, motion, bits, rate)
    assert bits.any()
    return physics, nodes, bits, motion, rate


def test_both_integrators_have_their_orders():
    physics, nodes, bits, motion, rate = pressed(3.0)
    stages = np.zeros((dormand_prince.STAGES + 1, regime.SIZE))
    stages[0] = rate

    def by_explicit(h, steps):
        here = motion.copy()
        for _ in range(steps):
            rate_of(physics, nodes, bits, here, stages[0])
            end = np.zeros(regime.SIZE)
            explicit(physics, nodes, bits, here, h / steps, stages, end)
            here = end
        return here

    for integrator, order in (("explicit", 9), ("implicit", extrapolation.COLUMNS + 1)):
        errors = []
        for h in np.array([0.2, 0.1]) / OMEGA:
            end = np.zeros(regime.SIZE)
            if integrator == "explicit":
                end = by_explicit(h, 1)
            else:
                implicit(physics, nodes, bits, motion, rate, h, end)
            errors.append(np.abs(end - by_explicit(h, 16)).max())
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=1.2), integrator


def slip_of(physics, nodes, bits, motion):
    """How fast the node in the ground slides [m/s]."""
    turned = rotated(nodes, 2 * motion[10:13] / motion[9])[np.flatnonzero(bits)[0]]
    velocity = motion[3:6] + np.cross(motion[6:9] / physics.inertia, turned)
    return np.hypot(velocity[0], velocity[1])


def test_a_node_held_by_friction_stays_held_over_long_steps():
    """Over a hundredth of a bounce, where the cutoff alone would ask for steps of a millionth."""
    physics, nodes, bits, motion, rate = pressed(0.0)
    end = np.zeros(regime.SIZE)
    error = implicit(physics, nodes, bits, motion, rate, 0.02 / OMEGA, end)
    assert error < 1e-7
    assert slip_of(physics, nodes, bits, end) < 2 * physics.cutoff
    assert np.abs(end[6:9]).max() > 1e-3  # it is turned about that node

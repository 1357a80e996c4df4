"""Radau's method: its coefficients and order, and that it holds what friction holds."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice import dormand_prince, radau, regime
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
    return radau.step(True, physics, nodes, bits, start, rate, h, end, np.full(regime.SIZE, 1e-12))


@njit(cache=True)
def explicit(physics, nodes, bits, start, h, steps, end):
    here, stages = start.copy(), np.zeros((dormand_prince.STAGES + 1, regime.SIZE))
    for _ in range(steps):
        regime.derivative(True, physics, nodes, bits, here, stages[0])
        dormand_prince.step(True, physics, nodes, bits, here, h / steps, stages, end)
        here[:] = end


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


def test_stages_are_those_of_a_collocation():
    """Each integrates polynomials of order 4 exactly, the end those of order 8 (Butcher's C(5) and B(9))."""
    for power in range(1, 6):
        np.testing.assert_allclose(
            radau.COUPLING @ radau.PARTS ** (power - 1), radau.PARTS**power / power, rtol=0, atol=2e-16
        )
    for power in range(1, 10):
        assert radau.COUPLING[-1] @ radau.PARTS ** (power - 1) == pytest.approx(1 / power, abs=2e-16)


@pytest.mark.parametrize(("integrator", "order", "part"), [(explicit, 9, 0.2), (implicit, 10, 0.8)])
def test_both_integrators_have_their_orders(integrator, order, part):
    physics, nodes, bits, motion, rate = pressed(3.0)
    errors = []
    for h in np.array([part, part / 2]) / OMEGA:
        best, end = np.zeros((2, regime.SIZE))
        explicit(physics, nodes, bits, motion, h, 64, best)
        if integrator is implicit:
            implicit(physics, nodes, bits, motion, rate, h, end)
        else:
            explicit(physics, nodes, bits, motion, h, 1, end)
        errors.append(np.abs(end - best).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=1.2)


def slip_of(physics, nodes, bits, motion):
    """How fast the node in the ground slides [m/s]."""
    turned = rotated(nodes, 2 * motion[10:13] / motion[9])[np.flatnonzero(bits)[0]]
    velocity = motion[3:6] + np.cross(motion[6:9] / physics.inertia, turned)
    return np.hypot(velocity[0], velocity[1])


def test_a_node_held_by_friction_stays_held_over_long_steps():
    """Over a hundredth of a bounce and more, against steps that follow the cutoff, a millionth as long."""
    physics, nodes, bits, start, _ = pressed(0.0)
    motion, rate, best, end = np.zeros((4, regime.SIZE))
    explicit(physics, nodes, bits, start, 1e-7, 300, motion)  # until friction has taken hold
    rate_of(physics, nodes, bits, motion, rate)
    h = 0.05 / OMEGA
    explicit(physics, nodes, bits, motion, h, 750_000, best)
    error, evaluations = implicit(physics, nodes, bits, motion, rate, h, end)
    assert error < 1
    assert evaluations <= 8 * radau.STAGES
    np.testing.assert_allclose(end[:9], best[:9], rtol=0, atol=1e-12)
    np.testing.assert_allclose(end[10:], best[10:], rtol=0, atol=1e-12)  # 1 − 1e-12 is lost in so many steps
    assert slip_of(physics, nodes, bits, end) < 2 * physics.cutoff
    assert np.abs(end[6:9]).max() > 1e-3  # it is turned about that node

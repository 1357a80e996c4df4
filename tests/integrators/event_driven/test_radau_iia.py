"""Radau's method: its coefficients and order, and that it holds what friction holds."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.rotation import rotated
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.integrators.event_driven import active_set, dop853, radau_iia
from stiffdice.scene.scene import from_mapping

OMEGA = 2 * np.sqrt(1e4)


@njit(cache=True)
def begin(physics, state, nodes, motion, bits, rate):
    active_set.take(True, state[0], motion)
    small = np.zeros(2)
    active_set.vanishing(physics, motion, small)
    active_set.begin(True, False, physics, nodes, motion, bits, small)
    active_set.derivative(True, physics, nodes, bits, motion, rate)


@njit(cache=True)
def rate_of(physics, nodes, bits, motion, rate):
    active_set.derivative(True, physics, nodes, bits, motion, rate)


@njit(cache=True)
def implicit(physics, nodes, bits, start, rate, h, end):
    return radau_iia.step(True, physics, nodes, bits, start, rate, h, end, np.full(active_set.SIZE, 1e-12))


@njit(cache=True)
def explicit(physics, nodes, bits, start, h, steps, end):
    here, stages = start.copy(), np.zeros((dop853.STAGES + 1, active_set.SIZE))
    for _ in range(steps):
        active_set.derivative(True, physics, nodes, bits, here, stages[0])
        dop853.step(True, physics, nodes, bits, here, h / steps, stages, end)
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
    motion, rate, bits = np.zeros(active_set.SIZE), np.zeros(active_set.SIZE), np.zeros(8, np.int8)
    state, physics = start_of(scene, "tumbling"), physics_of(scene)
    nodes = state["node_offset"][0].copy()
    begin(physics, state, nodes, motion, bits, rate)
    assert bits.any()
    return physics, nodes, bits, motion, rate


def test_stages_are_those_of_a_collocation():
    """Each integrates polynomials of order 4 exactly, the end those of order 8 (Butcher's C(5) and B(9))."""
    for power in range(1, 6):
        np.testing.assert_allclose(
            radau_iia.COUPLING @ radau_iia.PARTS ** (power - 1), radau_iia.PARTS**power / power, rtol=0, atol=2e-16
        )
    for power in range(1, 10):
        assert radau_iia.COUPLING[-1] @ radau_iia.PARTS ** (power - 1) == pytest.approx(1 / power, abs=2e-16)


@pytest.mark.parametrize(("integrator", "order", "part"), [(explicit, 9, 0.2), (implicit, 10, 0.8)])
def test_both_integrators_have_their_orders(integrator, order, part):
    physics, nodes, bits, motion, rate = pressed(3.0)
    errors = []
    for h in np.array([part, part / 2]) / OMEGA:
        best, end = np.zeros((2, active_set.SIZE))
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
    motion, rate, best, end = np.zeros((4, active_set.SIZE))
    explicit(physics, nodes, bits, start, 1e-7, 300, motion)  # until friction has taken hold
    rate_of(physics, nodes, bits, motion, rate)
    h = 0.05 / OMEGA
    explicit(physics, nodes, bits, motion, h, 750_000, best)
    error, evaluations = implicit(physics, nodes, bits, motion, rate, h, end)
    assert error < 1
    assert evaluations <= 8 * radau_iia.STAGES
    np.testing.assert_allclose(end[:9], best[:9], rtol=0, atol=1e-12)
    np.testing.assert_allclose(end[10:], best[10:], rtol=0, atol=1e-12)  # 1 − 1e-12 is lost in so many steps
    assert slip_of(physics, nodes, bits, end) < 2 * physics.cutoff
    assert np.abs(end[6:9]).max() > 1e-3  # it is turned about that node

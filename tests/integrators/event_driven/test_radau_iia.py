"""Radau's method: its coefficients and order, the slopes it takes, and that it holds what friction holds."""

from __future__ import annotations

import numpy as np
import pytest
from tests.integrators.event_driven.test_active_set import BODIES, begun, landing, rate_of

from stiffdice.dynamics.compilation import njit
from stiffdice.integrators.event_driven import active_set, dop853, radau_iia
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.rotation import rotated
from stiffdice.scene.scene import from_mapping

OMEGA = 2 * np.sqrt(1e4)


@njit(cache=True)
def implicit(contact, start, h, end):
    return radau_iia.step(contact, start, h, end, np.full(active_set.SIZE, 1e-12))


@njit(cache=True)
def explicit(contact, start, h, steps, end):
    here, stages = start.copy(), np.zeros((dop853.STAGES + 1, active_set.SIZE))
    for _ in range(steps):
        active_set.derivative(contact, here, stages[0])
        dop853.step(contact, here, h / steps, stages, end)
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
    contact, motion = begun(scene)
    assert contact.regime["bits"].any()
    return contact, motion


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
    contact, motion = pressed(3.0)
    errors = []
    for h in np.array([part, part / 2]) / OMEGA:
        best, end = np.zeros((2, active_set.SIZE))
        explicit(contact, motion, h, 64, best)
        if integrator is implicit:
            implicit(contact, motion, h, end)
        else:
            explicit(contact, motion, h, 1, end)
        errors.append(np.abs(end - best).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=1.2)


def slip_of(contact, motion):
    """How fast the node in the ground slides [m/s]."""
    turned = rotated(contact.regime["nodes"], 2 * motion[10:13] / motion[9])[np.flatnonzero(contact.regime["bits"])[0]]
    velocity = motion[3:6] + np.cross(motion[6:9] / contact.physics.inertia, turned)
    return np.hypot(velocity[0], velocity[1])


@pytest.mark.long
def test_a_node_held_by_friction_stays_held_over_long_steps():
    """Over a hundredth of a bounce and more, against steps that follow the cutoff, a millionth as long."""
    contact, start = pressed(0.0)
    motion, best, end = np.zeros((3, active_set.SIZE))
    explicit(contact, start, 1e-7, 300, motion)  # until friction has taken hold
    h = 0.05 / OMEGA
    explicit(contact, motion, h, 750_000, best)
    error, evaluations = implicit(contact, motion, h, end)
    assert error < 1
    assert evaluations <= 8 * radau_iia.STAGES
    np.testing.assert_allclose(end[:9], best[:9], rtol=0, atol=1e-12)
    np.testing.assert_allclose(end[10:], best[10:], rtol=0, atol=1e-12)  # 1 − 1e-12 is lost in so many steps
    assert slip_of(contact, end) < 2 * contact.physics.cutoff
    assert np.abs(end[6:9]).max() > 1e-3  # it is turned about that node


@njit(cache=True)
def slopes(contact, motion, about, by_speed, by_place):
    radau_iia.slopes(contact, motion, about, by_speed, by_place)


@njit(cache=True)
def slips(contact, motion, slip):
    radau_iia.slips(contact, motion, slip)


@njit(cache=True)
def straighten(contact, motion, about, rate):
    radau_iia.straighten(contact, motion, about, rate)


@njit(cache=True)
def retouch(contact, motion, about):
    return radau_iia.retouch(contact, motion, about)


@pytest.mark.parametrize("law", CONTACT_LAWS)
@pytest.mark.parametrize("times", [1.0, 2.0])
@BODIES
def test_slopes_are_those_of_the_rates(cube, law, times):
    """Central differences: a change of place and rotation moves the nodes, at the same u and L.

    Friction is by its tangent at the motion's own slips, or at others.
    """
    for _ in range(20):
        contact, motion = begun(landing(law, cube=cube))
        by_speed, by_place, about = np.zeros((6, 6)), np.zeros((6, 6)), np.zeros((8, 3))
        slips(contact, motion, about)
        about *= times
        slopes(contact, motion, about, by_speed, by_place)

        def rate_at(change, contact=contact, motion=motion, about=about):
            rate = rate_of(contact, motion + change)
            straighten(contact, motion + change, about, rate)
            return rate[3:9]

        for column in range(6):
            d = 1e-6
            change = np.zeros(active_set.SIZE)
            change[3 + column] = d
            difference = rate_at(change) - rate_at(-change)
            np.testing.assert_allclose(by_speed[:, column], difference / (2 * d), rtol=2e-5, atol=2e-5)
            change = np.zeros(active_set.SIZE)
            if column < 3:
                change[column] = d
            else:
                change[10:13] = d / 2 * contact.regime["inverse"][column - 3]
            difference = rate_at(change) - rate_at(-change)
            np.testing.assert_allclose(by_place[:, column], difference / (2 * d), rtol=2e-5, atol=2e-3)


def test_a_tangent_of_friction_touches_its_law_and_follows_it():
    contact, motion = begun(landing("gated"))
    own, rate = np.zeros((8, 3)), rate_of(contact, motion)
    slips(contact, motion, own)
    straight = rate.copy()
    straighten(contact, motion, own, straight)
    np.testing.assert_allclose(straight, rate, rtol=1e-12)
    held = 1e-6 * own  # from slips of the order of the cutoff it takes some rounds to slips of metres a second
    for _ in range(10):
        off = retouch(contact, motion, held)
    assert off == 0.0
    np.testing.assert_array_equal(held, own)

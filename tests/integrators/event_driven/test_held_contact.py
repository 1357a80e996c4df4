"""Slopes of the forces are those of their differences, and friction's tangent follows its law."""

from __future__ import annotations

import numpy as np
import pytest
from tests.integrators.event_driven.test_active_set import begun, landing, rate_of

from stiffdice.dynamics.compilation import njit
from stiffdice.integrators.event_driven import active_set, held_contact
from stiffdice.scene.flat_landing import CONTACT_LAWS


@njit(cache=True)
def slopes(contact, motion, about, by_speed, by_place):
    held_contact.slopes(contact, motion, about, by_speed, by_place)


@njit(cache=True)
def slips(contact, motion, slip):
    held_contact.slips(contact, motion, slip)


@njit(cache=True)
def straighten(contact, motion, about, rate):
    held_contact.straighten(contact, motion, about, rate)


@njit(cache=True)
def retouch(contact, motion, about):
    return held_contact.retouch(contact, motion, about)


@pytest.mark.parametrize("law", CONTACT_LAWS)
@pytest.mark.parametrize("times", [1.0, 2.0])
def test_slopes_are_those_of_the_rates(law, times):
    """Central differences: a change of place and rotation moves the nodes, at the same u and L.

    Friction is by its tangent at the motion's own slips, or at others.
    """
    for _ in range(20):
        contact, motion = begun(landing(law))
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
                change[10 + column - 3] = d / 2 / contact.physics.inertia
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

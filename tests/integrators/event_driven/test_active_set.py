"""A regime's forces are the contact law's, and its switches change as they say."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import physics_of, start_of, turned_tensor
from stiffdice.integrators.event_driven import active_set
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import from_mapping

RANDOM = np.random.default_rng(5)


@njit(cache=True)
def law_force(model, physics, state):
    return models.force(model, physics, state[0])


@njit(cache=True)
def derivative(contact, motion, rate):
    active_set.derivative(contact, motion, rate)


@njit(cache=True)
def begin(contact, state, motion):
    active_set.take(contact.turning, state[0], motion)
    small = np.zeros(2)
    active_set.vanishing(contact.physics, motion, small)
    active_set.begin(contact, motion, small)


@njit(cache=True)
def switches(contact, motion, rate, value, slope):
    active_set.switches(contact, motion, rate, value, slope)


BOX = {"sides": [1.2, 0.9, 1.6], "mass": 1.3, "load": {"at": "corner", "mass": 0.3}}
BODIES = pytest.mark.parametrize("cube", [{}, BOX], ids=["cube", "box"])


def landing(law, stiffness=1e4, height=0.4, cube=None, **ground):
    """A cube somewhere in the ground, tilted, turning and sliding."""
    return from_mapping(
        {
            "cube": cube or {},
            "ground": {"contact": law, "stiffness": stiffness, "damping": 3.0, "friction": 0.4, **ground},
            "launch": {
                "position": [0.1, 0.2, height],
                "velocity": list(RANDOM.normal(size=3)),
                "angular_momentum": list(RANDOM.normal(size=3)),
                "orientation": list(RANDOM.normal(size=3)),
                "node_velocity": "rigid",
            },
        }
    )


def begun(scene, model="tumbling"):
    """The contact in which a scene begins, and the motion."""
    launch, motion = start_of(scene, model), np.zeros(active_set.SIZE)
    regime = np.zeros(1, [("nodes", np.float64, (8, 3)), ("bits", np.int8, 8), ("inverse", np.float64, (3, 3))])
    regime["nodes"] = launch["node_offset"]
    regime["inverse"] = np.linalg.inv(turned_tensor(scene.cube, launch["node_offset"][0]))
    dragging = scene.ground.contact == "ungated"
    contact = active_set.Contact(model == "tumbling", dragging, False, physics_of(scene), regime[0])
    begin(contact, launch, motion)
    return contact, motion


def rate_of(contact, motion):
    rate = np.zeros_like(motion)
    derivative(contact, motion, rate)
    return rate


@pytest.mark.parametrize("law", CONTACT_LAWS)
@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@BODIES
def test_the_forces_are_those_of_the_law(cube, law, model):
    touched = 0
    for height in np.linspace(-0.8, 1.2, 60):
        scene = landing(law, height=float(height), cube=cube, normal=[0.1, -0.2, 0.9])
        contact, motion = begun(scene, model)
        rate = rate_of(contact, motion)
        wrench = law_force(models.MODELS[model], physics_of(scene), start_of(scene, model))
        np.testing.assert_allclose(rate[3:6] * scene.cube.mass, wrench[:3], rtol=1e-12, atol=1e-10)
        if model == "tumbling":
            np.testing.assert_allclose(rate[6:9], wrench[3:], rtol=1e-12, atol=1e-9)
        touched += bool(contact.regime["bits"].any())
    assert touched > 20


@BODIES
def test_the_quaternion_turns_at_the_spin(cube):
    contact, motion = begun(landing("gated", cube=cube))
    spin, rate = contact.regime["inverse"] @ motion[6:9], rate_of(contact, motion)
    np.testing.assert_allclose(rate[9:13], [0, *(spin / 2)], atol=1e-15)


@pytest.mark.parametrize("law", CONTACT_LAWS)
@BODIES
def test_switches_change_as_their_slopes_say(cube, law):
    for _ in range(20):
        contact, motion = begun(landing(law, cube=cube))
        rate = rate_of(contact, motion)
        values, slope, other = np.zeros((2, 16)), np.zeros(16), np.zeros(16)
        d = 1e-7
        for end, sign in enumerate((-1, 1)):
            moved = motion + sign * d * rate
            switches(contact, moved, rate_of(contact, moved), values[end], other)
        switches(contact, motion, rate, other, slope)
        np.testing.assert_allclose((values[1] - values[0]) / (2 * d), slope, rtol=1e-6, atol=1e-5)
        assert (other >= 0).all()

"""A ground of what is known of a bounce: the numbers that it is said to have are those of a run on it."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from stiffdice.advice import contact_design
from stiffdice.errors import InputError
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

CUBE = {"mass": 0.004, "side": 0.016, "speed": 2.0, "gravity": 9.8}


def designed(law="gated", **given):
    return contact_design.designed(given, **CUBE, law=law)


def numbers(contact):
    return {name: value for name, value in contact.as_data().items() if name != "contact"}


@pytest.mark.parametrize("law", ["gated", "ungated"])
@pytest.mark.parametrize("restitution", [0.05, 0.3, 0.7, 0.99, 1.0])
def test_a_contact_is_the_same_whatever_it_is_told_by(law, restitution):
    told = designed(law, restitution=restitution, stiffness=2e5)
    for name in ("contact_time", "depth"):
        again = designed(law, restitution=restitution, **{name: getattr(told, name)})
        assert numbers(again) == pytest.approx(numbers(told), rel=1e-9)
    back = designed(law, stiffness=2e5, damping=told.scene.ground.damping)
    assert numbers(back) == pytest.approx(numbers(told), rel=1e-9)


@pytest.mark.parametrize("restitution", [0.05, 0.1, 0.3, 0.5, 0.8, 0.95, 0.99])
def test_a_run_bounces_as_was_asked(restitution):
    """Restitution, contact time, depth and force of a flat bounce without weight, by the scheme `event`."""
    contact = designed(restitution=restitution, contact_time=2e-4)
    height = 1e-4
    scene = dataclasses.replace(contact.scene, gravity=0.0, duration=4e-4)
    launch = dataclasses.replace(scene.launch, position=(0.0, 0.0, scene.cube.side / 2 + height))
    scene = dataclasses.replace(scene, launch=launch)
    steps = 40_000
    run = simulate(scene, model="tumbling", scheme="event", steps=steps, every=1, tolerance=1e-12)
    low = run.trajectory.state["position"][:, 2] - scene.cube.side / 2
    speed = run.trajectory.state["velocity"][:, 2]
    force = scene.cube.mass * np.diff(speed) * steps / scene.duration
    assert speed[-1] / contact.speed == pytest.approx(restitution, abs=1e-3)
    assert -low.min() == pytest.approx(contact.depth, rel=1e-3)
    assert (np.abs(force) > 1e-6 * force.max()).sum() / steps * scene.duration == pytest.approx(2e-4, rel=1e-3)
    assert force.max() == pytest.approx(contact.peak_force, rel=2e-3)


def test_the_ground_that_is_printed_is_a_scenes():
    contact = designed(restitution=0.5, depth=1e-4)
    scene = from_mapping({"cube": {"side": 0.016, "mass": 0.004}, "ground": contact.ground()})
    assert scene.ground.stiffness == pytest.approx(contact.scene.ground.stiffness, rel=1e-8)
    same = from_mapping(
        {
            "cube": {"side": 0.016, "mass": 0.004},
            "ground": {"restitution": 0.5, "contact_time": contact.contact_time},
        }
    )
    assert same.ground.stiffness == pytest.approx(scene.ground.stiffness, rel=1e-8)
    assert same.ground.damping == pytest.approx(scene.ground.damping, rel=1e-8)


def test_weight_takes_from_a_bounce_and_may_take_all_of_it():
    hard, soft = designed(restitution=0.2, stiffness=2e5), designed(restitution=0.05, stiffness=200.0)
    assert hard.restitution_with_weight == pytest.approx(0.2, abs=1e-3)
    assert hard.restitution_with_weight < 0.2
    assert soft.restitution_with_weight == 0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({}, "none given: needed is one of --restitution or --damping"),
        ({"restitution": 0.5}, "none given: needed is one of --stiffness or --contact-time or --depth"),
        ({"restitution": 0.5, "damping": 1.0, "stiffness": 1.0}, "--restitution and --damping given"),
        ({"damping": 1.0, "depth": 1e-4}, "--damping: allowed is beside --stiffness only"),
        ({"restitution": 1.5, "depth": 1e-4}, "restitution = 1.5: allowed is a number above 0, up to 1"),
        ({"restitution": 0.0, "stiffness": 1.0}, "restitution = 0: allowed is a number above 0, up to 1"),
        ({"restitution": 0.5, "depth": -1.0}, "depth = -1.0: allowed is a finite number > 0"),
        ({"restitution": 0.5, "depth": 1e-300}, "stiffness"),
        ({"damping": -1.0, "stiffness": 1.0}, "damping"),
    ],
)
def test_what_is_no_contact_is_refused(given, told):
    with pytest.raises(InputError, match=told):
        designed(**given)


def test_an_undamped_ground_keeps_all_speed():
    contact = designed(stiffness=2e5, damping=0.0)
    assert contact.restitution == contact.restitution_with_weight == 1
    assert contact.contact_time == pytest.approx(math.pi / contact.omega)

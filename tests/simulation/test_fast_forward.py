from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from stiffdice.integrators import symplectic_euler
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.outcome import BLOW_UP, Verdict
from stiffdice.simulation.run import simulate


def scene_of(stiffness=1e4, damping=0.2, contact="gated", z=3.0, up=5.0, along=0.0, friction=0.0, **keys):
    ground = {"stiffness": stiffness, "damping": damping, "friction": friction, "contact": contact}
    launch = {"position": [0, 0, z], "velocity": [along, 0, up]}
    return from_mapping({"ground": ground | keys.pop("ground", {}), "launch": launch, "duration": 4.0} | keys)


def both(scene, steps, **options):
    """The same run in closed form and step by step."""
    return (simulate(scene, model="sliding", steps=steps, every=every, **options).__dict__ for every in (None, steps))


@pytest.mark.parametrize("steps", [9, 1000, 30_000])
@pytest.mark.parametrize(
    ("square", "rate"), [(0, 0), (0, 1e-9), (0, 0.7), (0, 2e3), (4e4, 0), (4e4, 3), (1e-6, 2), (100, 1e3), (1e-9, 1e-9)]
)
@pytest.mark.long
def test_many_steps_at_once_are_as_many_steps(square, rate, steps):
    place, speed, constant, h = 0.3, -1.7, -9.8, 1e-4
    moved, end = symplectic_euler.swing(place, speed, h, steps, square, rate, constant)
    there, now = np.longdouble(place), np.longdouble(speed)
    for _ in range(steps):
        now += h * (constant - square * there - rate * now)
        there += h * now
    assert moved == pytest.approx(float(there - place), rel=1e-9, abs=1e-12)
    assert end == pytest.approx(float(now), rel=1e-9, abs=1e-12)


@pytest.mark.long
def test_roots_too_close_to_tell_apart_are_left_to_stepping():
    h = 1e-3
    assert np.isnan(symplectic_euler.swing(0.1, 0.0, h, 100, 1.0 / h**2 / 100, 2 * 0.1 / h - 0.01 / h, 0.0)[0])


@pytest.mark.parametrize("contact", ["ungated", "gated"])
@pytest.mark.parametrize(
    "keys",
    [
        {"stiffness": 100},
        {"stiffness": 1e4, "along": 2.0},
        {"stiffness": 1, "damping": 3},
        {"stiffness": 0, "damping": 1},
        {"stiffness": 0, "damping": 0},
        {"stiffness": 1e4, "damping": 2e3},
        {"stiffness": 1e3, "damping": 10, "friction": 0.5},
        {"stiffness": 50, "z": -2.0, "up": 0.0},
        {"stiffness": 1e4, "z": 0.5, "up": 0.0},
        {"stiffness": 1e3, "cube": {"radius": 0.01, "geometry": "exact", "mass": 0.3}},
    ],
    ids=str,
)
def test_phases_at_once_are_the_steps_of_the_run(contact, keys):
    steps = 200_000
    once, stepped = both(scene_of(contact=contact, **keys), steps)
    assert once["steps_computed"][0] < steps / 5
    assert stepped["steps_computed"][0] == steps
    assert once["verdict"][0] == stepped["verdict"][0]
    for name in ("energy_ratio", "apex_ratio"):
        assert once["measures"][name][0] == pytest.approx(stepped["measures"][name][0], rel=1e-6)
    for part in ("position", "velocity"):
        np.testing.assert_allclose(once["end"][part], stepped["end"][part], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize(
    "keys",
    [{"along": 2.0, "friction": 0.3, "contact": "ungated"}, {"ground": {"normal": [1, 0, 3]}, "contact": "ungated"}],
    ids=["sliding with friction", "on a slope"],
)
def test_what_is_not_known_is_stepped(keys):
    once, _ = both(scene_of(**keys, stiffness=100), 20_000)
    assert once["steps_computed"][0] > 8000


def test_a_tilted_cube_is_stepped_in_contact():
    scene = scene_of(stiffness=100)
    tilted = dataclasses.replace(scene, launch=dataclasses.replace(scene.launch, orientation=(0.3, 0.1, 0)))
    once, stepped = both(tilted, 20_000)
    assert once["steps_computed"][0] > 1000
    np.testing.assert_allclose(once["end"]["position"], stepped["end"]["position"], rtol=1e-9)


def test_a_far_away_cube_is_stepped_where_a_step_loses_part_of_its_way():
    once, _ = both(scene_of(contact="gated", z=1e12), 10_000)
    assert once["steps_computed"][0] == 10_000


STOP = {"energy": BLOW_UP - 1}


@pytest.mark.parametrize("contact", ["ungated", "gated"])
@pytest.mark.parametrize(
    "keys", [{"damping": 20}, {"damping": 3e3}, {"damping": 20, "friction": 0.5, "along": 1.0}], ids=str
)
def test_a_cube_at_rest_is_held_and_never_leaves(contact, keys):
    """The run ends at once; stepped on, with what it never measured before its rest, it would find nothing else."""
    once, stepped = both(scene_of(contact=contact, z=0.6, up=0.0, **keys), 200_000, stop=STOP)
    assert once["steps_done"][0] < 200_000
    assert stepped["steps_done"][0] == 200_000
    assert once["verdict"][0] == stepped["verdict"][0] == Verdict.PASSED
    for name in ("energy_ratio", "apex_ratio"):
        assert once["measures"][name][0] == pytest.approx(stepped["measures"][name][0], rel=1e-6)


@pytest.mark.parametrize("part", [0.5, 0.97, 1.03])
def test_a_cube_is_held_if_it_swings_by_less_than_its_sag(part):
    """Undamped: below, it never leaves the ground; above, it does, and both are seen step by step."""
    scene = scene_of(stiffness=100, damping=0)
    sag = 9.8 / 400
    rest = scene.cube.side / 2 - sag
    launch = dataclasses.replace(scene.launch, position=(0.0, 0.0, rest - part * sag), velocity=(0.0, 0.0, 0.0))
    once, stepped = both(dataclasses.replace(scene, launch=launch), 50_000, stop=STOP)
    assert (once["steps_done"][0] == 1) == (part < 1)
    assert (stepped["measures"]["apex_ratio"][0] == 0) == (part < 1)


def test_a_cube_that_hangs_in_its_own_drag_is_held():
    once, stepped = both(scene_of(damping=1e3, contact="ungated"), 100_000, stop=STOP)
    assert once["steps_done"][0] < 60_000
    assert once["verdict"][0] == stepped["verdict"][0] == Verdict.PASSED
    assert stepped["end"]["position"][0, 2] > 4


@pytest.mark.parametrize("stiffness", [0.0, 1.0])
def test_no_ground_holds_a_cube_that_sinks(stiffness):
    run = simulate(scene_of(stiffness=stiffness, z=0.0, up=0.0), model="sliding", steps=10_000, stop=STOP)
    assert run.steps_done[0] == 10_000
    assert run.verdict[0] == Verdict.SANK

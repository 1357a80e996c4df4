from __future__ import annotations

import pytest

from stiffdice.report.run_page import doubts, lines
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

DIE = {
    "cube": {"radius": 0.012, "mass": 0.005, "geometry": "exact"},
    "ground": {"stiffness": 2.0e3, "damping": 0.02, "friction": 0.3, "contact": "gated"},
    "launch": {"position": [0, 0, 0.3], "velocity": [0.5, 0, 0], "angular_momentum": [1e-5, 2e-5, 0]},
    "duration": 1.0,
}


def changed(section, **values):
    return from_mapping(DIE | {section: DIE[section] | values})


def test_a_sensible_run_leaves_no_doubt():
    assert doubts(from_mapping(DIE), "tumbling", "symplectic_euler", 100_000) == []
    assert doubts(from_mapping({}), "tumbling", "symplectic_euler", 10_000) == []


@pytest.mark.parametrize(
    ("section", "values", "steps", "said"),
    [
        ("launch", {"angular_momentum": {"seed": 7}}, 10_000, "turns the cube by 628 rad in a step"),
        ("launch", {"position": [0, 0, -5]}, 10_000, "starts in the ground, its lowest node 5.01 m deep"),
        ("launch", {"position": [0, 0, 0.005]}, 10_000, "starts in the ground, its lowest node 0.00193 m deep"),
        ("cube", {"geometry": "printed"}, 10_000, "puts the corners 0.000176 m from the centre"),
        ("cube", {"radius": 12}, 10_000, "density of 1.9e-06 kg/m³"),
        ("ground", {"stiffness": 1e6}, 10_000, "symplectic_euler needs 18,000 or more"),
    ],
)
def test_what_speaks_against_a_run_is_said_before_it(section, values, steps, said):
    found = doubts(changed(section, **values), "tumbling", "symplectic_euler", steps)
    assert any(said in line for line in found), found


def test_a_cube_at_rest_is_no_doubt():
    side = from_mapping(DIE).cube.side
    lying = changed("launch", position=[0, 0, side / 2 - 0.005 * 9.8 / 4 / 2e3], velocity=[0, 0, 0])
    assert doubts(lying, "sliding", "symplectic_euler", 100_000) == []


def test_a_scheme_that_takes_its_own_steps_is_not_doubted_for_them():
    spinning = changed("launch", angular_momentum={"seed": 7})
    assert doubts(spinning, "tumbling", "event", 100) == []


def told(scene=None, **options):
    run = simulate(from_mapping(DIE) if scene is None else scene, every=100, **({"steps": 10_000} | options))
    return "\n".join(lines(run, "out.h5", "stiffdice advise my.yaml --error 1%"))


def test_a_pass_says_what_was_looked_at_and_that_accuracy_was_not():
    text = told()
    assert text.startswith("out.h5: passed")
    assert "energy    1, allowed 1.05" in text
    assert "ωh = 0.155, linear limit 1.98 (symplectic_euler; rocking, ω² = 6 S/m)" in text
    assert "accuracy  was not looked at; this does: stiffdice advise my.yaml --error 1%" in text
    assert "apex" not in text  # means nothing for a cube that tumbles


def test_an_apex_without_a_rebound_is_not_shown():
    assert "no rebound" in told(changed("launch", position=[0, 0, 10]), model="sliding")
    assert "no rebound" not in told(model="sliding", steps=100_000)


def test_a_scheme_without_a_limit_says_so():
    assert "event has no limit of stability" in told(scheme="event", steps=600)
    assert "implicit_euler is stable at any" in told(scheme="implicit_euler")

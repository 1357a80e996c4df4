from __future__ import annotations

import math

import numpy as np
import pytest
from tests.mjcf_files import LINEAR, ball, body, scene, written

pytest.importorskip("mujoco")
from stiffdice.simulation.engines.mjcf import meeting as meetings
from stiffdice.simulation.engines.mjcf.drop import drops
from stiffdice.simulation.engines.mjcf.model import compiled, silence

PHASES = np.array([0.1, 0.45, 0.8])
BALL, BOX = 'type="sphere" size="0.1"', 'type="box" size="0.1 0.1 0.1" friction="0.4"'


def both(text, tmp_path, times=1.0, speed=2.0):
    """Return landings of the first meeting, predicted and measured, at so many of the model's time steps."""
    model = compiled(written(text, tmp_path))
    one = meetings.meetings_of(model)[-1]
    alone = meetings.alone(model, one)
    touch = meetings.touch_of(alone, one)
    law = touch.law.at(touch.law.timestep * times)
    predicted = [law.bounce(speed, float(phase) * speed * law.timestep) for phase in PHASES]
    return np.array(predicted), np.array(drops(alone, one, touch, law, speed, PHASES))


@pytest.mark.parametrize(
    "text",
    [
        ball(),
        ball('solref="-20000 -20" solimp="0.5 0.95 0.01 0.3 2"'),
        ball('solref="0.01 0.3"'),
        ball(LINEAR, 'timestep="0.001" integrator="implicitfast"'),
        ball(LINEAR, 'timestep="0.001" gravity="0 0 0"'),
        scene(body(BOX)),
        scene(body(BOX, name="a") + body(BALL, name="b", place='pos="1 0 1"'), option='timestep="0.001"'),
    ],
)
@pytest.mark.parametrize("times", [0.5, 4.0])
def test_a_landing_straight_down_is_the_predicted_one_step_by_step(text, times, tmp_path):
    """Where several contacts share the load, where solimp has a width, and where steps are too long, too."""
    predicted, measured = both(text, tmp_path, times)
    assert measured[:, 0] == pytest.approx(predicted[:, 0], abs=1e-9)
    assert measured[:, 2] == pytest.approx(predicted[:, 1], rel=1e-9)


@pytest.mark.parametrize("times", [0.5, 4.0])
def test_rk4_is_predicted_as_well(times, tmp_path):
    predicted, measured = both(ball(LINEAR, 'timestep="0.001" integrator="RK4"'), tmp_path, times)
    assert measured[:, 0] == pytest.approx(predicted[:, 0], abs=1e-3)


def test_the_energy_of_a_ball_is_the_square_of_its_restitution(tmp_path):
    _, measured = both(ball(LINEAR, 'timestep="0.001" gravity="0 0 0"'), tmp_path)
    assert measured[:, 1] == pytest.approx(measured[:, 0] ** 2, rel=1e-9)


def test_a_body_that_is_slow_to_leave_has_no_restitution(tmp_path):
    _, measured = both(ball('solref="0.02 1.5"'), tmp_path, speed=0.2)
    assert measured[:, 0] == pytest.approx(np.zeros(3))
    assert measured[:, 1].max() < 0.01


def test_a_run_that_blows_up_is_told_and_leaves_no_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with silence():
        _, measured = both(ball('solref="-1e300 -20"'), tmp_path)
    assert math.isinf(measured[:, 0].max())
    assert [path.name for path in tmp_path.iterdir()] == ["model.xml"]

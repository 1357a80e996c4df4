"""What docs/explanation/tosses.md says of the real tosses, on all of them that the fit has not seen."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from tests import toss_files

from stiffdice.experiments.tosses import chaos, fit
from stiffdice.experiments.tosses.launches import launches_of, measured
from stiffdice.experiments.tosses.replay import Physics, faces, scene_of, step_of

ROOT = toss_files.REAL.parents[2]
BOARD = Physics(0.125, 0.18, 0.005)


@pytest.fixture(scope="module")
def halves():
    tosses, _ = measured(str(toss_files.REAL), toss_files.SCENE.gravity)
    return [tosses.chosen(part) for part in fit.split(len(tosses.counts), 18)]


def launched(tosses, source="sample"):
    return launches_of(tosses, source, toss_files.SCENE.gravity)


@pytest.mark.broad
def test_the_studys_board_is_the_one_that_is_fitted(halves):
    mine, _ = halves
    found = fit.fit(mine, launched(mine), toss_files.SCENE, Physics(), rounds=3)
    given = yaml.safe_load((ROOT / "config" / "tosses.yaml").read_text())["experiments"]["steps"]["options"]
    assert found.restitution_interval[0] <= given["restitution"] <= found.restitution_interval[1]
    assert found.friction_interval[0] <= given["friction"] <= found.friction_interval[1]


@pytest.mark.long
def test_six_of_seven_faces_are_right_and_a_seventh_of_a_side_is_between_the_paths(halves):
    _, rest = halves
    told = fit.told(rest, launched(rest), toss_files.SCENE, BOARD)
    kept = np.mean(rest.faces[rest.first] == rest.faces[rest.last])
    assert told.path.mean() == pytest.approx(0.141, abs=0.003)
    assert np.degrees(told.orientation.mean()) == pytest.approx(15.5, abs=0.5)
    assert told.right.mean() > 0.84 > 2 * kept


@pytest.mark.long
def test_steps_change_no_more_than_a_toss_in_a_hundred_up_to_a_third_of_a_radian(halves):
    """From ωh = 0.02 to 0.3 against reality, and no face at all between the two shortest steps."""
    _, rest = halves
    scene, launches = scene_of(rest, BOARD, toss_files.SCENE), launched(rest)
    ends = {omega_h: faces(launches, scene, step_of(scene, omega_h)) for omega_h in (0.02, 0.04, 0.3, 0.9)}
    assert np.mean(ends[0.02] != ends[0.04]) < 0.005
    assert np.mean(ends[0.02] != ends[0.3]) < 0.015
    assert np.mean(ends[0.02] != ends[0.9]) > 0.3


@pytest.mark.long
def test_chaos_forbids_little_from_the_first_sample_and_nothing_from_the_flight():
    found = chaos.measure(toss_files.SCENE, sizes=(1.0,), draws=40, data=str(toss_files.REAL))
    sample, flight = found.changed.mean("toss").values[:, 0]
    assert sample == pytest.approx(0.057, abs=0.012)
    assert flight < 0.006
    assert (found.unperturbed.mean("toss") > 0.84).all()

from __future__ import annotations

import json

import pytest
from tests.mjcf_files import LINEAR, ball, body, scene, written

pytest.importorskip("mujoco")
from stiffdice.advice.model_check import LADDER, check
from stiffdice.errors import InputError
from stiffdice.report.model_page import as_json, as_text

pytestmark = pytest.mark.long

BALL, BOX = 'name="ball" type="sphere" size="0.1"', 'type="box" size="0.1 0.1 0.1"'


def kinds(text, tmp_path):
    return [[verdict.kind for verdict in contact.verdicts] for contact in check(written(text, tmp_path)).contacts]


@pytest.mark.parametrize(
    ("shape", "solref"),
    [
        (BALL, "-20000 -20"),
        (BALL, "0.02 0.1"),
        (BALL, "0.01 1"),
        ('type="ellipsoid" size="0.2 0.1 0.1"', "-2000 -40"),
        ('type="ellipsoid" size="0.2 0.1 0.1"', "0.01 0.6"),
    ],
)
def test_where_the_law_is_linear_prediction_and_measurement_agree(shape, solref, tmp_path):
    """Within 0.02 is promised, at every time step of the ladder."""
    contact = f'solref="{solref}" solimp="0.9 0.9 0.001 0.5 2"'
    (found,) = check(written(scene(body(shape, contact), contact), tmp_path)).contacts
    assert (found.touch.why, len(found.rungs)) == ((), len(LADDER))
    for rung in found.rungs:
        assert rung.measured == pytest.approx(rung.predicted, abs=0.02)


def test_a_ball_whose_numbers_are_fine(tmp_path):
    found = check(written(ball(), tmp_path))
    assert found.passed
    assert found.contacts[0].own.timestep == 0.001
    assert "verdict    fine" in as_text(found)


@pytest.mark.parametrize(
    ("text", "kind", "words"),
    [
        (ball('solref="-1e7 -20"'), "gains_energy", "will gain energy: a landing leaves"),
        (ball('solref="-2000 -30"', 'timestep="0.002"'), "soft", "will be soft: sinks in"),
        (ball('solref="0.01 1.5"', 'timestep="0.002"'), "over_damped", "is over-damped: ζ = 1.5, e ="),
        (ball(option='timestep="0.008"'), "under_resolved", "is under-resolved: e from"),
    ],
)
def test_what_is_wrong_is_said(text, kind, words, tmp_path):
    found = check(written(text, tmp_path))
    assert not found.passed
    assert kind in [verdict.kind for verdict in found.contacts[0].verdicts]
    assert f"verdict    {words}" in as_text(found)


def test_what_refsafe_makes_of_a_timeconst_is_said(tmp_path):
    text = as_text(check(written(ball('solref="0.0001 0.3"'), tmp_path)))
    assert "refsafe    timeconst 0.0001 s counts as 0.002 s, two time steps" in text


def test_bodies_alike_are_measured_once(tmp_path):
    bodies = "".join(body('type="sphere" size="0.1"', name=name) for name in "abc")
    found = check(written(scene(bodies), tmp_path)).contacts
    assert [(one.meeting.names, tuple(meeting.names for meeting, _ in one.alike)) for one in found] == [
        (("a", "floor"), (("b", "floor"), ("c", "floor"))),
        (("a", "b"), (("a", "c"), ("b", "c"))),
    ]


def test_a_model_whose_contacts_are_off_is_refused(tmp_path):
    text = ball().replace("</mujoco>", '<option><flag contact="disable"/></option></mujoco>')
    with pytest.raises(InputError, match=r"no contact comes about where a body falls \(it on floor\)"):
        check(written(text, tmp_path))


@pytest.mark.parametrize(
    "text",
    [
        "<mujoco/>",
        scene(body(BALL).replace("<freejoint/>", "")),
        scene(body(BALL, 'contype="2" conaffinity="2"'), LINEAR),
    ],
)
def test_a_model_in_which_nothing_meets_is_refused(text, tmp_path):
    with pytest.raises(InputError, match="no free body that may touch a plane or another body: nothing to check"):
        check(written(text, tmp_path))


def test_for_programs_every_number_has_its_unit_and_what_is_infinite_is_null(tmp_path):
    content = json.loads(as_json(check(written(ball('solref="-1e300 -20"'), tmp_path))))
    (contact,) = content["contacts"]
    assert (content["timestep_s"], content["passed"], contact["bodies"]) == (0.001, False, ["it", "floor"])
    assert contact["ladder"][3]["energy_ratio"] is None
    assert contact["ladder"][3]["measured"]["high"] is None


def test_other_bodies_are_not_in_the_way(tmp_path):
    """A ball below a shelf lands as it does without."""
    shelf = '<body pos="0 0 0.3"><geom name="shelf" type="box" size="1 1 0.01"/></body>'
    text = scene(body('type="sphere" size="0.1"', place='pos="0 0 0.1"') + shelf)
    found = check(written(text, tmp_path)).contacts
    alone = check(written(ball(), tmp_path)).contacts
    assert found[0].own.measured == pytest.approx(alone[0].own.measured)

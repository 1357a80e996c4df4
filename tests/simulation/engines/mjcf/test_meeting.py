from __future__ import annotations

import numpy as np
import pytest
from tests.mjcf_files import LINEAR, ball, body, scene, written

pytest.importorskip("mujoco")
import mujoco

from stiffdice.simulation.engines.mjcf import meeting as meetings
from stiffdice.simulation.engines.mjcf.model import compiled

BOX = 'type="box" size="0.1 0.1 0.1"'
WIDE = 'solref="0.03 0.4" solimp="0.3 0.9 0.005 0.4 3"'


def touches(text, tmp_path):
    model = compiled(written(text, tmp_path))
    found = meetings.meetings_of(model)
    return [(one, meetings.touch_of(meetings.alone(model, one), one)) for one in found]


@pytest.mark.parametrize("cone", ["pyramidal", "elliptic"])
@pytest.mark.parametrize("friction", ['condim="1"', 'condim="3" friction="0.3"', 'condim="6" friction="0.8 0.1 0.01"'])
@pytest.mark.parametrize(("shape", "contact"), [('type="sphere" size="0.1"', LINEAR), (BOX, WIDE)])
def test_the_law_has_the_numbers_that_mujoco_uses(cone, friction, shape, contact, tmp_path):
    """K, b, d and R of a contact 2 mm deep, and the acceleration that all of it makes of one that opens at 0.2 m/s."""
    contact = f"{contact} {friction}"
    text = scene(body(shape, contact), contact, f'timestep="0.001" cone="{cone}" impratio="2"')
    ((one, touch),) = touches(text, tmp_path)
    model = meetings.alone(compiled(tmp_path / "model.xml"), one)
    data = mujoco.MjData(model)
    data.qpos = meetings.raised(model, one, touch.pose, -0.002)
    data.qvel[2] = -0.2
    mujoco.mj_forward(model, data)
    stiffness, damping = touch.law.reference
    assert data.efc_KBIP[0, :3] == pytest.approx([stiffness, damping, touch.law.impedance(0.002)])
    rate = touch.law.step(-0.002, -0.2)[1]
    assert (rate + 0.2) / 0.001 == pytest.approx(data.qacc[2], rel=1e-6)


def test_touching_is_where_contact_begins_to_round_off(tmp_path):
    ((one, touch),) = touches(scene(body(BOX), f'{LINEAR} margin="0.01"'), tmp_path)
    assert touch.pose[2] == pytest.approx(0.1 + 0.01, abs=1e-12)
    assert one.size == pytest.approx(0.2)
    assert (touch.contacts, touch.law.mass) == (4, pytest.approx(8.0))


def test_bodies_meet_floors_and_each_other_as_the_model_lets_them(tmp_path):
    ball = 'type="sphere" size="0.1"'
    bodies = body(ball, 'contype="1" conaffinity="1"', "a") + body(ball, 'contype="1" conaffinity="1"', "b")
    bodies += body(ball, 'contype="2" conaffinity="1"', "c") + body(ball, 'contype="0" conaffinity="0"', "d")
    more = '<contact><exclude body1="a" body2="b"/></contact>'
    found = [one.names for one, _ in touches(scene(bodies, 'contype="1" conaffinity="1"', more=more), tmp_path)]
    assert found == [("a", "floor"), ("b", "floor"), ("c", "floor"), ("a", "c"), ("b", "c")]


def test_an_explicit_pair_meets_whatever_the_filters_say(tmp_path):
    none = 'contype="0" conaffinity="0"'
    more = '<contact><pair geom1="floor" geom2="ball" solref="-5000 -3"/></contact>'
    ((_, touch),) = touches(scene(body('name="ball" type="sphere" size="0.1"', none), none, more=more), tmp_path)
    assert (touch.law.solref, touch.pairs) == ((-5000.0, -3.0), (0,))


def test_what_makes_a_contact_nonlinear_is_said(tmp_path):
    def why(text):
        return [reason for _, touch in touches(text, tmp_path) for reason in touch.why]

    assert why(ball()) == []
    assert why(ball(WIDE)) == ["solimp: impedance 0.3 to 0.9 over 0.005 m"]
    assert why(scene(body(BOX))) == ["4 contacts at once"]
    two = scene(body(BOX, "", place='pos="0 0 1" euler="45 0 0"'), LINEAR.replace("-20", "-30"), 'cone="elliptic"')
    assert why(two)[::2] == ["2 contacts at once", "elliptic cones: friction acts on the normal force"]
    tilted = scene(body('type="capsule" size="0.1 0.3"', place='pos="0 0 1" euler="30 0 0"'), option='cone="elliptic"')
    assert why(tilted) == [
        "elliptic cones: friction acts on the normal force",
        "not below the centre of mass: the body turns",
    ]
    assert why(ball(option='density="1.2" integrator="RK4"')) == ["a medium: density or viscosity"]


def test_a_tie_to_another_body_is_left_out_and_said(tmp_path):
    sites = '<site name="here" pos="0 0 3"/>' + body(BOX).replace("<geom", '<site name="there"/><geom')
    spring = '<tendon><spatial stiffness="1e4"><site site="here"/><site site="there"/></spatial></tendon>'
    weld = '<equality><connect body1="it" anchor="0 0 0"/></equality>'
    for more in (spring, weld):
        ((_, touch),) = touches(scene(sites, more=more), tmp_path)
        assert "ties to other bodies are left out" in touch.why
        assert touch.law.pull == pytest.approx(9.81)


def test_joints_start_within_their_limits(tmp_path):
    leg = '<body><joint axis="0 1 0" range="30 60"/><geom type="capsule" size="0.02" fromto="0 0 0 0.5 0 0"/></body>'
    text = scene(body(BOX).replace("</body>", f"{leg}</body>"))
    ((_, touch),) = touches(text, tmp_path)
    assert np.degrees(touch.pose[7]) == pytest.approx(30.0)


def test_the_inverse_mass_of_a_contact_off_centre_has_the_lever_in_it(tmp_path):
    """1/m + (r × n)·I⁻¹·(r × n), of a rod that stands on its end at 45°."""
    rod = body('type="capsule" size="0.1 0.3"', place='pos="0 0 1" euler="45 0 0"')
    ((_, touch),) = touches(scene(rod), tmp_path)
    model = compiled(tmp_path / "model.xml")
    arm = 0.3 * np.sin(np.pi / 4)
    assert 1 / touch.law.mass == pytest.approx(1 / model.body_mass[1] + arm**2 / model.body_inertia[1, 0], rel=1e-5)

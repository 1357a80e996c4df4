from __future__ import annotations

import shutil
import subprocess

import pytest
from tests.mjcf_files import LINEAR, ball, body, scene, written

pytest.importorskip("mujoco")
from stiffdice.advice.model_check import check
from stiffdice.advice.model_patch import Change, advised, patch
from stiffdice.simulation.engines.mjcf.model import load

pytestmark = pytest.mark.long

BALL = 'name="ball" type="sphere" size="0.1"'
SOFT = 'solref="-2000 -30" solimp="0.9 0.9 0.001 0.5 2"'
PAIR = '<contact><pair geom1="floor" geom2="ball" solref="0.01 1.2"/></contact>'
OPTION = 'timestep="0.002"'
TWO_ON_A_LINE = body('type="sphere" size="0.1"', SOFT, "a") + body('type="sphere" size="0.2"', LINEAR, "b")


def patched(text, folder, monkeypatch):
    """Write a model, apply its patch by the program patch, and return what changed and whether it passes."""
    if shutil.which("patch") is None:
        pytest.skip("no program patch")
    monkeypatch.chdir(folder)
    path = written(text, folder).relative_to(folder)
    found = check(path)
    assert not found.passed
    told, beyond = advised(found)
    assert beyond == ()
    subprocess.run(["patch", "-p0"], input=told, text=True, check=True, capture_output=True)
    lines = [line for line in told.splitlines() if line[0] in "+-" and line[:3] not in ("+++", "---")]
    return lines, check(path).passed


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        (ball('solref="-3000000 -20"'), 2),  # a shorter step
        (ball('solref="-1e9 -900"'), 4),  # softer contacts: floor and ball
        (ball(SOFT, OPTION), 4),
        (ball('solref="0.01 1.2"', OPTION), 4),
        (scene(body(BALL, SOFT + ' priority="1"'), LINEAR, OPTION), 2),  # the floor's solref has no say
        (scene(body(BALL), option=OPTION, more=PAIR), 2),
        (scene(TWO_ON_A_LINE, SOFT, OPTION), 4),
        (scene("\n".join(body('type="sphere" size="0.1"', SOFT, name) for name in "ab"), SOFT, OPTION), 6),
    ],
)
def test_the_patch_applied_makes_the_model_pass(text, lines, tmp_path, monkeypatch):
    changed, passed = patched(text, tmp_path, monkeypatch)
    assert passed
    assert len(changed) == lines


def test_the_step_is_written_where_the_model_has_none(tmp_path, monkeypatch):
    text = ball('solref="-1000000 -20"').replace('<option timestep="0.001"/>', "")
    changed, passed = patched(text, tmp_path, monkeypatch)
    assert passed
    assert changed == ['+  <option timestep="0.001"/>']


def test_where_nothing_helps_all_it_helps_those_that_fall_straight(tmp_path):
    """A rod on its end that carries a hinged weight turns, and its landing is another one with every solref."""
    rod = body('type="capsule" size="0.02 0.3"', 'friction="2"', "rod", 'pos="3 0 1" euler="30 0 0"')
    hinged = rod.replace("</body>", '<body pos="0 0 0.32"><joint axis="1 0 0"/><geom size="0.1"/></body></body>')
    text = scene(body(BALL, SOFT) + hinged, SOFT, 'timestep="0.004"')
    told, beyond = advised(check(written(text, tmp_path)))
    assert [contact.meeting.names for contact in beyond] == [("rod", "floor"), ("it", "rod")]
    assert told.count("solref") == 4


def test_all_else_of_the_file_stays_as_it_is(tmp_path):
    """Comments, quotes, line ends, and a file without a last one."""
    text = "<mujoco><!-- ü timestep=\"9\" -->\r\n<option\r\n timestep='0.004' /></mujoco>"
    told = patch(load(written(text, tmp_path)), Change(timestep=0.001))
    assert told.splitlines()[3:] == [
        ' <mujoco><!-- ü timestep="9" -->',
        " <option",
        "- timestep='0.004' /></mujoco>",
        "\\ No newline at end of file",
        "+ timestep='0.001' /></mujoco>",
        "\\ No newline at end of file",
    ]


def test_a_geom_of_an_included_file_is_not_patched(tmp_path):
    part = body('type="sphere" size="0.1"')
    written(f"<mujocoinclude>{part}</mujocoinclude>", tmp_path, "part.xml")
    model = load(written(scene('<include file="part.xml"/>'), tmp_path))
    assert patch(model, Change(geoms={1: (0.01, 1.0)})) is None
    assert 'solref="0.01 1"' in patch(model, Change(geoms={0: (0.01, 1.0)}))

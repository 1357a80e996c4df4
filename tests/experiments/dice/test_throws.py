"""What `stiffdice throw` tells: the face that the loop of many throws has, too, and every word of bad input."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation
from tests.conftest import ROOT

from stiffdice.cli.main import main
from stiffdice.experiments.dice import throws
from stiffdice.scene import die
from stiffdice.scene.scene import from_mapping, load
from stiffdice.simulation.landing import Rest, land
from stiffdice.simulation.launch_distribution import LaunchDistribution

SCENE = from_mapping(die.SCENE)


def test_the_die_that_needs_no_file_is_the_projects():
    assert load(ROOT / "config/scenes/die.yaml") == SCENE


def test_a_rotation_vector_turns_the_upright_nodes_into_these():
    nodes = SCENE.cube.node_offsets()
    random = np.random.default_rng(3)
    turns = [*random.standard_normal((50, 3)), [np.pi, 0, 0], [0, np.pi, 0], [0, 0, np.pi], [0, 0, 0]]
    for turn in turns:
        matrix = Rotation.from_rotvec(turn).as_matrix()
        found = Rotation.from_rotvec(throws._rotation_vector(nodes @ matrix.T, SCENE)).as_matrix()
        np.testing.assert_allclose(found, matrix, atol=1e-12)


def test_one_throw_has_the_face_that_the_loop_of_many_has():
    scene = from_mapping(
        {**die.SCENE, "launch": {"position": [0, 0, 0.03], "velocity": [0.2, 0, 0], "node_velocity": "rigid"}}
    )
    steps = throws.default_steps(scene)
    for seed in range(8):
        launches = LaunchDistribution(velocity_spread=0.1, spin_spread=10.0, seed=seed)
        thrown = throws.one(scene, launches, "symplectic_euler", steps)
        many = land(scene, launches.draw(scene, 1), steps=steps)
        assert (thrown.face, thrown.rest) == (many.face[0], Rest.SETTLED)
        assert thrown.time == pytest.approx(many.steps[0] * scene.duration / steps, abs=0.02)


def told(capsys, *words):
    status = main(["throw", *words])
    out, err = capsys.readouterr()
    return status, out, err


def test_a_throw_is_the_same_again_and_another_seed_another(capsys):
    first, again, other = (told(capsys, "--seed", seed, "--json")[1] for seed in ("5", "5", "6"))
    assert first == again != other
    assert json.loads(first)["face"] in die.FACES


def test_many_throws_are_counted(capsys):
    status, out, _ = told(capsys, "--count", "500", "--json")
    found = json.loads(out)
    assert status == 0
    assert sum(face["count"] for face in found["faces"].values()) == found["rest"]["settled"]
    assert sum(found["rest"].values()) == found["throws"] == 500
    _, out, _ = told(capsys, "--count", "500")
    assert out.splitlines()[0].split()[:3] == ["face", "count", "share"]
    assert "of all cases" in out


@pytest.mark.long
def test_a_load_shows(capsys):
    _, out, _ = told(capsys, "--count", "2000", "--json", "--set", "cube.load={at: corner, mass: 1 g}")
    shares = [face["share"] for face in json.loads(out)["faces"].values()]
    assert 1.5 * max(shares[:3]) < min(shares[3:])  # the load is at 1, 2, 3


@pytest.mark.long
def test_an_animation_is_as_long_as_slow_motion_makes_it(capsys, tmp_path):
    status, out, _ = told(capsys, "--animate", str(tmp_path / "throw.gif"))
    assert status == 0
    assert "is up" in out
    with Image.open(tmp_path / "throw.gif") as image:
        assert image.n_frames > 30


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--count", "0"], "--count = 0: allowed is a whole number from 1"),
        (["--count", "many"], "--count = many"),
        (["--seed", "-1"], "--seed = -1"),
        (["--velocity-spread", "3 kg"], "--velocity-spread = 3 kg"),
        (["--spin-spread", "-2"], "launches.spin_spread = -2"),
        (["--orientation", "up"], "launches.orientation = up: allowed is uniform or as_launched"),
        (["--count", "50", "--steps", "300"], "--steps = 300: no throw settled .*blew up"),
        (["--count", "3", "--animate", "x.gif"], "--animate = x.gif: allowed is with one throw"),
        (["--animate", "x.png"], "--animate = x.png"),
        (["--set", "ground.normal=[0, 1, 1]"], "ground.normal = .*level ground"),
        (["--set", "gravity=0"], "gravity = 0"),
        (["--set", "cube.sides=[16, 0, 16] mm"], r"cube.sides\[y\] = 0.0: allowed is a finite number > 0"),
        (["none.yaml"], "none.yaml: No such file"),
        (["--spin-spread", "scene"], "launches.spin_spread is null: state launch.angular_momentum"),
    ],
)
def test_bad_input_is_one_line(capsys, words, said):
    status, out, err = told(capsys, *words)
    assert status == 2
    assert not out
    assert len(err.splitlines()) == 1
    assert re.search(said, err), err

"""A scene of two cubes: its file, its changes, and what is refused of it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml

from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.scene import pair
from stiffdice.scene import scene as scenes

TWO = """
cubes:
  - cube: {side: 40 cm, mass: 1 kg}
    launch: {position: [0, 0, 1], velocity: [1, 0, 0]}
  - cube: {side: 20 cm, mass: 300 g}
    launch: {position: [1, 0, 1], angular_momentum: [0, 2 rad/s, 0]}
ground: {stiffness: 20 kN/m, damping: 3, friction: 0.2}
gravity: 9.81
duration: 2
"""


@pytest.fixture
def two(tmp_path):
    path = tmp_path / "two.yaml"
    path.write_text(TWO)
    return path


def test_a_file_of_two_cubes_is_read_with_units(two):
    scene = pair.load(two)
    first, second = scene.cubes
    assert (first.side, second.side) == pytest.approx((0.4, 0.2), rel=1e-15)
    assert (first.mass, second.mass) == (1.0, 0.3)
    assert (scene.ground.stiffness, scene.gravity, scene.duration) == (2e4, 9.81, 2.0)
    spin = scene.launches[1].spin
    assert spin == pytest.approx((0.0, 2.0 * 0.3 * 0.2**2 / 6, 0.0))  # L = I ω of its own cube
    assert scene.launches[0].spin == (0.0, 0.0, 0.0)


def test_what_is_stored_is_the_scene(two):
    """The JSON in a file gives the same scene and digest, so that a file can be run again."""
    scene = pair.load(two)
    again = pair.from_mapping(json.loads(json.dumps(scene.as_mapping())))
    assert again == scene
    assert again.digest == scene.digest
    assert scene.digest != pair.load(two, ["cubes.1.cube.mass=0.31"]).digest


@pytest.mark.parametrize("number", [0, 1])
def test_each_cube_is_changed_by_its_number_and_the_other_stays(two, number):
    change = f"cubes.{number}.launch.velocity=[0, 3 km/h, 0]"
    scene, plain = pair.load(two, [change]), pair.load(two)
    assert scene.launches[number].velocity == pytest.approx((0.0, 3 / 3.6, 0.0))
    assert scene.parts[1 - number] == plain.parts[1 - number]


def test_what_both_share_is_changed_without_a_number(two):
    scene = pair.load(two, ["ground.stiffness=1e6", "gravity=0", "duration=3"])
    assert [(part.ground.stiffness, part.gravity, part.duration) for part in scene.parts] == [(1e6, 0.0, 3.0)] * 2


def test_a_change_goes_before_what_the_file_says_in_other_words(two):
    assert pair.load(two, ["cubes.0.cube.radius=1"]).cubes[0].radius == 1.0  # the file gives a side
    assert pair.load(two, ["cubes.1.launch.angular_momentum.seed=3"]).launches[1].spin[0] > 0


def test_both_cubes_may_be_changed_at_once(two):
    given = {**yaml.safe_load(TWO), "cubes": [{}, {}]}
    assert pair.load(two, ["cubes=[{}, {}]"]) == pair.from_mapping(given)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        (["cubes.1.launch.velocity=[1, 0]"], r"cubes\.1\.launch\.velocity = \[1, 0\]: allowed are three"),
        (["cubes.1.launch.velocty=[1, 0, 0]"], r"cubes\.1\.launch\.velocty: unknown key; .* did you mean velocity"),
        (["cubes.0.cube.mass=-3"], r"cubes\.0\.cube\.mass = -3: allowed is a finite number > 0 \[kg\]"),
        (["cubes.0.cube.mass=3 m"], r"cubes\.0\.cube\.mass = 3 m: m is no unit of \[kg\]"),
        (["cubes.1.launch=3"], r"cubes\.1\.launch = 3: allowed are keys"),
        (["cubes.1.cube.mass.x=3"], r"--set cubes\.1\.cube\.mass\.x=3: no such key; did you mean cubes\.1\.cube\.mass"),
        (["cubes.2.cube.mass=3"], r"--set cubes\.2\.cube\.mass=3: allowed are cubes\.0 and cubes\.1"),
        (["cubes.1=3"], r"--set cubes\.1=3: allowed are cubes\.0 and cubes\.1, as in"),
        (["cubes=[1]"], r"cubes = \[1\]: allowed is a list of two, each with cube and launch"),
        (["cubes=[]", "cubes.0.cube.mass=1"], r"cubes = \[\]: allowed is a list of two"),
        (["cubes.0.ground.stiffness=3"], r"cubes\.0\.ground: unknown key; allowed are cube, launch"),
        (["cube.mass=3"], "cube: unknown key; allowed are cubes, .*; did you mean cubes"),
        (["ground.stifness=3"], "ground.stifness: unknown key; .*did you mean stiffness"),
        (["ground.damping=-1"], "yaml: ground.damping = -1: allowed"),
        (["ground.contact=ungated"], "ground.contact = ungated: allowed is gated for two cubes"),
        (["ground.restitution=0.5"], "ground.restitution: asks for another damping .*; allowed is ground.damping"),
        (["preset=as_listed"], "preset: unknown key"),
        (["duration"], "--set duration: allowed is key.path=value"),
    ],
)
def test_bad_changes_are_told_in_one_line_with_file_and_key(two, changes, told):
    with pytest.raises(InputError, match=told) as error:
        pair.load(two, changes)
    assert str(error.value).startswith(f"{two}: ")
    assert "\n" not in str(error.value)


def test_a_restitution_gives_equal_cubes_one_damping():
    scene = pair.from_mapping({"cubes": [{}, {}], "ground": {"restitution": 0.5}})
    assert scene.ground == scenes.from_mapping({"ground": {"restitution": 0.5}}).ground


def test_the_example_of_the_page_on_scenes_is_one():
    page = (Path(__file__).parents[2] / "config" / "README.md").read_text(encoding="utf-8")
    (example,) = re.findall(r"```yaml\n(cubes:.*?)```", page, re.DOTALL)
    assert pair.from_mapping(yaml_loader.parse(example)).cubes[1].sides == (0.4, 0.3, 0.5)


def test_two_cubes_are_told_by_their_key():
    assert pair.is_pair(yaml.safe_load(TWO))
    assert not pair.is_pair({"cube": {}})
    assert not pair.is_pair(None)


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(InputError, match=r"none\.yaml: No such file"):
        pair.load(tmp_path / "none.yaml")

"""What holds of every scene, however its file is written."""

from __future__ import annotations

import dataclasses
import json
import math
from decimal import Decimal

import pytest
import yaml
from hypothesis import assume, given
from hypothesis import strategies as st

from stiffdice.errors import InputError
from stiffdice.io import yaml_loader
from stiffdice.scene.cube import GEOMETRIES, INERTIAS
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import NODE_VELOCITIES, PRESETS, Scene, changed, from_mapping

positive = st.floats(1e-3, 1e6)
whatever = st.floats(-1e6, 1e6)
vectors = st.lists(whatever, min_size=3, max_size=3)
normals = vectors.filter(any)
seeds = st.fixed_dictionaries(
    {"seed": st.integers(0, 2**53)}, optional={"low": st.floats(-5, 0), "high": st.floats(1, 5)}
)

VALUES = {
    "cube.radius": positive,
    "cube.mass": positive,
    "cube.geometry": st.sampled_from(GEOMETRIES),
    "cube.inertia": st.sampled_from(INERTIAS),
    "ground.stiffness": positive,
    "ground.damping": positive,
    "ground.friction": positive,
    "ground.contact": st.sampled_from(sorted(CONTACT_LAWS)),
    "ground.normal": normals,
    "launch.position": vectors,
    "launch.velocity": vectors,
    "launch.angular_momentum": vectors | seeds,
    "launch.orientation": vectors,
    "launch.node_velocity": st.sampled_from(NODE_VELOCITIES),
    "gravity": st.floats(0, 1e3),
    "duration": positive,
}
NEEDED = {"cube.inertia": VALUES["cube.inertia"]}  # the preset `corrected` asks for it
flat = st.fixed_dictionaries(NEEDED, optional={key: value for key, value in VALUES.items() if key not in NEEDED})


def nested(keys):
    """Return a scene's file from its keys with dots."""
    mapping = {}
    for path, value in keys.items():
        *section, key = path.split(".")
        (mapping.setdefault(section[0], {}) if section else mapping)[key] = value
    return mapping


mappings = st.builds(
    lambda keys, preset: nested(keys) | preset,
    flat,
    st.fixed_dictionaries({}, optional={"preset": st.sampled_from(sorted(PRESETS))}),
)


@given(mappings)
@pytest.mark.long
def test_a_scene_is_the_same_after_being_written_and_read(mapping):
    scene = from_mapping(mapping)
    text = yaml.safe_dump(scene.as_mapping())
    again = from_mapping(yaml_loader.parse(text))
    assert again == scene
    assert again.digest == scene.digest
    assert again.as_mapping() == scene.as_mapping()
    assert from_mapping(json.loads(json.dumps(scene.as_mapping()))).digest == scene.digest


SPELLINGS = (
    repr,
    "{:.17g}".format,
    "{:.16e}".format,
    lambda number: f"{Decimal(number):f}",
    lambda n: f"{Decimal(n):e}",
)


def spelt(value, chance):
    """Return a value as YAML, with its keys in any order and its numbers in any spelling."""
    if isinstance(value, dict):
        keys = list(value)
        chance.shuffle(keys)
        return "{" + ", ".join(f"{key}: {spelt(value[key], chance)}" for key in keys) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(spelt(part, chance) for part in value) + "]"
    if isinstance(value, float):
        return chance.choice(SPELLINGS)(value)
    return json.dumps(value)


@given(mappings, st.randoms(use_true_random=False))
@pytest.mark.long
def test_a_digest_is_of_the_scene_and_not_of_its_spelling(mapping, chance):
    scene = from_mapping(mapping)
    text = spelt(mapping, chance)
    assert from_mapping(yaml_loader.parse(text)).digest == scene.digest, text


@pytest.mark.parametrize("text", ["1e4", "1.0e4", "10000", "10000.0", "1.0e+4", "+1e04", ".1e5"])
def test_a_number_is_the_same_in_each_spelling(text):
    assert changed({}, [f"ground.stiffness={text}"]).digest == Scene().digest


@given(flat, st.sampled_from(sorted(VALUES)), st.data())
def test_scenes_have_one_digest_only_if_they_are_equal(keys, key, data):
    other = keys | {key: data.draw(VALUES[key])}
    one, two = from_mapping(nested(keys)), from_mapping(nested(other))
    assert (one == two) == (one.digest == two.digest)


@given(normals)
def test_a_normal_is_a_direction(normal):
    once = from_mapping({"ground": {"normal": normal}}).ground.normal
    assert math.hypot(*once) == pytest.approx(1, abs=1e-15)
    largest = max(range(3), key=lambda axis: abs(normal[axis]))
    for axis in range(3):
        assert once[axis] * normal[largest] == pytest.approx(normal[axis] * once[largest], rel=1e-12, abs=1e-300)
    assert from_mapping({"ground": {"normal": list(once)}}).ground.normal == once


def test_nothing_is_negative_zero():
    minus = {"gravity": -0.0, "ground": {"normal": [-0.0, 0, 2]}, "launch": {"velocity": [-0.0, 0, 0]}}
    plus = {"gravity": 0, "ground": {"normal": [0, 0, 2]}, "launch": {"velocity": [0, 0, 0]}}
    assert from_mapping(minus).digest == from_mapping(plus).digest


@given(mappings, positive, st.sampled_from(sorted(CONTACT_LAWS)))
def test_another_ground_is_all_that_changes(mapping, stiffness, contact):
    scene = from_mapping(mapping)
    other = scene.with_ground(stiffness=stiffness, contact=contact)
    assert (other.ground.stiffness, other.ground.contact) == (stiffness, contact)
    assert dataclasses.replace(other, ground=scene.ground) == scene
    assert other.with_ground(stiffness=scene.ground.stiffness, contact=scene.ground.contact) == scene


@given(flat, st.sampled_from(sorted(PRESETS)))
def test_a_key_that_is_given_goes_before_any_preset(keys, preset):
    found = from_mapping(nested(keys), preset).as_mapping()
    plain = from_mapping(nested(keys)).as_mapping()
    for path, value in PRESETS[preset].items():
        section, key = path.split(".")
        assert found[section][key] == keys.get(path, value)
        plain[section][key] = found[section][key]
    assert found == plain, "a preset changes nothing else"


@given(flat.filter(lambda keys: len(keys) > 1))
def test_changes_from_the_command_line_are_as_good_as_keys_in_the_file(keys):
    changes = [f"{key}={json.dumps(value)}" for key, value in keys.items()]
    assert changed({}, changes) == from_mapping(nested(keys))


JUNK = (
    *(None, True, "heavy", "", [], [1], [1, 2, "x"], {"x": 1}, math.nan, math.inf, -math.inf, 10**400, -(10**400)),
    *(
        [1, 2, math.nan],
        [1, 2, None],
        [[1], 2, 3],
        {"seed": -1},
        {"seed": 1.5},
        {"seed": math.nan},
        {"low": 1},
        "\x1b[2J\n",
    ),
)


@given(flat, st.sampled_from(sorted(VALUES)), st.sampled_from(JUNK))
def test_a_value_that_cannot_be_is_refused_by_the_name_of_its_key(keys, key, junk):
    with pytest.raises(InputError) as caught:
        from_mapping(nested(keys | {key: junk}))
    assert str(caught.value).startswith(key)
    assert str(caught.value).isprintable()


plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5) | st.sampled_from(JUNK),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)
names = st.sampled_from(
    [
        *("preset", "cube", "ground", "launch", "gravity", "duration", "mass", "radius", "seed", "normal", "x"),
        *("side", "restitution", "contact_time", "angular_momentum"),
    ]
)


@given(plain | st.dictionaries(names, plain | st.dictionaries(names, plain, max_size=3), max_size=4))
def test_whatever_a_file_says_it_is_a_scene_or_refused_in_one_line(data):
    try:
        scene = from_mapping(data)
    except InputError as error:
        assert 0 < len(str(error)) <= 1000
        assert str(error).isprintable()
    else:
        assert from_mapping(scene.as_mapping()) == scene


@given(st.text(max_size=40))
def test_whatever_follows_set_it_is_a_scene_or_refused_in_one_line(text):
    assume("\0" not in text)
    try:
        assert isinstance(changed({}, [text]), Scene)
    except InputError as error:
        assert str(error).isprintable()

"""A side for a radius, a restitution for a damping: the same scene, in other words."""

from __future__ import annotations

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiffdice.errors import InputError
from stiffdice.scene import flat_landing
from stiffdice.scene.cube import GEOMETRIES
from stiffdice.scene.scene import PRESETS, Scene, changed, from_mapping


@given(st.floats(1e-6, 1e6), st.sampled_from(GEOMETRIES))
def test_a_cube_has_the_side_that_was_given(side, geometry):
    """To round-off; as printed, that of √2, from which the formula takes the side away again."""
    cube = from_mapping({"cube": {"side": side, "geometry": geometry}}).cube
    lost = 1e-15 if geometry == "printed" else 0.0
    assert cube.side == pytest.approx(side, rel=5e-16, abs=lost)


@pytest.mark.parametrize("preset", [None, *sorted(PRESETS)])
def test_a_side_is_a_true_cubes_whatever_the_preset(preset):
    scene = from_mapping({"cube": {"side": 0.016, "inertia": "solid"}}, preset)
    assert scene.cube.side == 0.016
    assert scene.cube.geometry == "exact"
    assert scene.cube.radius == pytest.approx(0.008 * math.sqrt(3), rel=1e-15)
    assert scene.derived == ("cube.radius = 0.0138564 m, from cube.side = 0.016 m by the exact geometry",)


def test_a_geometry_that_is_given_goes_before():
    scene = from_mapping({"cube": {"side": 0.016, "geometry": "printed"}})
    assert (scene.cube.geometry, scene.cube.radius) == ("printed", pytest.approx(0.106666, abs=1e-6))


@pytest.mark.parametrize(
    "keys",
    [
        {"cube": {"side": "16 mm", "mass": "5 g"}, "ground": {"restitution": 0.5, "contact_time": "0.1 ms"}},
        {"cube": {"side": 0.016}, "ground": {"restitution": 0.5, "stiffness": "2 kN/m", "contact": "gated"}},
    ],
)
def test_what_is_stored_is_the_canonical_scene(keys):
    """Nobody can tell from the stored scene, or its digest, in which words it was given."""
    scene = from_mapping(keys)
    assert scene.as_mapping().keys() == Scene().as_mapping().keys()
    again = from_mapping(scene.as_mapping())
    assert (again, again.digest, again.derived) == (scene, scene.digest, ())
    assert again.cube.side == scene.cube.side


def test_restitution_is_that_of_the_scenes_contact_law():
    """And of its cube: for twice the mass twice the damping, and as listed less, as it damps twice on the way in."""
    gated, ungated = (
        from_mapping({"ground": {"restitution": 0.5, "contact": law}}).ground.damping for law in ("gated", "ungated")
    )
    heavy = from_mapping({"cube": {"mass": 4}, "ground": {"restitution": 0.5, "contact": "gated"}}).ground.damping
    assert gated == flat_landing.damping("gated", 0.5, 1e4, 1.0) > ungated
    assert heavy == pytest.approx(2 * gated, rel=1e-15)


def test_a_preset_chooses_the_law_of_a_restitution_and_otherwise_it_acts_in_contact_only():
    asked = {"ground": {"restitution": 0.5}}
    assert from_mapping(asked).ground == from_mapping(asked, "as_written").ground
    written = from_mapping(asked, "as_written").ground
    assert written == from_mapping({"ground": {"restitution": 0.5, "contact": "gated"}}).ground
    assert written.damping != from_mapping(asked, "as_listed").ground.damping


@pytest.mark.parametrize(
    ("ground", "told"),
    [
        ({"restitution": 0.5, "damping": 1}, "ground.restitution and ground.damping are both given: allowed is one"),
        (
            {"restitution": 0.5, "contact_time": 1, "stiffness": 1},
            "ground.contact_time and ground.stiffness are both given",
        ),
        ({"contact_time": 1}, "ground.contact_time is given: allowed is beside ground.restitution only"),
        ({"contact_time": 1, "damping": 1}, "ground.contact_time is given: allowed is beside"),
        ({"restitution": 0}, "ground.restitution = 0: allowed is a number above 0, up to 1 [1]"),
        ({"restitution": 1.01}, "ground.restitution = 1.01: allowed is a number above 0, up to 1 [1]"),
        ({"restitution": math.nan}, "ground.restitution = nan: allowed is a finite number [1]"),
        ({"restitution": "half"}, "ground.restitution = the text 'half': allowed"),
        ({"restitution": 0.5, "stiffness": 0}, "ground.stiffness = 0: allowed is a finite number > 0"),
        ({"restitution": 0.5, "contact_time": 0}, "ground.contact_time = 0: allowed is a finite number > 0 [s]"),
        ({"restitution": 0.5, "contact_time": "5 mm"}, "ground.contact_time = 5 mm: mm is no unit of [s]"),
        ({"restitution": 0.5, "contact_time": 1e-200}, "ground.contact_time = 1e-200: double precision has no ground"),
        ({"restitution": 0.5, "contact_time": 1e200}, "ground.contact_time = 1e+200: double precision has no ground"),
        ({"restitution": 0.5, "contact": "soft"}, "ground.contact = soft: allowed is"),
    ],
)
def test_combinations_that_no_ground_has_are_refused(ground, told):
    with pytest.raises(InputError) as caught:
        from_mapping({"ground": ground})
    assert str(caught.value).startswith(told)


def test_a_cube_has_a_side_or_a_radius():
    with pytest.raises(InputError, match=r"^cube\.side and cube\.radius are both given: allowed is one of them$"):
        from_mapping({"cube": {"side": 1, "radius": 1}})


@pytest.mark.parametrize(
    ("file", "change", "same"),
    [
        ({"ground": {"damping": 3}}, "ground.restitution=0.5", {"ground": {"restitution": 0.5}}),
        ({"ground": {"restitution": 0.5}}, "ground.damping=3", {"ground": {"damping": 3}}),
        ({"cube": {"radius": 3}}, "cube.side=1", {"cube": {"side": 1}}),
        (
            {"ground": {"restitution": 0.5, "stiffness": 3}},
            "ground.contact_time=1",
            {"ground": {"restitution": 0.5, "contact_time": 1}},
        ),
    ],
)
def test_a_change_goes_before_what_the_file_says_in_other_words(file, change, same):
    assert changed(file, [change]) == from_mapping(same)


def test_what_is_derived_of_another_ground_is_not_told():
    scene = from_mapping({"cube": {"side": 1}, "ground": {"restitution": 0.5, "contact_time": 1e-3}})
    assert [line.split()[0] for line in scene.derived] == ["cube.radius", "ground.stiffness", "ground.damping"]
    assert [line.split()[0] for line in scene.with_ground(stiffness=1.0).derived] == ["cube.radius"]


def test_an_angular_velocity_is_an_angular_momentum_of_this_cube():
    given, stored = (
        {"cube": {"side": "16 mm", "mass": "5 g"}, "launch": {"angular_momentum": spin}}
        for spin in (["20 rad/s", 0, "-360 deg/s"], [20 * 0.005 * 0.016**2 / 6, 0, -2 * math.pi * 0.005 * 0.016**2 / 6])
    )
    assert from_mapping(given).launch.spin == pytest.approx(from_mapping(stored).launch.spin, rel=1e-14)
    assert changed({}, ["launch.angular_momentum=[1, 2, 3] rad/s"]).launch.spin[1] == pytest.approx(
        2 * Scene().cube.moment_of_inertia, rel=1e-15
    )
    for mixed in itertools.permutations(["20 rad/s", 1, 0]):
        with pytest.raises(InputError, match=r"rad/s is no unit of \[kg m²/s\]"):
            from_mapping({"launch": {"angular_momentum": list(mixed)}})


def test_a_random_spin_may_be_in_angular_velocities():
    drawn = changed({"cube": {"side": 0.016, "mass": 0.005}}, ["launch.angular_momentum={seed: 7, high: 20 rad/s}"])
    inertia = drawn.cube.moment_of_inertia
    assert all(0 < part / inertia < 20 for part in drawn.launch.spin)

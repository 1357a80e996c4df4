"""The least model that is exact for a scene: it is the full one to round-off, and no scene gets a lesser one."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.model_selection import AS_ASKED, chosen, least_model
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import start_of
from stiffdice.errors import InputError
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.initial_conditions import phased, turned
from stiffdice.simulation.run import simulate

PARTS = ("position", "velocity", "angular_momentum", "node_offset")


def scene_of(**keys):
    """A flat cube without spin, thrown straight up under the gated law, unless told otherwise."""
    told = {"ground": {"contact": "gated"}, "launch": {"velocity": [0, 0, 5]}}
    for name, part in keys.items():
        told[name] = told.get(name, {}) | part if isinstance(part, dict) else part
    return from_mapping(told)


def pair(scene, steps, model=None):
    """Every state of the least model's run, or another's, and of the full one's, shape (time,) each."""
    name = model or least_model(scene, scene.duration / steps)[0]
    return tuple(simulate(scene, model=which, steps=steps, every=1).trajectory.state for which in (name, "tumbling"))


def difference(less, full):
    """The largest of place [m], velocity [m/s] and nodes [m]; a lesser model says nothing of the spin."""
    return max(np.abs(less[part] - full[part]).max() for part in ("position", "velocity", "node_offset"))


def until_the_third_landing(scene, states):
    """How many states there are before it."""
    nodes = states["position"][:, None] + states["node_offset"]
    down = np.concatenate([[False], (nodes @ np.array(scene.ground.normal)).min(axis=1) <= 0])
    landings = np.flatnonzero(down[1:] & ~down[:-1])
    return landings[2] if len(landings) > 2 else len(states)


def drawn(rng):
    """Any scene, and steps that resolve its contact, its damping and its spin."""

    def some(share):
        return rng.random() < share

    about = rng.normal(size=2)
    tilt = about / np.hypot(*about) * rng.uniform(0, 1.2)
    angle, flat = np.hypot(*tilt), rng.choice(["upright", "turned", "slope", "any"], p=[0.3, 0.25, 0.25, 0.2])
    orientation = {
        "upright": [0, 0, 0],
        "turned": [[0, 0, rng.uniform(-4, 4)], [np.pi / 2, 0, 0], [0, -np.pi / 2, 0]][rng.integers(3)],
        "slope": [*tilt, 0],
        "any": rng.normal(size=3),
    }[flat]
    normal = np.array([0, 0, 1.0])
    if flat == "slope":
        normal = np.array([*np.sin(angle) * tilt[::-1] / angle * [1, -1], np.cos(angle)])
    side, mass = 10 ** rng.uniform(-1, 0.5), 10 ** rng.uniform(-1, 1)
    stiffness, damping = 10 ** rng.uniform(1, 4.5) * some(0.95), mass * rng.choice([0, 0.2, 3])
    duration = rng.choice([0.2, 0.6, 1.2])
    velocity = rng.uniform(-6, 6, 3) * ([0, 0, 1] if some(0.5) else 1)
    spin = mass * side**2 * rng.normal(size=3) * some(0.3)
    scene = from_mapping(
        {
            "cube": {
                "radius": side,
                "mass": mass,
                "geometry": "exact",
                "inertia": str(rng.choice(["solid", "corners"])),
            },
            "ground": {
                "stiffness": stiffness,
                "damping": damping,
                "friction": rng.choice([0, 0.3]),
                "contact": str(rng.choice(["ungated", "gated"])),
                "normal": normal.tolist(),
            },
            "launch": {
                "position": (normal * side * rng.uniform(0.5, 5)).tolist(),
                "velocity": velocity.tolist(),
                "angular_momentum": spin.tolist(),
                "orientation": list(map(float, orientation)),
                "node_velocity": str(rng.choice(["translation", "rigid"])),
            },
            "gravity": rng.choice([0, 9.8]),
            "duration": duration,
        }
    )
    fastest = max(2 * np.sqrt(stiffness / mass) / 0.5, 12 * damping / mass / 0.5, 10)
    return scene, int(duration * fastest) + 5


def cancels_to_the_last_bit(scene, model):
    """Whether the full model's torques do: of an upright cube without spin, and without a sum that mixes two forces."""
    upright = not any(scene.launch.orientation) and not any(scene.launch.spin)
    return upright and (scene.ground.friction == 0 or model == "vertical")


@pytest.mark.parametrize(
    "count", [pytest.param(500, marks=pytest.mark.long), pytest.param(5000, marks=pytest.mark.broad)]
)
def test_a_lesser_model_is_the_full_one_to_round_off_in_many_scenes(count):
    """To the last bit where torques cancel to the last bit; elsewhere for two bounces, before round-off grows large.

    Not asked here is what friction makes of that round-off: the next test.
    """
    rng = np.random.default_rng(7)
    found = dict.fromkeys(MODELS, 0)
    for _ in range(count):
        scene, steps = drawn(rng)
        name, reason = least_model(scene, scene.duration / steps)
        exact = cancels_to_the_last_bit(scene, name)
        if name == "tumbling" or not (exact or scene.ground.friction == 0 or name == "flying"):
            continue
        found[name] += 1
        less, full = pair(scene, steps)
        if exact:
            for part in PARTS:
                np.testing.assert_array_equal(less[part], full[part], err_msg=f"{reason} {scene}")
        else:
            early = slice(until_the_third_landing(scene, full))
            assert difference(less[early], full[early]) < 1e-11, (reason, scene)
    assert min(found[name] for name in ("vertical", "sliding", "flying")) > count / 25
    assert sum(found.values()) > count / 2


@pytest.mark.parametrize("contact", ["ungated", "gated"])
def test_what_friction_makes_of_round_off_is_the_schemes_and_gone_at_short_steps(contact):
    """Chatter: a step takes more from a sliding speed of round-off than there is, unless it is a very short one."""
    turned = {"position": [0, 0, 0.52], "velocity": [0, 0, -0.5], "orientation": [0, 0, 0.3]}
    scene = scene_of(ground={"stiffness": 300, "friction": 0.1, "contact": contact}, launch=turned, duration=0.3)
    assert least_model(scene)[0] == "vertical"
    assert difference(*pair(scene, 300)) > 1e-5
    less, full = (simulate(scene, model=model, steps=400_000).end for model in ("vertical", "tumbling"))
    assert difference(less, full) < 1e-11


# Half a turn about the bisector of the diagonal to a corner and of straight down, which swaps the two.
_BISECTOR = np.array([1, 1, 1]) / np.sqrt(3) - [0, 0, 1]
ON_A_CORNER = (np.pi * _BISECTOR / np.linalg.norm(_BISECTOR)).tolist()

AT_A_WALL = {"position": [2, 0, 0], "velocity": [-3, 0, 0]}
ANYHOW = {"velocity": [5, 1, 5], "angular_momentum": [1, 2, 3], "orientation": [1, 2, 3]}

# By name: the keys of a scene and what a lesser model would leave out.
REDUCED_IN_VAIN = {
    "friction tips a flat landing": ({"launch": {"velocity": [5, 0, 5]}}, "sliding"),
    "as listed, too": ({"ground": {"contact": "ungated"}, "launch": {"velocity": [5, 0, 5]}}, "sliding"),
    "a slow slide is a slide": ({"launch": {"velocity": [1e-5, 0, 5]}}, "sliding"),
    "an edge": ({"launch": {"orientation": [0.5, 0, 0]}}, "vertical"),
    "balanced on an edge": ({"launch": {"orientation": [np.pi / 4, 0, 0], "velocity": [0, 0, 0]}}, "vertical"),
    "balanced on a corner": ({"launch": {"orientation": ON_A_CORNER, "velocity": [0, 0, 0]}}, "vertical"),
    "nearly flat": ({"launch": {"orientation": [1e-9, 0, 0]}}, "vertical"),
    "flat, but not on this slope": ({"ground": {"normal": [0.2, 0, 1], "friction": 0}}, "sliding"),
    "friction on a slope": (
        {"ground": {"normal": [0, 1, 1]}, "launch": {"orientation": [-np.pi / 4, 0, 0]}},
        "sliding",
    ),
    "dropped straight onto a slope": (
        {"ground": {"normal": [0, 1, 1]}, "launch": {"orientation": [-np.pi / 4, 0, 0], "velocity": [0, 0, 0]}},
        "sliding",
    ),
    "spin": ({"launch": {"angular_momentum": [0.01, 0, 0]}}, "vertical"),
    "spin about the normal": ({"launch": {"angular_momentum": [0, 0, 0.1]}}, "vertical"),
    "drag on a spinning cube in the air": (
        {"ground": {"contact": "ungated"}, "launch": {"position": [0, 0, 90], "angular_momentum": [1, 0, 0]}},
        "vertical",
    ),
    "sunk past its centre": (
        {
            "ground": {"stiffness": 3.2},
            "launch": {"position": [0, 0, 1], "velocity": [0, 0, 0], "orientation": [0, 0, 1]},
        },
        "vertical",
    ),
    "launched with some nodes in the ground": (
        {"launch": {"position": [0, 0, 0.5], "velocity": [0, 0, 0], "orientation": [0.3, 0.2, 0]}},
        "vertical",
    ),
}


@pytest.mark.parametrize("name", REDUCED_IN_VAIN)
def test_no_model_is_reduced_that_the_full_one_would_show_wrong(name):
    keys, lesser = REDUCED_IN_VAIN[name]
    scene = scene_of(duration=6.0, **keys)
    assert least_model(scene)[0] == "tumbling"
    # In the listings' order, whose sums do not cancel: what is in balance needs a push of round-off.
    less, full = (simulate(scene, model=model, steps=30_000, leap=False).end for model in (lesser, "tumbling"))
    assert difference(less, full) > 1e-4


@pytest.mark.parametrize(
    ("keys", "expected"),
    [
        ({}, "vertical"),
        ({"ground": {"contact": "ungated"}}, "vertical"),
        ({"launch": {"velocity": [0.0, -0.0, 5]}}, "vertical"),
        ({"launch": {"orientation": [np.pi / 2, 0, 0]}}, "vertical"),
        ({"launch": {"angular_momentum": {"seed": 3, "low": 0, "high": 0}}}, "vertical"),
        ({"launch": {"position": [0, 0, 0.3], "velocity": [0, 0, 0]}}, "vertical"),
        ({"gravity": 0, "launch": {"velocity": [0, 0, -1]}}, "vertical"),
        ({"ground": {"friction": 0}, "launch": {"velocity": [5, 1, 5]}}, "sliding"),
        ({"ground": {"friction": 0, "normal": [0, 1, 1]}, "launch": {"orientation": [-np.pi / 4, 0, 0]}}, "sliding"),
        ({"gravity": 0, "ground": {"normal": [1, 0, 0]}, "launch": AT_A_WALL}, "sliding"),
        # In the air.
        ({"duration": 1.0}, "flying"),
        ({"duration": 1.0, "launch": ANYHOW}, "flying"),
        ({"gravity": 0}, "flying"),
        ({"gravity": 0, "launch": {"velocity": [1, 0, -0.2]}}, "flying"),
        ({"ground": {"normal": [0, 0, -1]}, "launch": {"position": [0, 0, -9], "velocity": [0, 0, 12]}}, "flying"),
        ({"ground": {"contact": "ungated", "damping": 0}, "duration": 1.0}, "flying"),
        ({"ground": {"contact": "ungated"}, "duration": 0.5}, "flying"),
        ({"ground": {"contact": "ungated"}, "gravity": 0, "launch": {"angular_momentum": [1, 0, 0]}}, "tumbling"),
        ({"ground": {"contact": "ungated"}, "gravity": 0, "launch": {"angular_momentum": [0, 0, 1]}}, "flying"),
        ({"ground": {"contact": "ungated"}, "duration": 0.6}, "vertical"),
        ({"ground": {"contact": "ungated"}, "duration": 0.6, "launch": {"orientation": [1, 2, 3]}}, "vertical"),
        ({"ground": {"contact": "ungated"}, "duration": 0.6, "launch": {"velocity": [5, 0, 5]}}, "sliding"),
        # No ground to speak of.
        ({"ground": {"stiffness": 0, "damping": 0}, "launch": {"angular_momentum": [1, 2, 3]}}, "flying"),
        ({"ground": {"stiffness": 0}}, "tumbling"),
        ({"ground": {"stiffness": 10}}, "tumbling"),
        ({"gravity": 1e300}, "tumbling"),
    ],
    ids=str,
)  # fmt: skip
def test_what_a_scene_requires(keys, expected):
    name, reason = least_model(scene_of(**keys))
    assert name == expected
    assert reason.startswith(f"{name}: ")
    assert ("the same about every axis" in reason) == (name == "tumbling")


def test_a_wall_that_is_passed_is_never_touched():
    """A parabola that bends away from the ground is lowest on its way."""
    ceiling = {"ground": {"normal": [0, 0, -1]}, "launch": {"position": [0, 0, -1], "velocity": [0, 0, 0]}}
    for up, expected in ((1.0, "flying"), (2.5, "flying"), (3.5, "sliding")):
        ceiling["launch"]["velocity"] = [0, 0, up]  # rises by up²/(2g); there is room for 0.48 m
        assert least_model(scene_of(**ceiling))[0] == expected
    ceiling["launch"]["velocity"] = [0, 0, 2.5]
    # Steps of 0.1 s of a scheme whose place is behind its velocity, as forward Euler's, rise by 0.14 m more.
    assert least_model(scene_of(**ceiling), 0.1)[0] == "sliding"


@pytest.mark.parametrize(("height", "duration"), [(3.0, 1.35), (0.7, 1.0)])
def test_a_flight_is_clear_of_the_ground_as_the_scheme_flies_it(height, duration):
    """At long steps symplectic Euler's path is below the parabola by g h t/2."""
    scene = scene_of(launch={"position": [0, 0, height]}, duration=duration)
    assert least_model(scene)[0] == "flying"
    assert simulate(scene, model="auto", steps=1000).model == "flying"
    coarse = simulate(scene, model="auto", steps=10, every=1)
    assert coarse.model == "vertical"
    assert coarse.trajectory.state["position"][:, 2].min() < scene.cube.side / 2
    with pytest.raises(InputError, match=r"model = flying: allowed for .* steps of up to 0.1.* s; .* vertical: the"):
        simulate(scene, model="flying", steps=10)


@pytest.mark.parametrize(("clearance", "flies"), [(1e-6, False), (3e-6, True)])
def test_a_flight_that_grazes_the_ground_within_round_off_is_not_clear_of_it(clearance, flies):
    """Back at its height after 10 s; round-off of its lengths, 490 m up and 490 m down, is put at 1e-9 of them all."""
    half = scene_of().cube.side / 2
    scene = scene_of(launch={"position": [0, 0, half + clearance], "velocity": [0, 0, 49]}, duration=10.0)
    assert (least_model(scene)[0] == "flying") == flies


@pytest.mark.parametrize(("clearance", "flies"), [(1e-10, False), (1e-8, True)])
def test_a_cube_that_hovers_within_round_off_of_the_ground_is_not_clear_of_it(clearance, flies):
    launch = {"position": [0, 0, scene_of().cube.side / 2 + clearance], "velocity": [0, 0, 0]}
    assert (least_model(scene_of(launch=launch, gravity=0))[0] == "flying") == flies


def test_the_least_for_several_grounds_is_exact_on_each():
    scene = scene_of(duration=1.0)
    grounds = [scene, scene.with_ground(contact="ungated")]
    assert chosen("auto", grounds[:1], 0.0)[0] == "flying"
    assert chosen("auto", grounds, 0.0) == least_model(grounds[1])
    assert chosen("auto", grounds[::-1], 0.0)[0] == "vertical"
    assert chosen("sliding", grounds, 0.0) == ("sliding", AS_ASKED)
    with pytest.raises(InputError, match="model = flying"):
        chosen("flying", grounds, 0.0)


def test_auto_is_for_a_scene_not_for_an_ensemble():
    scene = scene_of()
    members = phased(scene, "vertical", 100, 3)
    with pytest.raises(InputError, match="model = auto: is chosen for the scene's own launch"):
        simulate(scene, model="auto", steps=100, members=members)


def test_members_of_a_flying_cube_fly_as_the_scene_does():
    """However another would be turned: the ground does not feel it."""
    close = scene_of(launch={"position": [0, 0, 0.6], "angular_momentum": [0, 0, 0]}, duration=0.5)
    assert least_model(close)[0] == "flying"
    members = turned(close, "flying", 4)
    np.testing.assert_array_equal(members, np.repeat(start_of(close, "flying"), 4))


def test_a_run_says_its_model_and_why():
    run = simulate(scene_of(), model="auto", steps=100)
    assert (run.model, run.model_reason) == (
        "vertical",
        "vertical: the cube lands flat without spin and nothing moves it sideways",
    )
    assert simulate(scene_of(), model="sliding", steps=100).model_reason == "as asked"

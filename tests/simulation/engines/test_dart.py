from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pytest

from stiffdice.dynamics.state import STATE, start_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.run import simulate

pytest.importorskip("stiffdice.simulation.engines.dart")
from stiffdice.simulation.engines import dart

pytestmark = pytest.mark.long

TUMBLE = {"angular_momentum": [0.3, 0.5, 0.2], "orientation": [0.1, 0.2, 0.3], "node_velocity": "rigid"}


def scene_of(ground, launch=(), duration=1.0):
    damping = {} if "restitution" in ground else {"damping": 0.0}
    ground = {"contact": "gated", "friction": 0.0, "stiffness": 1e4, **damping, **ground}
    return from_mapping({"ground": ground, "launch": dict(launch), "duration": duration})


def run(scene, model, steps, every=1):
    engine = dart.Dart(scene, model, start_of(scene, model), scene.duration / steps, 1e-9)
    states = np.zeros(steps // every, STATE)
    assert engine.advance(states, every) == steps
    return states


def resting(scene, model, h, count, every=1, depth=0.0):
    """Return states of a cube that is launched where its lowest nodes are so deep in the ground."""
    launch, normal = start_of(scene, model), np.array(scene.ground.normal)
    launch["position"] = normal * (-(launch["node_offset"][0] @ normal).min() - depth)
    states = np.zeros(count, STATE)
    dart.Dart(scene, model, launch, h, 1e-9).advance(states, every)
    return states


def hit(restitution, speed, h, depth):
    """Return the speed at which a flat cube leaves that is so deep and would come at `speed` after its next step."""
    scene = scene_of({"restitution": restitution}, {"velocity": [0, 0, 0]})
    scene = scene_of({"restitution": restitution}, {"velocity": [0, 0, -(speed - scene.gravity * h)]})
    return float(resting(scene, "vertical", h, 1, depth=depth)["velocity"][0, 2])


@pytest.mark.parametrize("restitution", [0.05, 0.5, 0.99, 1.0])
def test_the_restitution_is_the_one_asked_for_whatever_the_step(restitution):
    """But for DART's constraint force mixing: of a cube that does not turn, 10⁻⁵/4 of the change of speed."""
    for h in (1e-2, 1e-4):
        off = hit(restitution, 5.0, h, depth=1e-6) / 5.0 - restitution
        assert off == pytest.approx(-2.5e-6 * (1 + restitution), abs=1e-9)


@pytest.mark.parametrize("contact", ["gated", "ungated"])
def test_it_is_that_of_the_contact_law(contact):
    scene = scene_of({"restitution": 0.4, "contact": contact})
    assert dart.restitution(scene) == pytest.approx(0.4, rel=1e-12)
    damped = scene_of({"damping": 60.0, "contact": contact})
    assert 0 < dart.restitution(damped) < (0.4 if contact == "ungated" else 0.5)
    assert dart.restitution(scene_of({})) == 1


def test_a_slow_rebound_is_none_and_a_fast_one_is_cut():
    """Below 0.1 m/s and above 100 m/s, which cannot be set."""
    assert hit(0.5, 0.21, 1e-4, 1e-9) == pytest.approx(0.105, rel=1e-3)
    assert hit(0.5, 0.19, 1e-4, 1e-9) < 1e-4
    assert hit(0.5, 199.0, 1e-4, 1e-9) == pytest.approx(99.5, rel=1e-3)
    assert hit(0.5, 300.0, 1e-4, 1e-9) == pytest.approx(100.0, rel=1e-3)


@pytest.mark.parametrize("h", [1e-2, 1e-3, 1e-4])
def test_each_undamped_bounce_gains_the_speed_that_gravity_gives_in_a_step(h):
    """The step's pull is turned round with the rest; mixing takes 5·10⁻⁶ of the speed."""
    scene = scene_of({}, {"position": [0, 0, 1.5], "velocity": [0, 0, 0]}, 4.0)
    states = run(scene, "vertical", round(4 / h))
    speed, height = states["velocity"][:, 2], states["position"][:, 2] - scene.cube.side / 2
    (bounces,) = np.nonzero((speed[1:] > 0) & (speed[:-1] < 0))
    energy = speed**2 / 2 + scene.gravity * (height - speed * h / 2)  # of symplectic Euler, constant in flight
    before, after = np.sqrt(2 * energy[bounces]), np.sqrt(2 * energy[bounces + 1])
    assert len(bounces) > 2
    np.testing.assert_allclose(after - before, scene.gravity * h - 5e-6 * before, atol=0.02 * scene.gravity * h)


def test_without_friction_a_bounce_on_a_corner_is_the_limit_of_stiff_ground():
    launch = {"orientation": [0.3, 0.2, 0.1], "angular_momentum": [0.05, 0.02, 0.03], "node_velocity": "rigid"}
    launch |= {"velocity": [2, 0, -3], "position": [0, 0, 0.95]}
    scene = scene_of({"stiffness": 1e9}, launch, 0.1)
    limit = simulate(scene, scheme="event", steps=100, every=1).trajectory.state[-1]
    off = []
    for steps in (500, 5000):
        end = run(scene, "tumbling", steps, steps)[-1]
        off.append(abs(end["velocity"] - limit["velocity"]).max())
    assert off[0] < 0.01
    assert off[1] < off[0] / 5
    assert abs(end["angular_momentum"] - limit["angular_momentum"]).max() < 1e-3


def test_friction_of_an_edge_is_mu_times_what_the_normal_impulse_would_be_without_it():
    """What DART cannot: its solver bounds friction so. On stiff ground it is mu times the impulse that there is."""
    launch = {"position": [0, 0, 0.95], "velocity": [2, 0, -3], "orientation": [0, 0.35, 0]}
    along, up = {}, {}
    for friction in (0.0, 0.3):
        scene = scene_of({"friction": friction, "stiffness": 1e8}, launch, 0.15)
        gained = run(scene, "tumbling", 2000, 2000)["velocity"][-1] - launch["velocity"]
        along[friction], up[friction] = gained[0], gained[2] + scene.gravity * scene.duration
    assert along[0.3] == pytest.approx(-0.3 * up[0.0], rel=1e-3)
    assert up[0.3] > 1.1 * up[0.0]
    limit = simulate(scene, scheme="event", steps=100, every=1).trajectory.state["velocity"][-1] - launch["velocity"]
    assert limit[0] == pytest.approx(-0.3 * (limit[2] + scene.gravity * scene.duration), rel=1e-3)


@pytest.mark.parametrize(("direction", "times"), [((1, 0), 1.0), ((0, 1), 1.0), ((1, 1), math.sqrt(2))])
@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_friction_slows_by_mu_g_along_x_and_along_y(model, direction, times):
    """What DART cannot: between them it is up to √2 times as much, each direction having mu g of its own."""
    along = np.array([*direction, 0]) / math.hypot(*direction)
    scene = scene_of({"friction": 0.3, "restitution": 0.5}, {"velocity": (2 * along).tolist()})
    states = resting(scene, model, 1e-3, 100)
    slowed = (2 * along - states["velocity"][-1]) / 0.1
    np.testing.assert_allclose(slowed, times * 0.3 * scene.gravity * along, atol=1e-5)


@pytest.mark.parametrize(("friction", "steeper"), [(0.21, 0.0), (0.19, 0.01)])
@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_on_a_slope_a_cube_slides_only_beyond_the_coefficient(model, friction, steeper):
    """Of one in five, a face on it: it speeds up by g (sin − mu cos), or not at all."""
    normal = np.array([-0.2, 0, 1]) / math.hypot(0.2, 1)
    launch = {"velocity": [0, 0, 0], "orientation": [0, -math.atan(0.2), 0]}
    scene = scene_of({"friction": friction, "restitution": 0.5, "normal": normal.tolist()}, launch)
    states = resting(scene, model, 1e-4, 100, 10)
    assert -states["velocity"][-1, 0] / normal[2] == pytest.approx(0.1 * scene.gravity * normal[2] * steeper, abs=1e-6)


@pytest.mark.parametrize("model", ["vertical", "sliding", "tumbling"])
def test_a_cube_at_rest_stays_on_the_surface(model):
    """Its weight does not press it in: nothing of the stiffness is left. It never falls asleep, either."""
    scene = scene_of({"friction": 0.3, "restitution": 0.5}, {"velocity": [0, 0, 0]})
    states = resting(scene, model, 1e-3, 200, 10)
    assert abs(states["position"] - [0, 0, scene.cube.side / 2]).max() < 1e-7
    assert abs(states["velocity"]).max() < 1e-5


def test_out_of_the_ground_a_node_is_lifted_by_a_millimetre_a_second():
    scene = scene_of({"restitution": 0.5}, {"velocity": [0, 0, 0]})
    states = resting(scene, "tumbling", 1e-3, 100, 10, depth=5e-3)
    np.testing.assert_allclose(states["velocity"][:, 2], 1e-3, rtol=2e-4)


def test_a_run_that_leaves_the_numbers_says_nothing(capfd):
    scene = scene_of({"stiffness": 1e8}, {"velocity": [0, 0, -1e305], **TUMBLE})
    states = run(scene, "tumbling", 2000, 20)
    assert not np.isfinite(states["position"][-1]).all()
    assert capfd.readouterr() == ("", "")


def test_to_import_it_prints_nothing():
    code = "import stiffdice.simulation.engines.dart"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.parametrize(
    ("ground", "launch", "named"),
    [
        ({"contact": "ungated", "damping": 0.2}, {}, "ground.contact"),
        ({}, {"angular_momentum": [1, 0, 0], "position": [0, 0, 0.1]}, "launch.node_velocity"),
        ({"stiffness": 0.0}, {}, "ground.stiffness"),
        ({"contact": "ungated"}, {}, None),
        ({"damping": 0.2}, {"angular_momentum": [1, 0, 0]}, None),
    ],
)
def test_it_says_what_it_cannot_represent(ground, launch, named):
    scene = scene_of(ground, launch)
    why = dart.Dart.unfit(scene, "tumbling")
    assert (why is None) == (named is None)
    assert named is None or named in why
    assert dart.Dart.unfit(scene, "flying") is None
    assert why is None or "DART's " in why


def test_the_version_is_told():
    assert dart.Dart.version().startswith("dartpy ")

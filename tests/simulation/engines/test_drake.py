from __future__ import annotations

import logging
import math
import subprocess
import sys

import numpy as np
import pytest

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.dynamics.state import STATE, start_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.run import simulate

pytest.importorskip("pydrake")

from stiffdice.simulation.engines import drake

pytestmark = pytest.mark.long

HALF = 1 / math.sqrt(3)  # of the true cube's side
THROW = {
    "ground": {"stiffness": 100, "damping": 0.5, "friction": 0.1},
    "launch": {"angular_momentum": [0.3, 0.5, 0.2]},
    "duration": 3.0,
}


def flat(height, velocity=(0.0, 0.0, 0.0), gravity=9.8, **ground):
    """A true cube with its lower nodes at a height."""
    return from_mapping(
        {
            "cube": {"geometry": "exact", "inertia": "solid"},
            "ground": {"damping": 0.0, "friction": 0.0, **ground},
            "launch": {"position": [0.3, -0.2, HALF + height], "velocity": list(velocity)},
            "gravity": gravity,
        },
        "corrected",
    )


def run(scene, model, h, samples, every=1):
    states = np.zeros(samples, STATE)
    assert drake.Drake(scene, model, start_of(scene, model), h, 1e-9).advance(states, every) == samples * every
    return states


def bounce(stiffness, damping, omega_h, phase, speed=5.0):
    """Return the speeds at which the path crosses the surface of the ground, downwards and upwards."""
    h = omega_h / math.sqrt(4 * stiffness)
    scene = flat(speed * h * phase, (0.0, 0.0, -speed), stiffness=stiffness, damping=damping)
    last = run(scene, "vertical", h, 1, int(1.5 * math.pi / omega_h) + 30)[0]
    height, lag = last["position"][2] - HALF, engines.adapter_of("drake").LAG * h * scene.gravity
    assert height > 0
    speed_in = math.sqrt((-speed - lag) ** 2 + 2 * scene.gravity * speed * h * phase)
    return speed_in, math.sqrt((last["velocity"][2] - lag) ** 2 + 2 * scene.gravity * height)


@pytest.mark.parametrize("model", ["vertical", "sliding", "tumbling"])
@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e8])
@pytest.mark.parametrize("omega_h", [0.1, 30.0])
def test_a_cube_at_rest_is_as_deep_as_its_weight_takes_it(model, stiffness, omega_h):
    """To SAP's tolerance, 10⁻⁶, however long a step: no stiffness is taken back."""
    scene = flat(-1.3 * 9.8 / (4 * stiffness), stiffness=stiffness, damping=math.sqrt(stiffness), friction=0.3)
    (state,) = run(scene, model, omega_h / math.sqrt(4 * stiffness), 1, 1000)
    assert HALF - state["position"][2] == pytest.approx(linear_theory.sag(scene), rel=2e-6)


@pytest.mark.parametrize("stiffness", [1e2, 1e4, 1e8])
@pytest.mark.parametrize("ratio", [0.0, 0.02, 0.3])
@pytest.mark.parametrize("omega_h", [0.01, 0.1])
def test_a_bounce_is_that_of_a_ground_with_the_dashpot_of_implicit_euler_added(stiffness, ratio, omega_h):
    """Which is S h. Damping itself sets in up to a step late: to first order where there is any, or to second."""
    damping = ratio * math.sqrt(stiffness)
    added = damping + stiffness * omega_h / math.sqrt(4 * stiffness)
    for phase in (0.1, 0.5, 0.9):
        speed_in, speed_out = bounce(stiffness, damping, omega_h, phase)
        whole = flat_bounce.restitution(flat(1.0, stiffness=stiffness, damping=added), speed_in)
        assert abs(speed_out / speed_in - whole) < ratio * omega_h + 0.55 * omega_h**2


@pytest.mark.parametrize("stiffness", [1e4, 1e8])
@pytest.mark.parametrize("omega_h", [0.5, 2.0, 30.0])
def test_however_long_a_step_a_bounce_gains_nothing(stiffness, omega_h):
    """Without weight, so that all of the energy shows in the speed: the cube is thrown out, by as much as it was in."""
    h = omega_h / math.sqrt(4 * stiffness)
    for phase in (0.02, 0.3, 0.6, 0.98):
        scene = flat(5 * h * phase, (0, 0, -5), gravity=0.0, stiffness=stiffness)
        speeds = np.abs(run(scene, "vertical", h, 50)["velocity"][:, 2])
        assert (speeds <= 5 * (1 + 1e-6)).all()
        assert speeds[-1] <= 5 * (1 - phase + 1 / omega_h)


@pytest.mark.parametrize(("model", "lower"), [("tumbling", 0.0), ("flying", 12.0)])
def test_free_flight_is_that_of_symplectic_euler(model, lower):
    """Whence LAG; a step turns by 2 atan(ωh/2), not by ωh. Where no ground acts there is none to fly below, either."""
    scene = from_mapping({"launch": {"angular_momentum": [0.3, 0.5, 0.2]}, "duration": 0.9}, "as_written")
    ours = simulate(scene, model="tumbling", steps=90, every=10).trajectory.state[1:]
    ours["position"][:, 2] -= lower
    launch = start_of(scene, model)
    launch["position"][:, 2] -= lower
    states = np.zeros(9, STATE)
    drake.Drake(scene, model, launch, 0.01, 1e-9).advance(states, 10)
    for name in ("position", "velocity", "angular_momentum", "angular_velocity"):
        np.testing.assert_allclose(states[name], ours[name], rtol=0, atol=1e-12)
    turned = 0.01 * np.linalg.norm(ours["angular_velocity"][0])
    late = 90 * (turned - 2 * math.atan(turned / 2))
    assert np.abs(states["node_offset"] - ours["node_offset"]).max() < late
    lengths = np.linalg.norm(states["node_offset"], axis=2)
    np.testing.assert_allclose(lengths, lengths[0, 0], rtol=1e-14)


@pytest.mark.parametrize(
    "ground", [{"friction": 0.1, "damping": 0}, {"friction": 0, "damping": 0.5, "normal": [0.1, -0.2, 1]}]
)
def test_a_throw_becomes_ours_as_steps_become_short(ground):
    """To first order, where not both friction and damping are there to be coupled; level and on a slope."""
    scene = from_mapping(THROW | {"ground": {"stiffness": 100, **ground}}, "as_written")
    reference = simulate(scene, model="tumbling", scheme="event", steps=30, every=1).trajectory.state[1:]
    coarse, fine = (run(scene, "tumbling", scene.duration / steps, 30, steps // 30) for steps in (6000, 60_000))
    for name in ("position", "velocity", "angular_momentum", "node_offset"):
        off = [np.abs(states[name] - reference[name]).max() for states in (coarse, fine)]
        assert off[1] < off[0] / 8
        assert off[1] < 0.03


def test_friction_on_a_cube_that_does_not_turn():
    """What a bounce takes from the motion along the ground, beside the law's own solution."""
    scene = from_mapping(
        {
            "ground": {"stiffness": 1e4, "damping": 0.2, "friction": 0.3},
            "launch": {"position": [0, 0, 0.6], "velocity": [3, -4, -5]},
            "duration": 0.04,
        },
        "as_written",
    )
    (exactly,) = simulate(scene, model="sliding", scheme="exact", steps=1, every=1).trajectory.state[1:]
    off = []
    for steps in (400, 4000):
        (state,) = run(scene, "sliding", scene.duration / steps, 1, steps)
        assert np.array_equal(state["node_offset"], exactly["node_offset"])
        off.append(np.abs(state["velocity"] - exactly["velocity"]).max())
    assert off[1] < off[0] / 8
    assert off[1] < 0.03


def test_a_node_that_slips_is_pressed_by_more():
    """By (D + S h)·mu·|u_t|, which SAP cannot do without: a sliding cube rides higher, at the height for D/S ago."""
    h, slip = 1e-3, 0.2
    scene = flat(-1.5e-4, (slip, 0, 0), stiffness=1e4, damping=100.0, friction=0.075)
    (state,) = run(scene, "sliding", h, 1, 200)
    left, braked, late = state["velocity"][0], 0.075 * 9.8, 100.0 / 1e4
    assert left == pytest.approx(slip - braked * 200 * h, rel=0.02)
    lift = (100.0 / 1e4 + h) * 0.075 * (left + braked * late)
    assert linear_theory.sag(scene) - (HALF - state["position"][2]) == pytest.approx(lift, rel=0.02)


def test_what_a_model_leaves_out_stays_as_launched():
    scene = flat(0.01, (3.0, 1.0, -5.0), stiffness=1e4, friction=0.3)
    launch = start_of(scene, "vertical")[0]
    for state in run(scene, "vertical", 1e-3, 30):
        assert np.array_equal(state["position"][:2], launch["position"][:2])
        assert not state["velocity"][:2].any()
        assert np.array_equal(state["node_offset"], launch["node_offset"])


def test_a_run_goes_on_where_it_stood_and_may_be_sampled_at_will():
    scene = from_mapping(THROW, "as_written")
    each = run(scene, "tumbling", 1e-3, 1700)
    engine = drake.Drake(scene, "tumbling", start_of(scene, "tumbling"), 1e-3, 1e-9)
    for begin in (0, 600):
        states = np.zeros(600 // 50, STATE)
        engine.advance(states, 50)
        assert states.tobytes() == each[begin + 49 : begin + 600 : 50].tobytes()


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
def test_what_fails_is_not_a_number_for_good_and_says_nothing(model, capfd):
    scene = from_mapping({"ground": {"stiffness": 1e8}}, "as_written")
    engine = drake.Drake(scene, model, start_of(scene, model), 1e3, 1e-9)
    states = np.zeros(4, STATE)
    for _ in range(2):
        assert engine.advance(states, 2) == 0
    for name in ("position", "velocity"):
        assert np.isnan(states[name]).all()
    assert capfd.readouterr() == ("", "")
    assert not logging.getLogger("drake").filters


def test_drake_warns_of_nothing_in_a_process_of_its_own():
    """It does once in each, of half spaces."""
    code = (
        "from stiffdice.simulation.engines import drake; from stiffdice.scene.scene import Scene; "
        "from stiffdice.dynamics.state import start_of; "
        "drake.Drake(Scene(), 'sliding', start_of(Scene(), 'sliding'), 1e-3, 1e-9)"
    )
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.parametrize(
    ("changes", "model", "why"),
    [
        ({"ground": {"contact": "ungated"}}, "sliding", "ground.contact = ungated, ground.damping = 0.2"),
        ({"ground": {"contact": "ungated"}}, "flying", None),
        ({"ground": {"contact": "ungated", "damping": 0}}, "sliding", None),
        ({"ground": {"stiffness": 0}}, "vertical", "ground.stiffness = 0"),
        ({"launch": {"node_velocity": "translation", "angular_momentum": [1, 0, 0]}}, "tumbling", None),
        (
            {"launch": {"node_velocity": "translation", "angular_momentum": [1, 0, 0], "position": [0, 0, 0.5]}},
            "tumbling",
            "launch.node_velocity = translation",
        ),
        ({"ground": {"normal": [0.1, 0, 1]}}, "tumbling", None),
    ],
)
def test_what_drake_cannot_represent_is_said_in_one_sentence(changes, model, why):
    told = drake.Drake.unfit(from_mapping(changes, "as_written"), model)
    assert told is None if why is None else told.startswith(why)


def test_the_version_is_told():
    assert drake.Drake.version().startswith("drake 1.")

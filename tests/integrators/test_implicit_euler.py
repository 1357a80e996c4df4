"""What a step costs and gives that is implicit in the contact force."""

from __future__ import annotations

import numpy as np
import pytest
from tests.integrators.test_registry import HALF, bounced

from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.initial_conditions import phased
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate

SCHEME = "implicit_euler"
PHASES = np.linspace(0.02, 0.98, 13)


@pytest.mark.parametrize("omega_h", [0.01, 0.03, 0.1, 0.3])
@pytest.mark.long
def test_small_steps_eat_part_of_the_bounce(omega_h):
    """By (1 + q²)^(−1/2) a step of q = ωh, over π/q steps, but for parts of a step at both ends, by (1 + q²)^(±1/2)."""
    e = np.sqrt([bounced(omega_h, phase, SCHEME) for phase in PHASES])
    np.testing.assert_allclose(e, np.exp(-np.pi / 2 * omega_h), rtol=0.5 * omega_h**2)


@pytest.mark.parametrize("omega_h", [1.0, 3.0, 10.0, 1e2, 1e4])
def test_large_steps_eat_all_of_it(omega_h):
    e = np.sqrt([bounced(omega_h, phase, SCHEME) for phase in PHASES])
    assert (e < omega_h**-2 * (1 + 1e-12)).all()


def thrown(stiffness, steps, model, **keys):
    ground = {"stiffness": stiffness, "contact": "gated", "friction": 0.3, "damping": 0} | keys
    launch = {"velocity": [2, 1, 3], "angular_momentum": [0.6, 1.0, -0.4]}
    scene = from_mapping({"ground": ground, "launch": launch, "duration": 5.0})
    kept = simulate(scene, model=model, scheme=SCHEME, steps=steps, every=1).trajectory
    return kept, kept.kinetic_energy + kept.potential_energy + kept.elastic_energy


@pytest.mark.parametrize("steps", [100, 1000, 10_000])
@pytest.mark.parametrize("stiffness", [1e2, 1e6, 1e12])
@pytest.mark.parametrize("damping", [0, 5])
def test_no_step_gains_energy_however_stiff_and_coarse(stiffness, steps, damping):
    """The springs' included, on a slope, with friction; the kinetic energy is that of the velocity as it is stored."""
    _, energy = thrown(stiffness, steps, "sliding", damping=damping, normal=[0.2, -0.1, 1])
    assert np.diff(energy).max() < 0


@pytest.mark.long
def test_a_stiff_throw_never_gains_and_comes_to_rest():
    for friction in (0.075, 1.5):
        ground = {"contact": "gated", "stiffness": 1e12, "friction": friction}
        scene = from_mapping({"ground": ground, "launch": {"angular_momentum": [0.3, 0.5, -0.2]}})
        for steps in (300, 3000):
            run = simulate(scene, scheme=SCHEME, steps=steps, members=phased(scene, "tumbling", steps, 32))
            assert (run.verdict == Verdict.PASSED).all()
            assert run.measures["energy_ratio"].max() < 1 + 1e-12
            assert np.abs(run.end["velocity"]).max() < 1e-11
            np.testing.assert_allclose(run.end["position"][:, 2], HALF, rtol=0, atol=1e-11)


def test_a_turning_cubes_arcs_gain_little():
    """Steps of 25 and 2.5 ms, of half a radian and of a twentieth: one may gain, by the arcs, but not much."""
    for stiffness in (1e2, 1e4, 1e12):
        for steps, share in ((200, 0.01), (2000, 2e-4)):
            _, energy = thrown(stiffness, steps, "tumbling")
            assert np.diff(energy).max() < share * energy[0]


@pytest.mark.parametrize("depth", [1e-6, 0.01, 0.4])
def test_what_is_deep_in_the_ground_comes_out_in_a_step(depth):
    """At d/h, which is all that a step can give; the springs held 2·10¹² d² J."""
    h = 1e-3
    launch = {"position": [0, 0, HALF - depth], "velocity": [0, 0, 0]}
    ground = {"stiffness": 1e12, "damping": 0, "contact": "gated"}
    scene = from_mapping({"ground": ground, "launch": launch, "gravity": 0, "duration": h})
    end = simulate(scene, model="sliding", scheme=SCHEME, steps=1, every=1).trajectory.state[-1]
    assert end["velocity"][2] == pytest.approx(depth / h, rel=1e-6)
    assert end["position"][2] == pytest.approx(HALF, abs=1e-6)


def test_a_node_that_leaves_is_not_held_back():
    """Within reach of the ground, rising by more than its depth in a step."""
    launch = {"position": [0, 0, HALF - 0.001], "velocity": [0, 0, 3]}
    ground = {"stiffness": 1e4, "damping": 1, "contact": "gated"}
    scene = from_mapping({"ground": ground, "launch": launch, "gravity": 0, "duration": 1e-3})
    end = simulate(scene, model="sliding", scheme=SCHEME, steps=1, every=1).trajectory.state[-1]
    assert end["velocity"][2] == 3


@pytest.mark.parametrize("stiffness", [1e4, 1e12])
def test_friction_brings_to_a_stand_without_chatter(stiffness):
    """On a slope with mu > tan: never turned around, and then creeping as the regularisation says.

    u/(u + cutoff) = tan/mu. An explicit step would swing by μ g h/2, 1500 times the cutoff here.
    """
    angle, mu, h = np.radians(20), 0.5, 1e-3
    normal, downhill = np.array([np.sin(angle), 0, np.cos(angle)]), np.array([np.cos(angle), 0, -np.sin(angle)])
    launch = {"position": list(HALF * normal), "velocity": list(1.0 * downhill), "orientation": [0, angle, 0]}
    ground = {"stiffness": stiffness, "damping": 20, "friction": mu, "contact": "gated", "normal": list(normal)}
    scene = from_mapping({"ground": ground, "launch": launch, "duration": 4.0})
    speed = simulate(scene, model="sliding", scheme=SCHEME, steps=4000, every=1).trajectory.state["velocity"] @ downhill
    assert (speed > 0).all()
    standing = np.tan(angle) / mu
    assert speed[-1] == pytest.approx(1e-6 * standing / (1 - standing), rel=1e-3)
    slowed = (speed[200] - speed[100]) / (100 * h)
    assert slowed == pytest.approx(9.8 * (np.sin(angle) - mu * np.cos(angle)), rel=0.01)

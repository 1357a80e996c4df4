from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.state import start_of
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.criteria import apex
from stiffdice.simulation.monitor import SIGHT
from stiffdice.simulation.run import simulate

GATED = {"contact": "gated", "friction": 0}
HALF = 1.0352761804100830 / 2  # of the side


def ratio(steps=2000, model="sliding", hop_height=0.0, **keys):
    run = simulate(from_mapping(keys), model=model, steps=steps, hop_height=hop_height)
    return float(run.measures["apex_ratio"][0])


def lift_off_energies(scene, kept, steps):
    """v²/2 [J/kg] at touch-down level of the launch and of each flight, from places alone.

    Two places of a flight, clearances c and d, are on a parabola: halfway between them the cube moves at (d − c)/h and
    is (c + d)/2 + g h²/8 high.
    """
    h = scene.duration / steps
    normal = np.array(scene.ground.normal)
    pull = scene.gravity * normal[2]
    c = ((kept.state["position"][:, None] + kept.state["node_offset"]) @ normal).min(axis=1)
    air = c > 0
    first = np.append(0, np.flatnonzero(air[1:-1] & air[2:] & ~air[:-2]) + 1)
    return ((c[first + 1] - c[first]) / h) ** 2 / 2 + pull * ((c[first] + c[first + 1]) / 2 + pull * h * h / 8)


@pytest.mark.parametrize("contact", ["ungated", "gated"])
@pytest.mark.parametrize("normal", [[0, 0, 1], [0.1, 0, 1]], ids=["flat", "slope"])
@pytest.mark.parametrize("steps", [700, 1300, 10_000, 100_000])
@pytest.mark.parametrize("hop_height", [0.0, 0.1])
def test_it_is_the_square_of_the_speeds_before_and_after(contact, normal, steps, hop_height):
    scene = from_mapping({"ground": {"contact": contact, "normal": normal}})
    run = simulate(scene, model="sliding", steps=steps, every=1, hop_height=hop_height)
    flights = lift_off_energies(scene, run.trajectory, steps)
    sag = 9.8 * scene.ground.normal[2] / (4 * scene.ground.stiffness)
    floor = 9.8 * scene.ground.normal[2] * max(10 * sag, hop_height)
    assert len(flights) > 1
    expected = (flights[1:] / np.maximum(flights[:-1], floor)).max()
    assert run.measures["apex_ratio"][0] == pytest.approx(expected, rel=1e-8)


def test_it_is_the_height_of_a_rebound_over_the_one_before():
    scene = from_mapping({"ground": {"stiffness": 1e6}})
    run = simulate(scene, model="sliding", steps=10_000, every=1)
    z = run.trajectory.state["position"][:, 2] - HALF
    tops = z[1:-1][(z[1:-1] > z[:-2]) & (z[1:-1] >= z[2:])]
    assert run.measures["apex_ratio"][0] == pytest.approx((tops[1:] / tops[:-1]).max(), rel=1e-3)


@pytest.mark.parametrize("n", [2, 3, 4, 12])
@pytest.mark.parametrize("phase", [0.01, 0.3, 0.77])
@pytest.mark.parametrize("normal", [[0, 0, 1], [1, 2, 2]], ids=["flat", "slope"])
def test_without_gravity_magic_steps_give_back_what_they_took(n, phase, normal):
    """At ωh = 2 sin(π/2n) an undamped bounce keeps its energy at every phase."""
    stiffness, speed = 1e4, 3.0
    h = 2 * np.sin(np.pi / (2 * n)) / np.sqrt(4 * stiffness)
    unit = np.array(normal) / np.linalg.norm(normal)
    # Turned with the slope: about the axis across z and the normal.
    turn = np.cross([0, 0, 1], unit)
    angle = np.arccos(unit[2])
    turn = turn / np.linalg.norm(turn) * angle if angle else turn
    launch = {"position": list(unit * (HALF + speed * h * (2 + phase))), "velocity": list(-speed * unit)}
    keys = {"ground": GATED | {"stiffness": stiffness, "damping": 0, "normal": normal}, "gravity": 0}
    assert ratio(60, **keys, launch=launch | {"orientation": list(turn)}, duration=60 * h) == pytest.approx(
        1, abs=1e-11
    )


@pytest.mark.parametrize("omega_h", [0.3, 0.9, 1.6])
def test_off_the_magic_steps_a_bounce_gains_up_to_the_known_bound(omega_h):
    h = omega_h / 200
    keys = {"ground": GATED | {"damping": 0}, "gravity": 0, "duration": 60 * h}
    places = HALF + 3 * h * (2 + np.linspace(0.01, 0.99, 99))
    gains = [ratio(60, **keys, launch={"position": [0, 0, z], "velocity": [0, 0, -3]}) for z in places]
    bound = 1 / (1 - omega_h**2 / 4)
    assert 1 + 0.2 * (bound - 1) < max(gains) <= bound * (1 + 1e-11)
    assert min(gains) < 1


def test_friction_cannot_hide_a_gain():
    """It drains the sliding, and the sliding is not in it."""
    slow, fast = (
        ratio(20_123, ground={"stiffness": 1e6, "contact": "gated", "friction": mu}, launch={"velocity": [v, 0, 5]})
        for mu, v in ((0, 0), (0.6, 20))
    )
    assert slow == fast > 1


@pytest.mark.parametrize(("sags", "expected"), [(2, 0.2), (5, 0.5), (40, 1.0)])
def test_hops_lower_than_ten_sags_are_settling(sags, expected):
    """A cube dropped from fewer sags than ten bounces back to where it was, and that is measured by ten."""
    stiffness = 1e3
    sag = 9.8 / (4 * stiffness)
    launch = {"position": [0, 0, HALF + sags * sag], "velocity": [0, 0, 0]}
    found = ratio(10_000, ground=GATED | {"stiffness": stiffness, "damping": 0}, launch=launch, duration=0.25)
    assert found == pytest.approx(expected, rel=1e-2)


def test_hops_lower_than_the_hop_height_are_not_judged():
    """At ωh = 0.5 and S = 10⁶ as listed hops of a centimetre rise, those of a decimetre do not."""
    scene = {"ground": {"stiffness": 1e6}}
    assert ratio(40_000, hop_height=0.0, **scene, duration=20.0) > 1.1
    assert ratio(40_000, hop_height=0.1, **scene, duration=20.0) < 1.0
    tenth_of_the_radius = simulate(from_mapping(scene), model="sliding", steps=100).hop_height
    assert tenth_of_the_radius == 0.1


def test_a_flight_that_never_tops_out_counts_with_the_top_it_is_bound_for():
    """At ωh = 6.3 the first bounce throws the cube so high that it is still rising at the end."""
    scene = from_mapping({"ground": {"stiffness": 1e7}})
    run = simulate(scene, model="sliding", steps=10_000, every=1)
    kept = run.trajectory
    z, w = kept.state["position"][-1, 2] - HALF, kept.state["velocity"][-1, 2]
    assert w > 0
    first = kept.state["position"][:1500, 2].max() - HALF
    assert run.measures["apex_ratio"][0] == pytest.approx((z + w**2 / 19.6) / first, rel=1e-3)
    assert run.measures["apex_ratio"][0] > 100


def test_a_launch_pressed_into_the_ground_may_rise_by_what_its_springs_hold():
    pressed = {"position": [0, 0, 0.5], "velocity": [0, 0, 0]}
    # At rest in the ground it would sink by the sag; what it holds more than that lifts it.
    sag = 9.8 / 4e4
    held = 4 * 1e4 * (HALF - 0.5) ** 2 / 2
    assert ratio(200_000, ground=GATED | {"damping": 0}, launch=pressed, duration=1.0) == pytest.approx(
        (held - 9.8 * (HALF - 0.5)) / max(held - 9.8 * (HALF - 0.5), 98 * sag), rel=3e-3
    )


@pytest.mark.parametrize("velocity", [[0, 0, -10], [0, 0, 0], [0, 0, 5]])
@pytest.mark.parametrize("steps", [60, 100, 1000])
def test_coarse_steps_make_no_apex_rise_by_themselves(velocity, steps):
    """A flight is measured against the same scheme's flight from the launch, at a magic step: no bounce gains."""
    duration = 4.0
    stiffness = (steps / duration) ** 2 / 4  # ωh = 1
    launch = {"position": [0, 0, 30], "velocity": velocity}
    assert ratio(steps, ground=GATED | {"damping": 0, "stiffness": stiffness}, launch=launch, duration=duration) <= 1.02


def test_no_flight_no_apex():
    lying = {"position": [0, 0, 0.5], "velocity": [0, 0, 0]}
    assert ratio(ground=GATED | {"damping": 10, "stiffness": 100}, launch=lying) == 0


def test_a_one_step_hop_is_no_flight():
    """Above ωh = 2 a cube at rest leaves the ground at every other step, each time higher: hops, until it flies."""
    stiffness = 1e4
    rest = HALF - 9.8 / (4 * stiffness)
    h = 2.2 / np.sqrt(4 * stiffness)
    launch = {"position": [0, 0, rest + 1e-4], "velocity": [0, 0, 0]}
    for steps in range(4, 12):
        scene = from_mapping(
            {"ground": GATED | {"stiffness": stiffness, "damping": 0}, "launch": launch, "duration": steps * h}
        )
        run = simulate(scene, model="sliding", steps=steps, every=1)
        air = (run.trajectory.elastic_energy == 0).tolist()
        flies = any(air[k] and air[k + 1] for k in range(1, steps))
        assert (run.measures["apex_ratio"][0] > 0) == flies
        hopped = any(air[1:])
        if flies:
            break
    assert hopped
    assert flies


def shown(before, speed_out, lifted=1.0):
    """What the criterion says of one flight after another, given its energy before, on stiff ground."""
    state = start_of(from_mapping({"ground": {"stiffness": 1e12}}), "sliding")[0]
    sight, memory = np.zeros(1, SIGHT), np.zeros(apex.SLOTS)
    memory[1] = before
    sight["speed_out"], sight["lifted"], sight["pull"] = speed_out, lifted, 9.8
    return apex.observe(memory, sight[0], None, state, None), memory


def test_only_a_lift_off_is_measured_and_becomes_the_one_before():
    (measure, settled), memory = shown(8.0, 6.0)
    assert (measure, settled, memory[1]) == (18 / 8, False, 18.0)
    (measure, settled), memory = shown(8.0, 6.0, lifted=0.0)
    assert (measure, settled, memory[1]) == (0.0, False, 8.0)

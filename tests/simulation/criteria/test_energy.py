from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation import monitor
from stiffdice.simulation.criteria import energy
from stiffdice.simulation.monitor import SIGHT
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import simulate
from stiffdice.simulation.task import System

GATED = {"contact": "gated", "friction": 0}


def ratio(steps=2000, model="sliding", every=None, **keys):
    return float(simulate(from_mapping(keys), model=model, steps=steps, every=every).measures["energy_ratio"][0])


@pytest.mark.parametrize("velocity", [[5, 0, 5], [0, 0, 0], [1, 2, -7]], ids=["up", "at rest", "down"])
@pytest.mark.parametrize("normal", [[0, 0, 1], [0.3, -0.2, 1]], ids=["flat", "slope"])
@pytest.mark.parametrize(("model", "every"), [("sliding", None), ("sliding", 1), ("tumbling", 1)])
@pytest.mark.parametrize("steps", [1, 4, 30, 1000])
def test_a_flight_keeps_its_energy_at_any_step(velocity, normal, model, every, steps):
    """Symplectic Euler keeps E − m g h w/2: with the velocity at the place, that is E."""
    keys = {"ground": GATED | {"normal": normal}, "launch": {"position": [0, 0, 400], "velocity": velocity}}
    keys["launch"]["angular_momentum"] = [0.3, 0.5, 0.2]
    assert ratio(steps, model, every, **keys, duration=4.0) == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.parametrize("steps", [4, 1000])
@pytest.mark.long
def test_a_flight_neither_gains_nor_loses(model, steps):
    """Whichever of two moments counts as the launch, the other has no more energy."""
    launch = {"position": [0, 0, 400], "velocity": [1, 2, 7], "angular_momentum": [0.3, 0.5, 0.2]}
    scene = from_mapping({"ground": GATED, "launch": launch, "duration": 4.0})
    states = simulate(scene, model=model, steps=steps, every=1).trajectory.state
    physics, sight, slots = physics_of(scene), np.zeros(1, SIGHT), np.zeros(energy.SLOTS)
    system = System(MODELS[model], physics)
    sight["step_size"], sight["lag"] = 4.0 / steps, 0.5
    for first, second in ((0, steps), (steps, 0), (steps // 2, 1), (steps // 4, steps // 2)):
        monitor.start(sight[0], physics, states[first])
        energy.start(slots, sight[0], system, states[first])
        assert energy.observe(slots, sight[0], system, states[second], None)[0] == pytest.approx(1, abs=1e-12)


def airborne_energy(scene, kept, steps):
    """Kinetic + m g z [J] in the air, minus infinity elsewhere, the speed taken from the places."""
    h = scene.duration / steps
    place, g = kept.state["position"], scene.gravity
    between = np.diff(place, axis=0) / h  # halfway between two places; the velocity at the later one is a fall ahead
    velocity = between - [0, 0, g * h / 2]
    spin = (kept.state["angular_momentum"] ** 2).sum(axis=1) / (2 * scene.cube.moment_of_inertia)
    total = 0.5 * scene.cube.mass * ((velocity**2).sum(axis=1) + 2 * g * place[1:, 2]) + spin[1:]
    lowest = (place[:, None] + kept.state["node_offset"]) @ np.array(scene.ground.normal)
    return np.where(lowest.min(axis=1)[1:] > 0, total, -np.inf)


@pytest.mark.parametrize("model", ["sliding", "tumbling"])
@pytest.mark.parametrize("normal", [[0, 0, 1], [0.1, -0.2, 1]], ids=["flat", "slope"])
@pytest.mark.parametrize(("stiffness", "steps"), [(1e6, 10_000), (1e6, 23_456), (1e4, 700)])
def test_it_is_the_largest_airborne_energy_above_that_of_rest(model, normal, stiffness, steps):
    ground = {"stiffness": stiffness, "contact": "gated", "normal": normal}
    scene = from_mapping({"ground": ground, "launch": {"angular_momentum": [0.1, 0.3, 0.2]}})
    run = simulate(scene, model=model, steps=steps, every=1)
    energy = airborne_energy(scene, run.trajectory, steps)
    tilt = scene.ground.normal[2]
    start = energy[0]  # the gated law leaves the launch's flight alone
    sag = scene.gravity * tilt / (4 * stiffness)
    gain_counts_by = run.trajectory.kinetic_energy[0] + 9.8 * tilt * (3 * tilt - scene.cube.side / 2 + sag / 2)
    expected = 1 + (energy.max() - start) / gain_counts_by
    assert run.measures["energy_ratio"][0] == pytest.approx(expected, rel=1e-9)


@pytest.mark.long
def test_it_counts_only_the_air():
    """In the ground kinetic + m g z says nothing: the springs are not in it."""
    scene = from_mapping({})
    physics, state = physics_of(scene), start_of(scene, "tumbling")
    sight, slots = np.zeros(1, SIGHT), np.zeros(energy.SLOTS)
    sight["step_size"], sight["lag"] = 1e-3, 0.5
    monitor.start(sight[0], physics, state[0])
    system = System(MODELS["tumbling"], physics)
    energy.start(slots, sight[0], system, state[0])
    state["velocity"] *= 10
    for flight, expected in ((0, 1), (1, 50)):
        sight["flight"] = flight
        measure, settled = energy.observe(slots, sight[0], system, state[0], None)
        assert measure == pytest.approx(expected, rel=0.1)
        assert not settled


def test_a_cube_that_never_leaves_the_ground_is_judged_by_its_mechanical_energy():
    lying = {"position": [0, 0, 0.5], "velocity": [0, 0, 0]}
    assert ratio(ground=GATED | {"damping": 10, "stiffness": 100}, launch=lying) == 1
    swinging = {"position": [0, 0, 0.49], "velocity": [0, 0, 0]}  # by half its sag, undamped
    ground = GATED | {"damping": 0, "friction": 0, "stiffness": 200}
    assert ratio(3_000, "sliding", 1, ground=ground, launch=swinging) == pytest.approx(1, abs=3e-3)
    assert ratio(30_000, "sliding", 1, ground=ground, launch=swinging) == pytest.approx(1, abs=1e-5)


@pytest.mark.parametrize("every", [None, 1])
@pytest.mark.parametrize("height", [0.4, 0.5, 0.5176, 0.53], ids=["pressed", "lying", "touching", "dropped"])
def test_friction_that_speeds_a_cube_up_on_the_ground_is_seen(height, every):
    """A push of regularised friction in one step is up to mu h times the normal force: far beyond the speed here."""
    ground = GATED | {"stiffness": 100.0, "damping": 5.0, "friction": 10.0}
    keys = {"ground": ground, "launch": {"position": [0, 0, height], "velocity": [1, 0, 0]}}
    slides = simulate(from_mapping(keys), model="sliding", steps=500, every=1).trajectory.state["velocity"][:, 0]
    assert np.abs(slides).max() > 1.3
    assert ratio(500, "sliding", every, **keys) > 1.05


def test_a_cube_that_ends_on_the_ground_faster_than_its_energy_allows_is_seen():
    """On the last of these steps it lands, and friction throws it along; nothing in the air tells."""
    ground = GATED | {"stiffness": 100.0, "damping": 5.0, "friction": 10.0}
    keys = {"ground": ground, "launch": {"position": [0, 0, 0.6], "velocity": [1, 0, 0]}}
    states = simulate(from_mapping(keys), model="sliding", steps=500, every=1).trajectory.state
    fastest = int(np.abs(states["velocity"][:, 0]).argmax())
    shorter = keys | {"duration": 10 * fastest / 500}
    assert states["position"][fastest, 2] < Scene().cube.side / 2
    for every in (None, 1):
        assert ratio(fastest, "sliding", every, **shorter) > 5


def test_an_energy_beyond_doubles_is_no_pass():
    run = simulate(from_mapping({"launch": {"velocity": [0, 0, 1e160]}}), model="sliding", steps=100)
    assert Verdict(run.verdict[0]) == Verdict.LEFT_NUMERIC_RANGE


def test_a_launch_from_inside_the_ground_is_measured_with_its_springs_energy():
    deep = {"position": [0, 0, 0.4], "velocity": [0, 0, 0]}
    assert ratio(100_000, ground=GATED | {"damping": 0}, launch=deep) == pytest.approx(1, abs=2e-3)


def test_energy_on_a_slope_is_counted_from_the_ground_below():
    """A thousand metres down the hill m g z is far below zero; what is left is still the launch's energy."""
    keys = {"ground": GATED | {"damping": 0, "normal": [1, 0, 1]}, "launch": {"velocity": [0, 0, 0]}}
    assert ratio(200_000, **keys) == pytest.approx(1, abs=1e-2)


def test_a_gain_counts_the_same_however_high_the_ground_lies_above_where_the_cube_can_come():
    """At rest on the ground a cube still has m g s/2: it can never give that back, and it must not dilute a gain."""
    ratios = [
        ratio(
            900,  # ωh = 1.56
            cube={"radius": radius, "geometry": "exact"},
            ground=GATED | {"stiffness": 1e6},
            launch={"position": [0, 0, radius / np.sqrt(3) + 2], "velocity": [0, 0, 0]},
            duration=0.7,  # one bounce
        )
        for radius in (0.1, 1.0, 20.0)
    ]
    assert ratios[0] > 1.05
    np.testing.assert_allclose(ratios, ratios[0], rtol=1e-6)


def test_the_papers_figure_ten():
    """From 54.4 J to 96.1 J, of which rest has 5.1 J."""
    assert ratio(10_000, ground={"stiffness": 1e6}) == pytest.approx(1 + (96.1 - 54.4) / (54.4 - 5.07), abs=2e-3)

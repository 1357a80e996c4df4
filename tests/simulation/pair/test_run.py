"""A run of two boxes: what it keeps, how it converges, and when it ends."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.dynamics.box_contact.pair_state import pair_start_of
from stiffdice.errors import InputError
from stiffdice.integrators.registry import OF_PAIRS
from stiffdice.scene.pair import from_mapping
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.pair.run import simulate_pair


def meeting(second=None, ground=None, **more):
    """Return the scene of two cubes in the air, turned and spinning, that meet once."""
    first = {"position": [0, 0, 10], "velocity": [0.3, 0.1, 1], "orientation": [0.3, 0.2, 0.1]}
    first["angular_momentum"] = [0.1, 0.05, 0]
    launch = {"position": [0.2, 0.1, 11.8], "velocity": [0, 0, -1], "orientation": [0.5, -0.2, 0.8], **(second or {})}
    return from_mapping(
        {
            "cubes": [{"cube": {"side": 1.0}, "launch": first}, {"cube": {"side": 1.0}, "launch": launch}],
            "ground": {"stiffness": 1e4, "damping": 0, "friction": 0, **(ground or {})},
            "gravity": 0,
            "duration": 1.0,
            **more,
        }
    )


def momenta(scene, state):
    """Return linear and angular momentum of both together, about the origin."""
    linear, angular = np.zeros(3), np.zeros(3)
    for name, cube in zip("ab", scene.cubes, strict=True):
        body = state[name]
        linear = linear + cube.mass * body["velocity"]
        angular = angular + np.cross(body["position"], cube.mass * body["velocity"]) + body["angular_momentum"]
    return linear, angular


@pytest.mark.parametrize("ground", [{}, {"damping": 2.0, "friction": 0.3}])
@pytest.mark.parametrize("scheme", [name for name in OF_PAIRS if name != "forward_euler"])
def test_a_meeting_keeps_momentum(scheme, ground):
    """Linear momentum in every scheme; angular momentum where places move with the velocity that was kicked."""
    scene = meeting(ground=ground)
    run = simulate_pair(scene, scheme=scheme, steps=4_000, every=4_000)
    (linear, angular), (after, turned) = (momenta(scene, run.trajectory.state[k]) for k in (0, -1))
    assert run.meetings[0] > 0
    assert after == pytest.approx(linear, abs=1e-14)
    assert turned == pytest.approx(angular, abs=1e-10 if scheme == "rk4" else 3e-12)  # places of 10 m, 4,000 times


@pytest.mark.parametrize("scheme", OF_PAIRS)
def test_energy_that_nothing_takes_is_there_again_after_the_meeting(scheme):
    order, off = (1 if scheme == "forward_euler" else 2), []
    for steps in (1_000, 16_000):
        energy = simulate_pair(meeting(), scheme=scheme, steps=steps, every=steps).trajectory.kinetic_energy
        off.append(abs(energy[-1] / energy[0] - 1))
    assert off[1] < (5e-2 if order == 1 else 1e-4)
    assert off[1] < off[0] / 16 ** (0.7 * order)


def test_energies_add_up_while_the_boxes_touch():
    run = simulate_pair(meeting(), scheme="velocity_verlet", steps=20_000, every=1)
    energy = run.trajectory.mechanical_energy
    assert run.trajectory.contact_energy.max() > 0.1
    assert np.ptp(energy) < 5e-5 * energy[0]


def test_many_launches_run_as_each_alone():
    scene = meeting()
    states = np.repeat(pair_start_of(scene), 3)
    states[1]["b"]["position"][0] += 0.1
    many = simulate_pair(scene, steps=3_000, launches=states)
    for k in range(3):
        one = simulate_pair(scene, steps=3_000, launches=states[k : k + 1])
        assert many.end[k] == one.end[0]
        assert many.verdict[k] == one.verdict[0] == Verdict.PASSED
    assert many.end[0] == simulate_pair(scene, steps=3_000).end[0]


def test_flights_are_taken_at_once_as_step_by_step():
    """A sample at each step leaves no room for that."""
    scene = meeting(second={"position": [0.2, 0.1, 14.8]}, gravity=9.8, duration=2.5, ground={"damping": 0.5})
    once, stepped = simulate_pair(scene, steps=20_000), simulate_pair(scene, steps=20_000, every=1)
    assert once.meetings[0] == stepped.meetings[0] == 1
    for name in "ab":
        for part in ("position", "velocity", "node_offset"):
            assert once.end[name][part] == pytest.approx(stepped.end[name][part], abs=1e-8)


def test_boxes_that_may_have_passed_through_each_other_are_deep():
    fast = meeting(second={"velocity": [0, 0, -40]}, ground={"stiffness": 100.0})
    coarse = simulate_pair(meeting(second={"velocity": [0, 0, -4000]}), steps=1_000)
    for run in (simulate_pair(fast, steps=10_000), coarse):
        assert run.verdict[0] == Verdict.DEEP
        assert run.steps_done[0] < run.steps


def test_steps_beyond_the_limit_give_energy():
    """Flush head on: ω² = 8 S/m, so that ω h passes 2 between 141 and 142 steps."""
    launch = {"position": [0, 0, 11.0005], "velocity": [0, 0, -1], "orientation": [0, 0, 0]}
    scene = meeting(second=launch)
    still = {"position": [0, 0, 10], "velocity": [0, 0, 0], "orientation": [0, 0, 0]}
    scene = from_mapping(
        {
            **scene.as_mapping(),
            "cubes": [{"cube": {"side": 1.0}, "launch": still}, {"cube": {"side": 1.0}, "launch": launch}],
        }
    )
    assert simulate_pair(scene, steps=2_000).verdict[0] == Verdict.PASSED
    assert simulate_pair(scene, steps=130).verdict[0] in (Verdict.ENERGY_GREW, Verdict.DEEP)


@pytest.mark.parametrize("scheme", ["event", "exact", "implicit_euler", "magic"])
def test_a_scheme_that_does_not_apply_is_refused_in_one_line(scheme):
    with pytest.raises(InputError, match=f"scheme = {scheme}: allowed is") as told:
        simulate_pair(meeting(), scheme=scheme)
    assert "\n" not in str(told.value)


def test_a_trajectory_is_of_one_launch():
    states = np.repeat(pair_start_of(meeting()), 2)
    with pytest.raises(InputError, match="every = 1: allowed is 0"):
        simulate_pair(meeting(), steps=10, every=1, launches=states)

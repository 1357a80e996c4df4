"""Where the energy of two cubes goes: every joule of either is booked, and what is booked is what forces do."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.scene import pair
from stiffdice.simulation.pair import energy_budget
from stiffdice.simulation.pair.run import simulate_pair

SCENES = Path(__file__).parents[3] / "config" / "scenes"
ROUND_OFF = 1e-12  # of some thousand steps, relative to the energy


def scene_of(*changes, name="two-cubes"):
    return pair.load(SCENES / f"{name}.yaml", changes)


def booked(scene, **options):
    return {name: part.values for name, part in energy_budget.ledger(scene, **options).data_vars.items()}


def works_of(found):
    return sum(found[f"body_{name}"] for name in energy_budget.WORKS if name != "kick_defect")


@pytest.fixture(scope="module")
def found():
    return booked(scene_of(), steps=5000, every=5)


def test_what_forces_work_on_a_cube_is_what_its_kinetic_energy_gains(found):
    kinetic = found["body_kinetic_energy"]
    assert kinetic.shape == (1001, 2)
    assert np.abs(works_of(found)).max() > 5
    np.testing.assert_allclose(works_of(found), kinetic - kinetic[0], rtol=0, atol=ROUND_OFF * kinetic.max())
    assert np.abs(found["body_kick_defect"]).max() < ROUND_OFF * kinetic.max()


def test_what_both_lose_is_damped_rubbed_off_or_the_schemes(found):
    energy = found["booked_energy"]
    lost = found["damping_work"] + found["friction_work"] + found["scheme_work"]
    np.testing.assert_allclose(lost, energy - energy[0], rtol=0, atol=ROUND_OFF * energy[0])
    assert energy[-1] < 0.2 * energy[0]  # they have come to rest


@pytest.mark.parametrize("every", [5, 250])
def test_the_ledger_is_of_the_very_run(every):
    """Also where the run takes its flights at once: it keeps a state every 250 steps."""
    run, found = simulate_pair(scene_of(), steps=5000, every=every), booked(scene_of(), steps=5000, every=every)
    kinetic = found["body_kinetic_energy"]
    np.testing.assert_array_equal(kinetic.sum(axis=1), run.trajectory.kinetic_energy)
    np.testing.assert_allclose(works_of(found), kinetic - kinetic[0], rtol=0, atol=ROUND_OFF * kinetic.max())


def test_springs_work_while_the_cubes_touch(found):
    run = simulate_pair(scene_of(), steps=5000, every=5)
    meeting = run.trajectory.contact_energy > 0
    first = int(meeting.argmax())
    assert not found["body_contact_spring_work"][:first].any()
    assert found["body_contact_spring_work"][first + 1].any()


def test_friction_and_damping_only_take_energy_from_both(found):
    """The contact's parts may give to one cube what they take from the other."""
    for part in ("damping", "friction"):
        total = found[f"body_contact_{part}_work"].sum(axis=1)
        assert total[-1] < -0.1
        assert np.diff(total).max() < 1e-6 * -total[-1]
    assert (found["body_ground_damping_work"][-1] < 0).all()


@pytest.mark.parametrize(("absent", "present"), [("damping", "friction"), ("friction", "damping")])
def test_what_is_not_there_does_not_work(absent, present):
    found = booked(scene_of(f"ground.{absent}=0", "duration=1"), steps=4000, every=4000)
    for where in ("ground", "contact"):
        assert not found[f"body_{where}_{absent}_work"].any()
        assert found[f"body_{where}_{present}_work"].sum() < -0.01
    assert found[f"{absent}_work"][-1] == 0
    assert found[f"{present}_work"][-1] < -0.2


def test_without_damping_and_friction_springs_give_back_what_they_took():
    """In the air of one meeting, without ground: the springs' work on both is nothing but the scheme's error."""
    scene = scene_of("ground.damping=0", "ground.friction=0", "gravity=0", "duration=0.6")
    errors = []
    for steps in (2000, 8000):
        found = booked(scene, steps=steps, every=steps)
        for name in ("damping", "friction"):
            assert not found[f"body_contact_{name}_work"].any()
        given = found["body_contact_spring_work"][-1]
        assert np.abs(given).min() > 0.5  # one cube pushes the other
        assert given.sum() == pytest.approx(found["spring_defect"][-1], abs=1e-13)
        errors.append(abs(given.sum()))
    assert errors[0] < 0.02
    assert errors[1] < errors[0] / 2


def test_gravity_works_what_the_potential_energy_gives_up():
    scene = scene_of("cubes.0.launch.position=[0, 0, 50]", "cubes.1.launch.position=[9, 0, 50]", "duration=1")
    found = booked(scene, steps=1000, every=1000)
    fallen = 0.5 * 9.8 - 1.2  # m, from 1.2 m/s upwards
    assert found["body_gravity_work"][-1] == pytest.approx(2 * [9.8 * fallen], rel=2e-3)  # first order
    assert abs(found["gravity_defect"][-1]) < 1e-10
    for name in energy_budget.WORKS:
        if name not in ("gravity_work", "kick_defect"):
            assert not found[f"body_{name}"].any(), name


def test_the_free_turning_of_a_box_is_the_schemes():
    scene = scene_of("cubes.0.cube.sides=[0.3, 0.4, 0.5]", "cubes.0.launch.angular_momentum=[0.3, 0.2, 0.1]")
    found = booked(scene, steps=5000, every=5)
    kinetic = found["body_kinetic_energy"]
    gained = works_of(found) + found["body_kick_defect"]
    np.testing.assert_allclose(gained, kinetic - kinetic[0], rtol=0, atol=ROUND_OFF * kinetic.max())
    assert 1e-9 < np.abs(found["body_kick_defect"][:, 0]).max() < 1e-2
    assert np.abs(found["body_kick_defect"][:, 1]).max() < ROUND_OFF * kinetic.max()


def test_every_is_checked():
    with pytest.raises(InputError, match="every = 7: allowed is a whole number from 1 to 5"):
        energy_budget.ledger(scene_of(), steps=5, every=7)

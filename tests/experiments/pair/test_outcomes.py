from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.pair import outcomes
from stiffdice.scene import scene as scenes
from stiffdice.simulation.pair.run import simulate_pair

SCENE = scenes.load(Path(__file__).parents[3] / "config/scenes/equal-cubes.yaml")
SIDE = SCENE.cube.side
OFFSET = [0.0, 0.2, 0.45, 1.1, 1.2]
GROUND = {"friction": 0.4, "stiffness": 1e4, "damping": 5.0}
pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def found():
    return outcomes.measure(SCENE, offset=OFFSET, friction=[0.0, 0.4], restitution=[1.0, 0.5], stiffness=1e4)


def test_both_momenta_are_kept(found):
    total = found.velocity.sum("body").values
    np.testing.assert_allclose(total - [1, 0, 0], 0, atol=1e-11)
    pair, launches = outcomes.launched(SCENE, "turned", OFFSET, 1.0, **GROUND)
    run = simulate_pair(pair, scheme="velocity_verlet", steps=20_000, launches=launches)
    before, after = (
        sum(states[k]["angular_momentum"] + np.cross(states[k]["position"], states[k]["velocity"]) for k in "ab")
        for states in (launches, run.end)
    )
    np.testing.assert_allclose(after - before, 0, atol=1e-10)


def test_energy_is_kept_without_damping_and_friction_and_lost_with_them(found):
    total = found.energy.sum("body")
    np.testing.assert_allclose(total.sel(restitution=1, friction=0), 1, atol=1e-3)
    assert (total <= 1 + 1e-3).all()
    assert (total.sel(restitution=0.5, offset=[0.0, 0.2]) < 0.75).all()


def test_a_meeting_without_friction_is_one_impulse(found):
    """As far as the cubes meet once, and as the force stays where it began: the contact is short."""
    elastic = found.sel(friction=0, restitution=1)
    once = elastic.meetings == 1
    np.testing.assert_allclose(elastic.spin.where(once), elastic.impulse_spin.where(once), atol=0.02 / SIDE)
    along = found.velocity.isel(pose=0, axis=0).sel(friction=0, offset=0)
    np.testing.assert_allclose(along, [[0, 1], [0.25, 0.75]], atol=1e-3)


def test_cubes_that_miss_each_other_go_on(found):
    assert (found.meetings.isel(pose=0).sel(offset=[1.1, 1.2]) == 0).all()
    assert np.isnan(found.impulse_spin.isel(pose=0).sel(offset=1.2)).all()
    assert (found.meetings.isel(pose=1).sel(offset=[1.1, 1.2]) >= 1).all()


def test_who_moves_with_the_launch_sees_the_same_spins_and_both_cubes_get_the_same():
    """Equal but for contact's depth, some 4e-4 sides, at which friction acts on the one whose face it is below."""
    ends = []
    for drift in (0.0, 0.5, 1.0):
        stiff = GROUND | {"stiffness": 1e6, "damping": 50.0}
        pair, launches = outcomes.launched(SCENE, "parallel", [0.2, 0.45], 1.0, drift, **stiff)
        run = simulate_pair(pair, scheme="velocity_verlet", steps=200_000, launches=launches)
        ends.append(np.array([run.end[k]["angular_velocity"][:, 2] for k in "ab"]))
    np.testing.assert_allclose(ends[1], ends[0], atol=3e-3)
    np.testing.assert_allclose(ends[2], ends[0], atol=3e-3)
    np.testing.assert_allclose(ends[0][0], ends[0][1], atol=3e-3)


def test_half_the_step_changes_little(found):
    assert float(found.spin_error.where(found.meetings < 2).max()) * SIDE < 0.01


@pytest.mark.parametrize("options", [{"offset": [1.3]}, {"restitution": [0.0]}, {"friction": [-1.0]}, {"omega_h": 0.0}])
def test_options_out_of_range_are_told(options):
    with pytest.raises(InputError, match=next(iter(options))):
        outcomes.measure(SCENE, **options)

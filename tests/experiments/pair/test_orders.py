from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.pair import orders
from stiffdice.integrators import registry as schemes
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene import scene as scenes

SCENE = scenes.load(Path(__file__).parents[3] / "config/scenes/equal-cubes.yaml")
pytestmark = pytest.mark.long


@pytest.fixture(scope="module")
def found():
    return orders.measure(SCENE, steps=[4, 8, 16, 32, 64, 128, 256, 512, 1024])


def order(found, stretch, method, damping):
    there = found.order.isel(stretch=orders.STRETCHES.index(stretch), method=meanings_of(found.method).index(method))
    return float(there.sel(damping=damping))


def test_schemes_have_their_order_while_the_contacts_stay(found):
    wanted = {"symplectic_euler": 1, "forward_euler": 1, "velocity_verlet": 2, "rk4": 4}
    assert set(meanings_of(found.method)) == set(schemes.OF_PAIRS) == set(wanted)
    for damping in found.damping.values:
        for method, number in wanted.items():
            assert order(found, "held", method, damping) == pytest.approx(number, abs=0.25), (method, damping)


def test_what_is_not_smooth_costs_order(found):
    """A touch bends the force: no more than 2; with damping, and where contacts are handed over, it jumps: 1."""
    assert order(found, "touch", "velocity_verlet", 0.0) == pytest.approx(2, abs=0.4)
    assert order(found, "touch", "rk4", 0.0) < 2.5
    for method in ("velocity_verlet", "rk4"):
        assert order(found, "touch", method, 1.0) == pytest.approx(1, abs=0.4)
        assert order(found, "handed", method, 0.0) == pytest.approx(1, abs=0.5)


def test_a_launch_in_the_air_makes_velocity_verlet_of_symplectic_euler(found):
    """The same steps, seen half a step apart: as far as nothing depends on velocity."""
    euler, verlet = (meanings_of(found.method).index(name) for name in ("symplectic_euler", "velocity_verlet"))
    errors = found.error.sel(damping=0).isel(stretch=orders.STRETCHES.index("touch"))
    np.testing.assert_allclose(errors[euler], errors[verlet], rtol=1e-3, atol=1e-12)


def test_a_motion_without_contacts_that_are_handed_over_is_told():
    with pytest.raises(InputError, match="one set of contacts"):
        orders.measure(SCENE, stiffness=1e6, damping=[0.0])

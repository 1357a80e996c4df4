"""Steps of spheres in contact: packings are unstable beyond the linear limit, and impacts gain energy there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments import granular
from stiffdice.experiments.granular import PACKINGS, hertz_impact, largest_square, restitutions, yade_step
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene.scene import Scene

# ω² in k/m: opposite motion of a pair, of all neighbours in a row, of layers of a cubic packing. A row of n has
# 2 (1 + cos(π/n)) where both ends are held.
SQUARES = {"pair": 2, "between_walls": 2, "row": 2 * (1 + math.cos(math.pi / 59)), "cubic": 4, "face_centred": 8}


@pytest.mark.parametrize("name", PACKINGS)
def test_the_largest_frequency_is_that_of_the_textbooks(name):
    assert largest_square(PACKINGS[name]) == pytest.approx(SQUARES[name], rel=1e-12)
    neighbours = {"cubic": 6, "face_centred": 12}.get(name)
    if neighbours:
        assert len(PACKINGS[name].pairs) * 2 == neighbours * len(PACKINGS[name].places)


def test_yades_rule_is_exact_where_neighbours_move_against_each_other_and_never_too_long():
    for name, packing in PACKINGS.items():
        stable = 2 / math.sqrt(largest_square(packing))
        assert yade_step(packing) <= stable * (1 + 1e-12)
        if name in ("pair", "cubic", "face_centred"):
            assert yade_step(packing) == pytest.approx(stable, rel=1e-12)


@pytest.mark.parametrize("force", granular.FORCES)
@pytest.mark.parametrize("name", ["pair", "between_walls", "row", "cubic"])
def test_nudges_grow_beyond_the_linear_limit_and_not_below(name, force):
    """Nudges are a thousandth of the overlap: so much Hertz' slope changes."""
    stable = 2 / math.sqrt(SQUARES[name])
    assert not granular._grows(PACKINGS[name], force, 0.998 * stable)
    assert granular._grows(PACKINGS[name], force, 1.003 * stable)


@pytest.mark.parametrize("name", PACKINGS)
def test_packings_fly_apart_at_steps_that_exadems_rule_calls_correctly_defined(name):
    assert granular._grows(PACKINGS[name], "linear", 0.99 * math.pi)


@pytest.mark.long
def test_the_table_has_theory_and_measurement_in_one():
    found = granular.steps(Scene())
    for k, name in enumerate(meanings_of(found.packing)):
        assert found.measured[k].values == pytest.approx(float(found.theory[k]), rel=2e-3), name
        assert found.exadem[k] > 2.2 * found.theory[k]


def test_an_impact_lasts_as_long_as_it_should():
    assert granular.duration("linear") == pytest.approx(math.pi, rel=1e-14)
    assert granular.duration("hertz") == pytest.approx(2.943275, rel=1e-6)  # Landau and Lifshitz, Elasticity, § 9
    impact = hertz_impact(1e-3, 2500.0, 7e10, 0.25, 1.0)
    mass, radius, modulus = 2 / 3 * math.pi * 2500e-9, 5e-4, 7e10 / (2 * (1 - 0.25**2))
    assert impact.duration == pytest.approx(2.87 * (mass**2 / (radius * modulus**2)) ** 0.2, rel=2e-3)


@pytest.mark.parametrize("force", granular.FORCES)
def test_short_steps_give_back_all_and_long_ones_more(force):
    assert restitutions(force, 0.005, 32) == pytest.approx(1.0, abs=2e-5)
    assert restitutions(force, 0.2, 64).max() < 1.01
    assert restitutions(force, math.sqrt(2), 64).max() > 3.5  # by exaDEM's rule "correctly defined"


def test_an_impact_of_the_linear_force_is_the_bounce_of_the_ground():
    """δ'' = −ω² δ: below the limit e² is at most 1/(1 − (ωh)²/4)."""
    for part in (0.1, 0.3, 0.6):
        omega_h = math.pi * part
        assert (restitutions("linear", part, 128) ** 2).max() <= 1 / (1 - omega_h**2 / 4) * (1 + 1e-12)


def test_values_out_of_range_are_refused():
    for options in ({"step": [0.0]}, {"step": []}, {"phases": 0}):
        with pytest.raises(InputError):
            granular.impacts(Scene(), **options)
    with pytest.raises(InputError, match="young"):
        granular.beads(Scene(), young=[-1.0])


def test_the_hertz_time_is_four_stable_steps_of_a_packing_whatever_the_material():
    found = granular.beads(Scene())
    assert np.ptp((found.stable_face_centred / found.hertz).values) < 1e-12
    assert float((found.stable_face_centred / found.hertz)[0, 0]) == pytest.approx(0.248, abs=1e-3)

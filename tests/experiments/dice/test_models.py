"""What formulas say of square boxes: a third at the cube, all or nothing at the ends, and known slopes."""

from __future__ import annotations

import numpy as np
import pytest

from stiffdice.experiments.dice import models

MODELS = [models.solid_angle, models.pender_uhrin, lambda c: models.gibbs(c, 8.0)]


@pytest.mark.parametrize("model", MODELS)
def test_a_cube_is_fair_a_coin_lands_flat_and_a_rod_on_its_side(model):
    assert float(model(1.0)) == pytest.approx(1 / 3, abs=1e-15)
    assert float(model(1e-3)) > 0.95
    assert float(model(1e3)) < 0.05
    assert (np.diff(model(np.geomspace(0.4, 2.7, 50))) < 0).all()


def test_the_solid_angle_is_the_part_of_random_directions():
    directions = np.random.default_rng(0).standard_normal((200_000, 3))
    for c in (0.5, 1.0, 1.7):
        on_end = (np.abs(directions) / [1, 1, c]).argmax(axis=1) == 2
        assert on_end.mean() == pytest.approx(float(models.solid_angle(c)), abs=5 * 0.5 / np.sqrt(200_000))


def test_slopes_at_the_cube_are_those_of_the_formulas():
    assert models.slope(models.solid_angle(models.NEAR_CUBE)) == pytest.approx(-2 * np.sqrt(3) / np.pi, rel=1e-6)
    assert models.slope(models.gibbs(models.NEAR_CUBE, 9.0)) == pytest.approx(-9 / 3, rel=1e-6)
    of_pender_uhrin = -2 / 3 * (1 + np.sqrt(2) + 4 / np.pi)
    assert models.slope(models.pender_uhrin(models.NEAR_CUBE)) == pytest.approx(of_pender_uhrin, rel=1e-6)


def test_in_two_dimensions_the_odds_turn_over_with_the_sides():
    odds = [models.pender_uhrin(c) / (1 - models.pender_uhrin(c)) * 2 for c in (1.7, 1 / 1.7)]
    assert odds[0] * odds[1] == pytest.approx(1, rel=1e-12)


def test_the_likeliest_beta_is_found():
    aspect, throws = np.array([0.5, 0.8, 1.2, 2.0]), np.full(4, 1e6)
    assert models.fitted_beta(aspect, throws * models.gibbs(aspect, 7.3), throws) == pytest.approx(7.3, rel=1e-9)

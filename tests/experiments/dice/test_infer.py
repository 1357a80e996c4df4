"""A die is found again from its counts; what is not known of the throw widens the answer, and what is told of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.experiments.dice import infer, response_table
from stiffdice.experiments.dice.axes import FACES, PAIRS
from stiffdice.experiments.dice.response_table import Table
from stiffdice.experiments.dice.rolls import Rolls, load

ROOT = Path(__file__).parents[3]
SHIPPED = response_table.load(response_table.SHIPPED)
LABBY, RED, WHITE = (
    load(ROOT / f"config/measurements/{name}.yaml") for name in ("labby-2009", "wolf-red", "wolf-white")
)


def known(chi=-3.0, curvature=-3.0, psi=-8.0, error=0.0):
    values = {"chi": chi, "curvature": curvature, "psi": psi}
    grids = {name: np.full((1, 1), value) for name, value in values.items()}
    grids |= {f"{name}_error": np.full((1, 1), error * abs(value)) for name, value in values.items()}
    return Table("known", np.array([0.45]), np.array([0.2]), grids, 0.2)


def probabilities(y, offset, chi=-3.0, curvature=-3.0, psi=-8.0):
    """Of the faces 1 to 6, by the definition of the coefficients."""
    y = np.array(y) - np.mean(y)
    pairs = np.exp(1.5 * chi * y + curvature * y * y)
    p = np.empty(6)
    for (a, b), pair, d in zip(FACES, pairs / pairs.sum(), offset, strict=True):
        p[a - 1], p[b - 1] = pair / (1 + np.exp(-psi * d)), pair / (1 + np.exp(psi * d))
    return p


def middles(samples):
    return [infer.interval(samples[:, k])[0] for k in range(3)]


def test_a_known_die_is_found_again():
    y, offset = np.array([-0.05, 0.02, 0.03]), (0.01, -0.02, 0.0)
    counts = Rolls(tuple(int(n) for n in np.rint(1e9 * probabilities(y, offset))))
    found = infer.posterior(counts, [known()], samples=4000)
    np.testing.assert_allclose(middles(found.length), np.exp(1.5 * y) - 1, atol=2e-5)
    np.testing.assert_allclose(middles(found.offset), offset, atol=2e-5)
    assert found.beyond == 0


def test_for_many_rolls_the_posterior_is_the_one_of_the_linear_law():
    """Independently: the error of a logarithm of odds, over the coefficient."""
    n = 60_000
    found = infer.posterior(Rolls((n,) * 6), [known(curvature=0.0)], samples=40_000)
    odds = np.sqrt(1 / (2 * n) + 1 / (4 * n))  # of a pair against the geometric mean of two others
    np.testing.assert_allclose(found.length.std(axis=0), odds / (1.5 * 3.0), rtol=0.03)
    np.testing.assert_allclose(found.offset.std(axis=0), np.sqrt(2 / n) / 8.0, rtol=0.03)


@pytest.mark.long
def test_intervals_hold_the_truth_as_often_as_they_say():
    random = np.random.default_rng(5)
    y, offset = np.array([0.01, 0.0, -0.01]), np.array([0.005, 0.0, -0.01])
    held = []
    for k in range(300):
        counts = Rolls(tuple(random.multinomial(6000, probabilities(y, offset)).tolist()))
        found = infer.posterior(counts, [known()], samples=1000, seed=k)
        for samples, truth in ((found.length, np.exp(1.5 * y) - 1), (found.offset, offset)):
            for axis in range(3):
                _, low, high = infer.interval(samples[:, axis])
                held.append(low <= truth[axis] <= high)
    assert np.mean(held) == pytest.approx(0.95, abs=0.015)


def test_errors_of_the_coefficients_and_ways_of_throwing_widen_the_answer():
    sure = infer.posterior(LABBY, [known()], samples=20_000).length[:, 2]
    unsure = infer.posterior(LABBY, [known(error=0.2)], samples=20_000).length[:, 2]
    ways = infer.posterior(LABBY, [known(), known(chi=-6.0)], samples=20_000).length[:, 2]
    assert unsure.std() > 1.2 * sure.std()
    assert ways.std() > 1.2 * sure.std()
    assert infer.interval(ways)[0] > infer.interval(sure)[0]


def test_numbers_between_grounds_are_linear_between():
    grid = np.array([[-2.0, -3.0], [-4.0, -6.0]])
    grids = dict.fromkeys(("chi", "curvature", "psi"), grid)
    grids |= {f"{name}_error": np.zeros((2, 2)) for name in ("chi", "curvature", "psi")}
    table = Table("two", np.array([0.3, 0.6]), np.array([0.1, 0.3]), grids, 0.2)
    places = np.array([0.3, 0.6, 0.45, 0.3]), np.array([0.1, 0.3, 0.2, 0.2])
    np.testing.assert_allclose(table.at(*places)["chi"], [-2.0, -6.0, -3.75, -2.5], rtol=1e-12)


def test_few_rolls_say_little_and_a_face_that_never_came_up_is_no_end():
    found = infer.posterior(Rolls((3, 0, 2, 1, 0, 4)), SHIPPED, samples=4000)
    assert np.isfinite(found.length).all()
    assert np.isfinite(found.offset).all()
    assert found.beyond > 0.3


@pytest.mark.long
def test_labbys_dice_are_short_from_1_to_6_by_about_what_the_micrometer_said():
    """It said about 0.2 %: within the interval of dice that are rolled out, and at the end of the one of all throws."""
    axis = PAIRS.index("1-6")
    rolled = [table for table in SHIPPED if table.throw == "rolled"]
    _, low, high = infer.interval(infer.posterior(LABBY, rolled).length[:, axis])
    assert low < -0.002 < high
    middle, low, high = infer.interval(infer.posterior(LABBY, SHIPPED).length[:, axis])
    assert low < middle < -0.0025 < high < 0


@pytest.mark.long
def test_wolfs_white_die_is_longest_from_3_to_4_by_more_than_five_standard_errors():
    axis, gap = infer.longest(WHITE)
    assert (PAIRS[axis], gap > 5) == ("3-4", True)
    found = infer.posterior(WHITE, SHIPPED)
    others = np.delete(found.length, axis, axis=1).max(axis=1)
    assert (found.length[:, axis] > others).all()
    assert PAIRS[infer.longest(RED)[0]] == "3-4"

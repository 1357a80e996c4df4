"""Intervals, chi-square and distances of counts, against SciPy and against samples."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from stiffdice.experiments.dice import counts

LABBY = np.array([53222, 52118, 52465, 52338, 52244, 53285])  # 2009


def test_intervals_are_wilsons():
    low, high = counts.intervals(LABBY)
    for k, count in enumerate(LABBY):
        expected = stats.binomtest(int(count), int(LABBY.sum())).proportion_ci(0.95, "wilson")
        assert (low[k], high[k]) == pytest.approx((expected.low, expected.high), rel=1e-12)


def test_intervals_hold_the_truth_in_95_of_100_cases():
    random = np.random.default_rng(1)
    p = np.array([0.1, 0.1, 0.2, 0.2, 0.2, 0.2])
    held = [np.stack(counts.intervals(draw)) for draw in random.multinomial(400, p, 2000)]
    share = np.mean([(low <= p) & (p <= high) for low, high in held])
    assert share == pytest.approx(0.95, abs=0.01)


@pytest.mark.parametrize("seen", [LABBY, np.array([10, 10, 10, 10, 10, 10]), np.array([1, 2, 3, 4, 5, 60])])
def test_chi_square_and_its_tail_are_scipys(seen):
    expected = stats.chisquare(seen)
    assert counts.chi_square(seen) == pytest.approx((expected.statistic, expected.pvalue), rel=1e-9, abs=1e-300)


def test_two_samples_of_one_distribution_are_as_far_apart_as_is_told():
    p = np.array([0.09, 0.09, 0.09, 0.24, 0.24, 0.25])
    mean, most = counts.sampling_distance(p, 5000, 20000)
    random = np.random.default_rng(2)
    seen = [counts.total_variation(random.multinomial(5000, p), random.multinomial(20000, p)) for _ in range(2000)]
    assert np.mean(seen) == pytest.approx(mean, rel=0.03)
    assert np.mean(np.array(seen) < most) == pytest.approx(0.95, abs=0.015)


def test_only_what_is_decided_is_counted():
    faces, decided = np.array([1, 6, 6, 2], np.int8), np.array([True, True, False, True])
    assert counts.counted(faces, decided).tolist() == [1, 1, 0, 0, 0, 1]

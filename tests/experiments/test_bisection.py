from __future__ import annotations

import math

import pytest

from stiffdice.experiments.bisection import bisected, geometric


def test_neighbours_in_doubles_are_found():
    low, high = bisected(lambda x: x * x < 2, 1.0, 2.0)
    assert low * low < 2 <= high * high
    assert high == math.nextafter(low, math.inf)


@pytest.mark.parametrize("edge", [3.0, 1e-200, 1e300])
def test_a_range_of_many_decades_is_bisected_in_the_logarithm(edge):
    calls = []
    low, high = bisected(lambda x: calls.append(x) or x <= edge, 1e-300, 1e305, relative=1e-9, middle_of=geometric)
    assert low <= edge < high <= low * (1 + 2e-9)
    assert len(calls) < 50

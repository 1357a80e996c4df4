from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from stiffdice.dynamics.state import STATE
from stiffdice.simulation.reference import SAMPLES, distance, empty

number = st.floats(-100, 100)
vector = st.tuples(number, number, number).map(np.array)


def polynomial(coefficients, horizon):
    """A reference that moves along a polynomial of time, coefficients shape (power, axis), and the path itself."""
    coefficients = np.array(coefficients)
    powers = np.arange(len(coefficients))[:, None]

    def path(t):
        return (coefficients * t**powers).sum(axis=0)

    def velocity(t):
        return (powers[1:] * coefficients[1:] * t ** (powers[1:] - 1)).sum(axis=0)

    times = np.linspace(0, horizon, SAMPLES + 1)
    reference = empty(1, horizon)
    reference["position"], reference["velocity"] = ([curve(t) for t in times] for curve in (path, velocity))
    return reference[0], path


def at(place):
    state = np.zeros(1, STATE)
    state["position"] = place
    return state[0]


@given(vector, vector, vector, st.floats(0.1, 10), st.floats(0, 1))
def test_a_parabola_is_interpolated_exactly(start, speed, pull, horizon, moment):
    reference, path = polynomial([start, speed, pull], horizon)
    t = moment * horizon
    assert distance(reference, t, at(path(t))) < 1e-12 * (1 + np.abs([start, speed, pull]).max() * (1 + horizon) ** 2)


def test_a_cubic_too_but_no_quartic():
    t = 0.5 * 2 / SAMPLES  # halfway between two samples
    cubic, path = polynomial(np.ones((4, 3)), 2.0)
    assert distance(cubic, t, at(path(t))) < 1e-14
    quartic, path = polynomial(np.ones((5, 3)), 2.0)
    # The error of Hermite's cubic: f''''/4! · (s/2)⁴, in each of three axes.
    assert distance(quartic, t, at(path(t))) == pytest.approx(np.sqrt(3) * (1 / SAMPLES) ** 4, rel=1e-2)


@pytest.mark.parametrize("t", [0.0, 0.3, 2.0])
def test_distance_is_euclids(t):
    reference, path = polynomial([[1, 2, 3], [4, 5, 6]], 2.0)
    assert distance(reference, t, at(np.add(path(t), [3, 4, 12]))) == pytest.approx(13, rel=1e-14)


def test_none_is_compared_with_nothing():
    assert empty().shape == (1,)
    assert empty()["horizon"][0] < 0

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.experiments import measuring
from stiffdice.experiments.measuring import bisected, mapped, states_of
from stiffdice.scene.scene import Scene
from stiffdice.simulation.run import simulate


@pytest.mark.parametrize("ends", [(0.0, 1.0), (1.0, 1.0), (0.5, 2.0), (0.005, 1.0), (0.5,), (0.1, np.nan)])
def test_a_span_has_two_ends_in_its_bounds(ends):
    with pytest.raises(InputError, match="omega_h"):
        measuring.span(ends, 0.01, 2.0)
    assert measuring.span((0.01, 1.99), 0.01, 2.0) == (0.01, 1.99)


def test_a_scan_has_its_ends_exactly_and_what_is_special_once():
    scan = measuring.scan(0.1, 1.0, 7, [0.05, 0.1, 0.37, 1.0, 1.2])
    assert (scan[0], scan[-1], len(scan)) == (0.1, 1.0, 8)
    assert 0.37 in scan
    assert (np.diff(scan) > 0).all()


def test_neighbours_in_doubles_are_found():
    low, high = bisected(lambda x: x * x < 2, 1.0, 2.0)
    assert low * low < 2 <= high * high
    assert high == math.nextafter(low, math.inf)


@pytest.mark.parametrize("edge", [3.0, 1e-200, 1e300])
def test_a_range_of_many_decades_is_bisected_in_the_logarithm(edge):
    calls = []
    low, high = bisected(lambda x: calls.append(x) or x <= edge, 1e-300, 1e305, relative=1e-9, logarithmic=True)
    assert low <= edge < high <= low * (1 + 2e-9)
    assert len(calls) < 50


def test_states_are_those_of_the_trajectory_and_none_after_its_end():
    run = simulate(Scene(), model="sliding", steps=1000, every=10)
    np.testing.assert_array_equal(states_of(run, 20), run.trajectory.state[::5])
    first = {"step": run.trajectory.step[:4], "state": run.trajectory.state[:4]}
    ended = dataclasses.replace(run, trajectory=dataclasses.replace(run.trajectory, **first))
    np.testing.assert_array_equal(states_of(ended, 100)[:4], run.trajectory.state[:4])
    assert np.isnan(states_of(ended, 100)["position"][4:]).all()


def test_a_function_is_mapped_over_every_combination_of_coordinates():
    described = {"product": ("of both", "m"), "row": ("an array", "1", "bound")}
    found = xr.Dataset(
        mapped(
            lambda law, height: (len(law) * height, [height, 0]),
            described,
            contact=("ungated", "gated"),
            hop_height=[1.0, 3.0],
        )
    )
    assert found["product"].dims == ("contact", "hop_height")
    np.testing.assert_array_equal(found["product"], [[7, 21], [5, 15]])
    assert found["row"].dims == ("contact", "hop_height", "bound")
    np.testing.assert_array_equal(found["row"][:, 1], [[3, 0], [3, 0]])
    assert found["product"].attrs == {"long_name": "of both", "units": "m"}
    assert found.contact.attrs["flag_meanings"] == "ungated gated"
    assert found.hop_height.attrs["units"] == "m"
    with pytest.raises(InputError, match=r"friction = \[\]: allowed is at least one value"):
        mapped(lambda mu: [mu], {"x": ("x", "1")}, friction=[])

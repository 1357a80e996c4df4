"""The coefficients say what other dice do: shapes, loads and grounds that they were not measured on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from stiffdice.errors import InputError
from stiffdice.experiments.dice import infer, response, response_table
from stiffdice.experiments.dice.axes import FACES, pairs_of
from stiffdice.experiments.dice.boxes import Throwing, box_of, faces_up
from stiffdice.experiments.dice.rolls import Rolls
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene import scene as scenes

ROOT = Path(__file__).parents[3]
SCENE = scenes.load(ROOT / "config/scenes/thrown-die.yaml")
TABLES = {table.throw: table for table in response_table.load(response_table.SHIPPED)}
GROUND = (0.45, 0.2)

pytestmark = pytest.mark.long


@pytest.fixture(scope="module", params=[4_000, pytest.param(20_000, marks=pytest.mark.broad)])
def throws(request):
    return request.param


@pytest.fixture(scope="module")
def tossed(throws):
    return Throwing(velocity_spread=0.3, spin_spread=30.0, contact_time=1e-3, steps=40_000, throws=throws)


@pytest.fixture(scope="module")
def measured(throws):
    return response.measure(SCENE, restitution=[0.45], friction=[0.2], throws=throws, seed=77).squeeze()


@pytest.mark.parametrize("name", ["chi", "curvature", "psi"])
def test_the_shipped_numbers_are_what_throws_give(measured, name):
    table = TABLES["tossed"]
    there = table.at(*map(np.array, GROUND))
    found, error = float(measured[name]), float(measured[f"{name}_error"])
    assert abs(found - there[name]) < 4 * np.hypot(error, there[f"{name}_error"])
    assert error < 0.6 * abs(found)


def test_a_box_with_three_different_sides_lands_as_the_coefficients_say(tossed):
    """They are of another box, and of square ones by symmetry."""
    table, y = TABLES["tossed"], np.array([-0.02, -0.1, 0.12])
    box = box_of(SCENE, *GROUND, tossed.contact_time, stretch=y)
    pairs = pairs_of(faces_up(box, tossed, seed=8)[0])
    there = table.at(*map(np.array, GROUND))
    p = np.exp(1.5 * there["chi"] * y + there["curvature"] * y * y)
    p /= p.sum()
    error = np.sqrt(p * (1 - p) / pairs.sum() + (p * 0.02) ** 2)  # of the counts, and of terms left out
    assert (np.abs(pairs / pairs.sum() - p) < 4 * error).all()


def test_a_loaded_box_of_which_only_the_counts_are_known_is_found(tossed):
    y, offset = np.array([0.04, -0.03, -0.01]), np.array([0.02, 0.0, -0.01])
    counts, _ = faces_up(box_of(SCENE, *GROUND, tossed.contact_time, stretch=y, offset=offset), tossed, seed=9)
    found = infer.posterior(Rolls(tuple(counts.tolist())), list(TABLES.values()), samples=20_000)
    for axis in range(3):
        _, low, high = infer.interval(found.length[:, axis])
        assert low <= np.exp(1.5 * y[axis]) - 1 <= high
        _, low, high = infer.interval(found.offset[:, axis])
        assert low <= offset[axis] <= high


def test_a_load_makes_the_face_opposite_come_up_and_a_long_axis_its_ends_less(tossed):
    counts, _ = faces_up(box_of(SCENE, *GROUND, 1e-3, offset=(0.0, 0.0, 0.1)), tossed, seed=1)
    (_, _, (towards, opposite)) = FACES
    assert counts[opposite - 1] > 1.5 * counts[towards - 1]
    long = pairs_of(faces_up(box_of(SCENE, *GROUND, 1e-3, stretch=(0.0, 0.0, 0.1)), tossed, seed=1)[0])
    assert long[2] < 0.8 * long[:2].min()


@pytest.mark.broad
def test_by_launch_and_changed_one_by_one_the_same_is_measured(measured):
    found = response.launches(SCENE, speed=[1.0], spin=[30.0], steps=40_000, throws=4000).squeeze()
    assert abs(float(found.chi) - float(measured.chi)) < 4 * np.hypot(float(found.chi_error), float(measured.chi_error))
    checked = response.checks(SCENE, throws=2000)
    sound = [k for k, name in enumerate(meanings_of(checked.check)) if name != "fourfold_step"]
    spread = (checked.chi - float(measured.chi)) / np.hypot(checked.chi_error, float(measured.chi_error))
    assert (np.abs(spread[sound]) < 4).all()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"restitution": [0.0]}, "restitution = 0"),
        ({"friction": [-1.0]}, "friction = -1"),
        ({"throws": 0}, "throws = 0"),
        ({"stretch": 0.0}, "stretch = 0"),
        ({"offset": 0.0}, "offset = 0"),
        ({"throws": 2}, "throws = 2: a face never comes up"),
    ],
)
def test_numbers_out_of_range_are_said(options, told):
    with pytest.raises(InputError, match=told):
        response.measure(SCENE, **options)

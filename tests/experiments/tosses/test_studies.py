"""Models, steps, chaos and one toss against measured tosses."""

from __future__ import annotations

import numpy as np
import pytest
from tests import toss_files

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments.tosses import chaos, models, single, steps
from stiffdice.experiments.tosses.replay import Physics
from stiffdice.io.cf_enums import meanings_of
from stiffdice.scene import flat_landing

BOARD = {"restitution": 0.3, "friction": 0.2, "contact_time": 0.005}


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    """Six tosses that the simulator itself made, on this board."""
    tosses, _ = toss_files.made(6, Physics(*BOARD.values()))
    return str(toss_files.stored(tosses, tmp_path_factory.mktemp("tosses") / "made.h5"))


@pytest.fixture(scope="module")
def by_model(data):
    return models.measure(toss_files.SCENE, data=data, **BOARD)


def variant(found, name):
    return found.isel(variant=meanings_of(found.variant).index(name))


def test_the_full_model_makes_its_own_tosses_and_no_other_does(by_model):
    full = variant(by_model, "full")
    # The cube sinks in at rest, so that its unit of length is taken 0.1 % too long, which chaos may make more of.
    assert float(full.path.median()) < 5e-3
    assert full.right.all()
    assert float(variant(by_model, "flight_launch").path.median()) < 5e-3
    for name in set(models.VARIANTS) - {"full", "flight_launch", "lengths_as_stored"}:
        assert float(variant(by_model, name).path.mean()) > 3 * float(full.path.median()), name


def test_errors_over_time_begin_at_none_and_have_the_mean_over_time(by_model):
    assert by_model.path_over_time[:, 0].max() < 1e-3
    running = by_model.measured_tosses
    for name in ("path", "orientation"):
        summed = (by_model[f"{name}_over_time"] * running).sum("time")
        counts = np.array([(running > k).sum() for k in range(by_model.sizes["toss"])])  # samples, longest toss first
        assert summed.min() >= 0
        assert float(summed[0]) == pytest.approx(float(by_model[name][0].mean()) * counts.mean() * len(counts), rel=0.5)


def test_a_cube_that_stays_or_does_not_turn_keeps_its_face(by_model):
    np.testing.assert_array_equal(variant(by_model, "stays").right, variant(by_model, "no_rotation").right)
    assert variant(by_model, "no_ground").right.isnull().all()


def test_without_ground_the_cube_falls_freely(data):
    found = models.measure(toss_files.SCENE, data=data, **BOARD)
    fall = variant(found, "no_ground").path_over_time * 0.1048
    late = found.time.values > 0.5
    assert (fall.values[late] > 0.5 * 9.8 * (found.time.values[late] - 0.35) ** 2).all()


@pytest.fixture(scope="module")
def by_steps(data):
    board = {"restitution": 0.3, "friction": 0.2}
    return steps.measure(
        toss_files.SCENE, data=data, contact_time=(0.005,), omega_h=(0.02, 3.0), count=8, source="flight", **board
    )


@pytest.mark.long
def test_the_error_falls_to_the_floor_as_steps_get_shorter(by_steps):
    path = by_steps.path[0].mean("toss").values
    assert path[0] < 0.02
    assert path[-1] > 1
    numerical = by_steps.path_numerical[0].mean("toss").values
    assert numerical[0] < numerical[4] < numerical[-1]
    assert by_steps.wrong[0, 0].sum() == by_steps.face_numerical[0, 0].sum() == 0
    assert by_steps.wrong[0, -1].all()


@pytest.mark.long
def test_the_edge_lies_within_its_interval_below_the_limit_of_stability(by_steps):
    limit = float(by_steps.stability_limit[0])
    # Rocking on a face, of which ω² and ζ² are m a²/I times those of a flat landing.
    faster, zeta = np.sqrt(0.37 * 0.0524**2 / 0.00081), flat_landing.damping_ratio("gated", 0.3)
    assert limit == pytest.approx(linear_theory.stability_limit(zeta * faster) / faster, rel=1e-9)
    face = meanings_of(by_steps.criterion).index("face")
    assert 0.5 * limit < float(by_steps.left[0, face]) < 1.5 * limit
    assert (by_steps.left_low <= by_steps.left).all()
    assert (by_steps.left <= by_steps.left_high).all()


@pytest.mark.parametrize(
    ("means", "edge"),
    [
        ([1.0, 1.04, 1.06, 3.0], np.sqrt(4 * 9)),
        ([1.0, 1.06, 1.04, 3.0], np.sqrt(1 * 4)),
        ([1.0, 1.0, 1.0, 1.0], 16.0),
        ([2.0, 1.0, 1.0, 1.0], np.nan),
        ([1.0, np.inf, np.nan, np.nan], 2.0),
    ],
)
def test_a_curve_leaves_where_it_is_first_off(means, edge):
    found = steps._edge(np.array([1.0, 4.0, 9.0, 16.0]), np.array(means), steps.near_floor("path", 1.0))
    assert found == pytest.approx(edge, nan_ok=True)


def test_the_share_of_right_faces_may_fall_by_a_twentieth():
    assert steps.near_floor("face", 0.2) == pytest.approx(1 - 0.95 * 0.8)
    assert steps.near_floor("path", 0.2) == pytest.approx(0.21)


@pytest.fixture(scope="module")
def perturbed(data):
    return chaos.measure(toss_files.SCENE, data=data, sizes=(0.0,), draws=3, **BOARD)


def test_what_is_not_perturbed_does_not_change(perturbed):
    alone = perturbed.sel(size=0.0)
    assert not alone.changed.any()
    assert (alone.likeliest == 1).all()
    np.testing.assert_array_equal(alone.right, perturbed.unperturbed)
    assert perturbed.unperturbed.all()


def test_large_errors_change_faces_and_the_likeliest_is_at_least_the_right_one(tmp_path):
    real = toss_files.stored(toss_files.some(9), tmp_path / "real.h5")
    perturbed = chaos.measure(toss_files.SCENE, data=str(real), sizes=(0.1, 3.0, 100.0), draws=20, **BOARD)
    changed = perturbed.changed.mean("toss").values
    assert (np.diff(changed, axis=1) >= 0).all()
    assert changed[0, -1] > 0.5
    assert (perturbed.likeliest >= perturbed.right).all()
    assert (perturbed.likeliest >= 1 / 7).all()


def test_one_toss_lies_beside_its_simulation(data):
    found = single.measure(toss_files.SCENE, data=data, toss=2, source="flight", **BOARD)
    assert int(found.attrs["toss"]) == 2
    np.testing.assert_allclose(found.measured_nodes.mean("node"), found.measured_position, atol=1e-12)
    far = np.linalg.norm(found.measured_nodes - found.simulated_nodes, axis=-1)
    assert far.max() < 5e-3  # as above
    edges = found.measured_nodes[:, 0] - found.measured_nodes[:, 1]
    np.testing.assert_allclose(np.linalg.norm(edges, axis=-1), 0.1048, rtol=1e-9)


@pytest.mark.parametrize(
    ("measure", "options", "told"),
    [
        (single.measure, {"toss": 7}, "toss = 7: allowed is a whole number from 1 to 6"),
        (single.measure, {"source": "guess"}, "source = guess: allowed is sample"),
        (steps.measure, {"omega_h": (1.0, 0.1)}, "omega_h = "),
        (steps.measure, {"contact_time": (-1.0,)}, "contact_time = -1"),
        (steps.measure, {"source": "guess"}, "source = guess: allowed is sample"),
        (chaos.measure, {"draws": 0}, "draws = 0"),
        (chaos.measure, {"sizes": (-1.0,)}, "sizes = -1"),
        (models.measure, {"restitution": 0.0}, "restitution = 0"),
        (models.measure, {"restitution": 1.5}, "restitution = 1.5"),
        (models.measure, {"friction": -0.1}, "friction = -0.1"),
    ],
)
def test_bad_options_are_told(data, measure, options, told):
    with pytest.raises(InputError, match=told):
        measure(toss_files.SCENE, data=data, **options)

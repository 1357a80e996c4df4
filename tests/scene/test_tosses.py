"""A file of tosses is read as it is, or refused in one line that says where it is wrong."""

from __future__ import annotations

import os

import h5py
import numpy as np
import pytest
from tests import toss_files

from stiffdice.errors import InputError, RefusedError
from stiffdice.scene import tosses as files


@pytest.fixture(scope="module")
def few():
    return toss_files.some(3)


def test_the_real_tosses_are_those_of_their_source():
    """342 tosses, 0.72 s on average, that end flat; 41.2 % on the face that was nearest to up at the first sample."""
    found = files.load(toss_files.REAL)
    assert (len(found.counts), found.counts.sum(), found.rate, found.side) == (342, 36534, 148, 0.1048)
    assert (found.counts - 1).mean() / found.rate == pytest.approx(0.715, abs=0.001)
    assert np.mean(found.faces[found.first] == found.faces[found.last]) == pytest.approx(0.412, abs=5e-4)
    assert np.abs(found.orientation[found.last][:, 2]).max(axis=1).min() > 0.9998
    np.testing.assert_allclose(
        found.orientation @ found.orientation.swapaxes(1, 2), np.eye(3) + 0 * found.orientation, atol=1e-12
    )
    assert found.time[found.last].max() == pytest.approx(441 / 148)


def test_spin_is_turned_from_the_body_to_the_world(few):
    """The tracked turn of the first samples is that by the spin, to the tracker's error."""
    for first, spin in zip(few.first, few.angular_velocity, strict=True):
        turn = few.orientation[first + 4] @ few.orientation[first].T
        across = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
        np.testing.assert_allclose(across, spin * 4 / few.rate, atol=0.02)


def test_what_is_written_is_read_again(few, tmp_path):
    again = files.admitted(toss_files.stored(few, tmp_path / "a.h5"))
    for name, values in few._asdict().items():
        np.testing.assert_allclose(getattr(again, name), values, atol=1e-9, err_msg=name)


def test_some_tosses_are_chosen(few):
    last = few.chosen(np.array([2]))
    assert last.counts.tolist() == [few.counts[2]]
    np.testing.assert_array_equal(last.position, few.position[few.first[2] :])
    np.testing.assert_array_equal(last.velocity, few.velocity[2:])


def spoilt(few, tmp_path, change):
    variables, attributes = toss_files.contents(few)
    units = change(variables, attributes)
    return toss_files.write(tmp_path / "spoilt.h5", variables, attributes, units)


def gap(variables, _):
    rows = np.delete(np.arange(len(variables["position"])), np.arange(130, 132))
    variables["position"], variables["orientation"] = variables["position"][rows], variables["orientation"][rows]
    variables["row_size"][1] -= 2


def short(variables, _):
    variables["row_size"][1] -= 10


def no_number(variables, _):
    variables["position"][115, 1] = np.nan


def no_spin(variables, _):
    variables["angular_velocity"][2, 0] = np.inf


def stretched(variables, _):
    variables["orientation"][3] *= 1.01


def sunk(variables, _):
    variables["position"][:111, 2] -= 0.02


def centimetres(variables, _):
    return {"position": "cm"}


def unitless(_, attributes):
    del attributes["half_width_units"]


def no_mass(_, attributes):
    attributes["mass"] = -1.0


def two_rates(_, attributes):
    attributes["sampling_rate"] = np.array([148.0, 100.0])


def rateless(_, attributes):
    del attributes["sampling_rate"]


def flat(variables, _):
    variables["velocity"] = variables["velocity"][:2]


def nothing(variables, _):
    del variables["orientation"]


def half(variables, _):
    variables["row_size"] = variables["row_size"].astype(float)
    variables["row_size"][0] += 0.5


def tiny(variables, _):
    variables["row_size"][0] = 2


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (gap, "position: toss 1, sample 18: 0.0.* m to the next sample: its neighbours allow .* m; is there a gap?"),
        (short, "row_size: comes to .* samples: position has"),
        (no_number, "position: toss 1, sample 4: no number; allowed are tosses without gaps"),
        (no_spin, "angular_velocity: toss 2: no number"),
        (stretched, "orientation: toss 0, sample 3: length 1.01: allowed is 1 ± 0.001"),
        (sunk, "position: toss 0, sample .*: a node 0.0.* m below the board"),
        (centimetres, "position: has the unit cm: allowed is m"),
        (unitless, "half_width: has the unit None: allowed is m"),
        (no_mass, "mass = -1.0: allowed is a finite number > 0"),
        (two_rates, "sampling_rate = .*: allowed is a finite number > 0"),
        (rateless, "has no attribute sampling_rate"),
        (flat, "row_size: has shape \\[3\\]|velocity: has shape \\[2, 3\\]|angular_velocity: has shape"),
        (nothing, "has no variable orientation"),
        (half, "row_size: toss 0: .* samples: allowed is a whole number from 10"),
        (tiny, "row_size: toss 0: 2 samples: allowed is a whole number from 10"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(few, tmp_path, change, told):
    path = spoilt(few, tmp_path, change)
    with pytest.raises(InputError, match=f"^{path}: {told}") as error:
        files.load(path)
    assert str(error.value).isprintable()


def test_missing_values_are_gaps(few, tmp_path):
    path = toss_files.stored(few, tmp_path / "a.h5")
    with h5py.File(path, "r+") as file:
        file["position"].attrs["_FillValue"] = file["position"][7, 2]
    with pytest.raises(InputError, match="position: toss 0, sample 7: no number"):
        files.load(path)


def test_a_file_that_points_elsewhere_is_refused(few, tmp_path):
    path = toss_files.stored(few, tmp_path / "a.h5")
    with h5py.File(path, "r+") as file:
        del file["velocity"]
        file["velocity"] = h5py.ExternalLink("other.h5", "/velocity")
    with pytest.raises(RefusedError, match="velocity: a link that points elsewhere"):
        files.admitted(path)


@pytest.mark.parametrize("what", ["text", "folder", "pipe", "nothing"])
def test_what_is_no_such_file_is_refused(tmp_path, what):
    path = tmp_path / "a.h5"
    if what == "text":
        path.write_text("hello")
    elif what == "folder":
        path.mkdir()
    elif what == "pipe":
        os.mkfifo(path)
    with pytest.raises(InputError, match=f"^{path}: "):
        files.admitted(path)

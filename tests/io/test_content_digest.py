"""One digest for what a dataset says, whatever stores it; one for all runs of a sweep, whoever holds them."""

from __future__ import annotations

import itertools

import h5py
import numpy as np
import pytest
import xarray as xr
from tests import rounds

from stiffdice.io import content_digest
from stiffdice.io.content_digest import data_digest, runs_digest
from stiffdice.io.reader import parts
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate


@pytest.fixture(scope="module")
def run():
    """A run of a few samples, as it comes from the simulation."""
    return run_dataset(simulate(from_mapping({}), model="sliding", steps=400, every=4)).load()


@pytest.fixture(scope="module")
def stored(run, tmp_path_factory):
    path = tmp_path_factory.mktemp("digest") / "run.h5"
    write_dataset(run, path)
    return path


def opened(path, engine):
    with xr.open_dataset(path, engine=engine, decode_times=False) as dataset:
        return dataset.load()


@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
def test_what_is_read_has_the_digest_of_what_was_written(stored, run, engine):
    assert data_digest(opened(stored, engine)) == data_digest(run)


def test_storage_does_not_count(run, tmp_path):
    """Other chunks, no compression, variables and attributes in another order, big endian."""
    turned = xr.Dataset(
        {name: run[name] for name in reversed(list(run.data_vars))},
        run.coords,
        dict(reversed(list(run.attrs.items()))),
    )
    big = {name: {"dtype": variable.dtype.newbyteorder(">")} for name, variable in turned.variables.items()}
    big["position"]["chunksizes"] = (7, 2)
    turned.to_netcdf(tmp_path / "turned.h5", engine="h5netcdf", encoding=big)
    with h5py.File(tmp_path / "turned.h5") as file:
        assert (file["position"].chunks, file["time"].dtype.byteorder) == ((7, 2), ">")
    assert data_digest(opened(tmp_path / "turned.h5", "h5netcdf")) == data_digest(run)


def one(values, **about):
    return xr.Dataset({"x": ("k", np.asarray(values), about)})


def renamed(dataset):
    return dataset.rename({"x": "y"})


SAID = one([1.0, 2.0], units="m")
OTHERS = {
    "name": renamed(SAID),
    "dimension": SAID.rename({"k": "l"}),
    "size": one([1.0, 2.0, 3.0], units="m"),
    "shape": xr.Dataset({"x": (("k", "l"), np.array([[1.0, 2.0]]), {"units": "m"})}),
    "value": one([1.0, np.nextafter(2.0, 3.0)], units="m"),
    "order": one([2.0, 1.0], units="m"),
    "width": one(np.array([1.0, 2.0], np.float32), units="m"),
    "kind": one(np.array([1, 2]), units="m"),
    "units": one([1.0, 2.0], units="cm"),
    "no units": one([1.0, 2.0]),
    "more attributes": one([1.0, 2.0], units="m", axis="X"),
    "global attribute": SAID.assign_attrs(units="m"),
    "more variables": SAID.assign(y=0.0),
}


def test_all_that_is_said_counts():
    digests = [data_digest(dataset) for dataset in (SAID, *OTHERS.values())]
    assert len(set(digests)) == len(digests)


def test_names_do_not_run_into_values():
    """Moving a letter from an attribute's name to its text, or from one text to the next, is another dataset."""
    told = [{"ab": "c"}, {"a": "bc"}, {"a": "b", "c": ""}, {"a": "", "b": "c"}, {"a": ["b", "c"]}, {"a": ["bc", ""]}]
    assert len({data_digest(xr.Dataset(attrs=about)) for about in told}) == len(told)


@pytest.mark.parametrize(
    ("this", "that"),
    [
        (1, np.int32(1)),
        (1, np.array([1], np.int8)),
        (True, 1),
        (0.5, np.float32(0.5)),
        (0.5, np.array([0.5])),
        ("text", np.str_("text")),
        ("text", b"text"),
        ([1.0, 2.0], np.array([1.0, 2.0])),
        ((1, 2), np.array([1, 2], ">i2")),
        (["a", "b"], np.array(["a", "b"], object)),
        (float("nan"), -np.float64("nan")),
    ],
)
def test_readers_types_of_attributes_do_not_count(this, that):
    assert data_digest(xr.Dataset(attrs={"a": this})) == data_digest(xr.Dataset(attrs={"a": that}))


@pytest.mark.parametrize(
    ("this", "that"), [(1, 1.0), (1, "1"), (0.0, -0.0), ([1, 2], [2, 1]), ([1.0, 2.0], "[1.0, 2.0]"), ("", [])]
)
def test_kinds_and_values_of_attributes_do(this, that):
    assert data_digest(xr.Dataset(attrs={"a": this})) != data_digest(xr.Dataset(attrs={"a": that}))


def test_nan_is_one_value_and_zeros_are_two():
    payload = np.array([0x7FF8000000000001], np.uint64).view(np.float64)[0]
    assert np.isnan(payload)
    assert data_digest(one([np.nan])) == data_digest(one([payload])) == data_digest(one([-np.nan]))
    assert data_digest(one([0.0])) != data_digest(one([-0.0]))


def test_text_has_a_digest_and_what_no_file_of_ours_holds_is_refused():
    assert data_digest(one(np.array(["a", "bc"]))) == data_digest(one(np.array(["a", "bc"], object)))
    assert data_digest(one(np.array(["a", "bc"]))) != data_digest(one(np.array(["ab", "c"])))
    with pytest.raises(TypeError, match="complex128"):
        data_digest(one([1j]))
    with pytest.raises(TypeError, match="dict"):
        data_digest(xr.Dataset(attrs={"a": {}}))


@pytest.fixture(scope="module")
def dealt(small, tmp_path_factory):
    """Its shards, one column in each, and four; by columns in each."""
    return {size: rounds.by_columns(small, size, tmp_path_factory.mktemp(f"by-{size}")) for size in (1, 4)}


@pytest.fixture(scope="module")
def read(dealt):
    """All runs, a column a part."""
    return list(all_parts(dealt[1]))


def all_parts(paths, cells=100):
    return itertools.chain.from_iterable(parts(path, cells) for path in paths)


def test_how_cells_are_dealt_does_not_count(dealt):
    assert (len(dealt[1]), len(dealt[4])) == (6, 2)
    digests = {
        runs_digest(all_parts(dealt[1])),
        runs_digest(all_parts(reversed(dealt[1]))),
        runs_digest(all_parts(dealt[4], cells=7)),
        runs_digest(all_parts(dealt[4])),
        runs_digest(part.isel(cell=slice(None, None, -1)) for part in all_parts(dealt[4])),
        runs_digest(part.assign_attrs(title="another") for part in all_parts(dealt[4])),
    }
    assert len(digests) == 1


def flipped(parts):
    """Change the last bit of one value of one run."""
    ratio = parts[3]["energy_ratio"]
    ratio[0, 1] = np.nextafter(ratio[0, 1], 0.0)
    return parts


def moved(parts):
    """Say that the runs of one column are of another stiffness."""
    parts[3]["stiffness"] = parts[3]["stiffness"] * 2
    return parts


@pytest.mark.parametrize("change", [flipped, moved, lambda parts: parts[1:]], ids=["bit", "cell", "fewer"])
def test_what_the_runs_say_does(read, change):
    assert runs_digest(change([part.copy(deep=True) for part in read])) != runs_digest(read)


@pytest.mark.parametrize("room", [1, 3000])
def test_how_much_is_hashed_at_a_time_does_not_count(read, monkeypatch, room):
    whole = content_digest.cell_digests(read[0])
    assert len(set(whole.tolist())) == read[0].sizes["cell"] > 1
    monkeypatch.setattr(content_digest, "_BLOCK", room)
    assert (content_digest.cell_digests(read[0]) == whole).all()


def test_cells_hold_numbers_alone(read):
    with pytest.raises(TypeError, match="of cells of type <U1"):
        content_digest.cell_digests(read[0].assign(word=("cell", np.full(read[0].sizes["cell"], "a"))))


def test_a_part_may_hold_no_cells(read):
    empty = read[0].isel(cell=slice(0))
    assert len(content_digest.cell_digests(empty)) == 0
    assert runs_digest([empty]) == runs_digest([])

"""A file written part by part: whole or not there, the same bytes for the same parts, and never all in memory."""

from __future__ import annotations

import subprocess
import sys

import h5py
import numpy as np
import pytest
import xarray as xr

from stiffdice.errors import InputError, OutputError
from stiffdice.io import reader
from stiffdice.io.cf_enums import enum_attributes
from stiffdice.io.reader import open_file, parts
from stiffdice.io.shard_writer import CHUNK_CELLS, CHUNK_MEMBERS, Spool

CELLS, MEMBERS = 40, 150
ABOUT = {"units": "1", "long_name": "a number"}
VERDICT = enum_attributes("verdict", list("abcdefghi"))


def whole():
    """All that is to be in the file."""
    rng = np.random.default_rng(0)
    table, many = ("cell", "member"), (CELLS, MEMBERS)
    return xr.Dataset(
        {
            "ratio": (table, np.where(rng.random(many) < 0.1, np.nan, rng.random(many)), ABOUT),
            "verdict": (table, rng.integers(0, 9, many).astype(np.int8), VERDICT),
            "decided": ((*table, "criterion"), rng.integers(0, 2**60, (*many, 3)), ABOUT),
        },
        {
            "steps": ("cell", rng.integers(1, 10**6, CELLS), ABOUT),
            "member": ("member", np.arange(MEMBERS, dtype=np.int32), ABOUT),
            "criterion": ("criterion", np.arange(3, dtype=np.int8), ABOUT),
        },
        {"format_version": "1.0", "title": "Numbers", "members": MEMBERS, "horizon": 1.5},
    )


def values(dataset):
    return {str(name): dataset[name].values for name in dataset.variables if "cell" in dataset[name].dims}


def spooled(path, cells, members):
    """Write it, so many cells and members at a time."""
    given = whole()
    with Spool(path, given.isel(cell=slice(1))) as spool:
        for start in range(0, CELLS, cells):
            part = given.isel(cell=slice(start, start + cells))
            count = part.sizes["cell"]
            first = spool.add_cells(count)
            assert first == start
            spool.put({"steps": part.steps.values}, slice(first, first + count))
            for m in range(0, MEMBERS, members):
                block = part.drop_vars("steps").isel(member=slice(m, m + members))
                spool.put(values(block), slice(first, first + count), slice(m, m + members))


ALL_SIZES = [(CELLS, MEMBERS), (1, MEMBERS), (7, 11), (CHUNK_CELLS, CHUNK_MEMBERS)]


@pytest.mark.parametrize(("cells", "members"), ALL_SIZES)
def test_what_is_read_is_what_was_put_however_it_was_parted(tmp_path, cells, members):
    spooled(tmp_path / "x.h5", cells, members)
    xr.testing.assert_identical(open_file(tmp_path / "x.h5"), whole())


def test_xarray_opens_it_with_its_default_engine(tmp_path):
    spooled(tmp_path / "x.h5", 7, 11)
    with xr.open_dataset(tmp_path / "x.h5") as found:
        xr.testing.assert_identical(found.load(), whole())


def test_it_is_read_again_part_by_part(tmp_path):
    spooled(tmp_path / "x.h5", 7, 11)
    found = list(parts(tmp_path / "x.h5", 9))
    assert len(found) == -(-CELLS // 9)
    for k, part in enumerate(found):
        xr.testing.assert_identical(part, whole().isel(cell=slice(9 * k, 9 * k + 9)))


def test_a_damaged_part_is_told_with_the_files_name(tmp_path):
    """A chunk whose checksum is wrong, found only when it is read."""
    spooled(tmp_path / "x.h5", 7, 11)
    with h5py.File(tmp_path / "x.h5") as file:
        chunk = file["ratio"].id.get_chunk_info(0)
    content = bytearray((tmp_path / "x.h5").read_bytes())
    content[chunk.byte_offset + chunk.size // 2] ^= 0xFF
    (tmp_path / "x.h5").write_bytes(content)
    with pytest.raises(InputError, match=r"x\.h5: "):
        list(parts(tmp_path / "x.h5", 9))


@pytest.mark.parametrize(("cells", "members"), ALL_SIZES)
def test_equal_parts_in_equal_order_are_equal_bytes(tmp_path, cells, members):
    for name in ("a.h5", "b.h5"):
        spooled(tmp_path / name, cells, members)
    assert (tmp_path / "a.h5").read_bytes() == (tmp_path / "b.h5").read_bytes()


def test_every_chunk_is_compressed_and_has_a_checksum(tmp_path):
    spooled(tmp_path / "x.h5", 7, 11)
    with h5py.File(tmp_path / "x.h5") as file:
        for name in ("ratio", "verdict", "decided", "steps", "member"):
            stored = file[name]
            assert (stored.compression, stored.shuffle, stored.fletcher32) == ("gzip", True, True)
            assert "_FillValue" not in stored.attrs
        assert file["ratio"].chunks == (CHUNK_CELLS, CHUNK_MEMBERS)
        assert file["decided"].chunks == (CHUNK_CELLS, CHUNK_MEMBERS, 3)


@pytest.mark.parametrize(("members", "cells"), [(1, 1024), (2, 512), (64, 16), (150, 16)])
def test_a_chunk_of_few_members_holds_the_more_cells(tmp_path, members, cells):
    """A million cells of one member in chunks of 16 take more to find, and to store, than their values."""
    with Spool(tmp_path / "x.h5", whole().isel(cell=slice(1), member=slice(members))) as spool:
        spool.add_cells(1)
    with h5py.File(tmp_path / "x.h5") as file:
        assert file["ratio"].chunks == (cells, min(members, CHUNK_MEMBERS))
        assert file["steps"].chunks == (CHUNK_CELLS * CHUNK_MEMBERS,)


@pytest.mark.parametrize(("runs", "cells"), [(1, CHUNK_CELLS), (33 * MEMBERS, 2 * CHUNK_CELLS), (10**6, CELLS)])
def test_by_itself_a_part_is_whole_chunks_of_about_so_many_runs(tmp_path, monkeypatch, runs, cells):
    spooled(tmp_path / "x.h5", 7, 11)
    monkeypatch.setattr(reader, "RUNS_AT_ONCE", runs)
    found = list(parts(tmp_path / "x.h5"))
    assert [part.sizes["cell"] for part in found[:-1]] == [cells] * (len(found) - 1)
    for k, part in enumerate(found):
        xr.testing.assert_identical(part, whole().isel(cell=slice(cells * k, cells * (k + 1))))


def test_one_member_and_no_cell_are_files_too(tmp_path):
    pattern = whole().isel(cell=slice(1), member=slice(1))
    with Spool(tmp_path / "x.h5", pattern):
        pass
    assert open_file(tmp_path / "x.h5").sizes == {"cell": 0, "member": 1, "criterion": 3}


def test_nothing_has_its_name_before_it_is_whole(tmp_path):
    path = tmp_path / "x.h5"
    path.write_bytes(b"before")
    given = whole()
    with Spool(path, given.isel(cell=slice(1))) as spool:
        spool.put(values(given), slice(spool.add_cells(CELLS), CELLS))
        assert path.read_bytes() == b"before"
        assert len(list(tmp_path.iterdir())) == 2
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.h5"]
    assert path.read_bytes() != b"before"


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt, OutputError])
def test_an_interrupted_block_leaves_what_was_there(tmp_path, error):
    path = tmp_path / "x.h5"
    path.write_bytes(b"before")
    given = whole()
    with pytest.raises(error), Spool(path, given.isel(cell=slice(1))) as spool:
        spool.put(values(given), slice(spool.add_cells(CELLS), CELLS))
        raise error
    assert path.read_bytes() == b"before"
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.h5"]


def test_what_is_put_is_on_the_disk_and_not_in_memory(tmp_path):
    """Numbers that do not compress, many times the size of HDF5's own buffer."""
    members, cells, rounds = 1024, 64, 40
    one = xr.Dataset({"ratio": (("cell", "member"), np.zeros((1, members)), ABOUT)}, attrs={"format_version": "1.0"})
    rng, sizes = np.random.default_rng(0), []
    with Spool(tmp_path / "x.h5", one) as spool:
        for _ in range(rounds):
            first = spool.add_cells(cells)
            spool.put({"ratio": rng.random((cells, members))}, slice(first, first + cells))
            (growing,) = tmp_path.iterdir()
            sizes.append(growing.stat().st_size)
    written = members * cells * 8 * np.arange(1, rounds + 1)
    assert written[-1] > 20e6
    assert (written - sizes < 3e6).all()


@pytest.mark.parametrize("place", ["nowhere/out.h5", "."])
def test_a_place_that_cannot_be_written_is_told_before_the_work(tmp_path, place):
    with pytest.raises(OutputError):
        Spool(tmp_path / place, whole())


FULL = """
import resource, sys
import numpy as np, xarray as xr
from stiffdice.errors import OutputError
from stiffdice.io.shard_writer import Spool
one = xr.Dataset({"ratio": (("cell", "member"), np.zeros((1, 64)))}, attrs={"format_version": "1.0"})
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]), -1))
try:
    with Spool("out.h5", one) as spool:
        for _ in range(30):
            first = spool.add_cells(64)
            spool.put({"ratio": np.random.default_rng(first).random((64, 64))}, slice(first, first + 64))
except OutputError as error:
    print(error, flush=True)
"""


@pytest.mark.parametrize("room", [100, 500_000])
@pytest.mark.long
def test_a_full_disk_is_one_line_and_leaves_what_was_there(tmp_path, room):
    """A limit on the file size stands for the disk: what HDF5 holds back shows only when the file is closed.

    The status is left out: once HDF5 could not close a file, it may crash when the interpreter ends.
    """
    (tmp_path / "out.h5").write_bytes(b"before")
    command = [sys.executable, "-c", FULL, str(room)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.stdout == "out.h5: File too large; nothing was stored\n"
    assert (tmp_path / "out.h5").read_bytes() == b"before"
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.h5"]


def test_told_to_stop_while_it_lays_a_file_out_it_leaves_nothing(tmp_path, monkeypatch):
    def stop(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(Spool, "_create", stop)
    with pytest.raises(KeyboardInterrupt), Spool(tmp_path / "x.h5", whole().isel(cell=slice(1))):
        pass
    assert list(tmp_path.iterdir()) == []

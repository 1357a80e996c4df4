"""Files from elsewhere are tried by another process: whatever happens to it, this one goes on and names the file."""

from __future__ import annotations

import re
import signal
import subprocess
import sys
import zlib

import h5py
import numpy as np
import pytest
from tests.fuzz.hdf5_blocks import changed
from tests.fuzz.readers import READERS
from tests.io.test_structure_check import PIECE, add, whole

from stiffdice.errors import InputError, RefusedError
from stiffdice.io import isolation, seal
from stiffdice.io.writer import write_dataset


@pytest.fixture
def stored(tmp_path):
    path = tmp_path / "x.h5"
    write_dataset(whole(), path)
    return path


def test_what_is_sound_is_admitted(stored):
    isolation.admit(stored, str(stored))
    isolation.admit()


def test_what_is_not_is_refused_by_name(stored, tmp_path):
    with pytest.raises(InputError, match=f"{tmp_path / 'y.h5'}: No such file"):
        isolation.admit(stored, tmp_path / "y.h5")
    (tmp_path / "y.h5").write_text("hello")
    with pytest.raises(RefusedError, match=f"{tmp_path / 'y.h5'}: not a readable HDF5 file"):
        isolation.admit(stored, tmp_path / "y.h5")


@pytest.mark.parametrize("name", ["a b\nc.h5", "ü.h5", "'", "\udcff.h5"])
@pytest.mark.long
def test_any_name_can_be_asked_for(stored, tmp_path, name):
    path = tmp_path / name
    path.write_bytes(stored.read_bytes())
    assert isolation.refused([path]) == {}


def test_a_name_that_no_file_has_is_refused(stored):
    assert "embedded null" in str(isolation.refused([f"a\0{stored}"])[f"a\0{stored}"])


@pytest.mark.parametrize("seed", [210, 639])
def test_a_file_that_makes_the_library_crash_is_refused_and_the_next_is_tried(stored, tmp_path_factory, seed):
    """Two that the fuzz test found: a division by zero and a segmentation fault in HDF5 2.0.0."""
    other = stored.with_name("y.h5")
    other.write_bytes(stored.read_bytes())
    samples = READERS["forged"](tmp_path_factory.mktemp("samples")).samples
    image = changed(samples[seed % len(samples)], samples, seed)
    stored.write_bytes(image + seal.line_of(image))
    found = isolation.refused([stored, other, stored.with_name("z.h5")])
    assert list(map(str, found)) == [str(stored), str(stored.with_name("z.h5"))]
    assert isinstance(found[str(stored)], RefusedError)
    told = f"{stored}: (the HDF5 library fails on it|not a readable HDF5 file)"
    assert re.match(told, str(found[str(stored)]))


@pytest.mark.parametrize("ended", [0, 1, 2])
@pytest.mark.long
def test_a_file_that_ends_the_child_is_refused_and_those_after_it_are_tried(stored, monkeypatch, ended):
    """What the HDF5 library does to the child on a file that was made to, done to its answers."""
    others = [stored.with_name(f"{name}.h5") for name in "abc"]
    for other in others:
        other.write_bytes(stored.read_bytes())
    honest, asked = isolation.tried, []

    def cut_short(paths, _module):
        asked.append(paths)
        answers, status = honest(paths)
        return (answers[:ended], -11) if len(asked) == 1 else (answers, status)

    monkeypatch.setattr(isolation, "tried", cut_short)
    found = isolation.refused(others)
    assert list(found) == [str(others[ended])]
    assert "the HDF5 library fails on it" in str(found[str(others[ended])])
    assert asked[1:] == ([[str(other) for other in others[ended + 1 :]]] if ended < 2 else [])


@pytest.mark.parametrize(
    ("code", "patience", "ends"),
    [("while True: pass", 60, {signal.SIGKILL, signal.SIGXCPU}), ("time.sleep(60)", 1, {signal.SIGALRM})],
)
@pytest.mark.long
def test_a_file_that_takes_too_long_ends_the_child(code, patience, ends):
    """By the time of the processor, and by the clock."""
    code = f"""
import time
from stiffdice.io import isolation
isolation.PATIENCE = {patience}
isolation._limit(1)
{code}
"""
    assert -subprocess.run([sys.executable, "-c", code], check=False).returncode in ends


@pytest.mark.long
def test_a_bomb_inside_a_chunk_does_not_get_the_memory(stored):
    """Deflate swells past the chunk that it is for: 2 MB are stored, and stand for 2 GB."""
    block = zlib.compressobj(9)
    zeros = block.compress(bytes(32 << 20)) + block.flush(zlib.Z_FULL_FLUSH)
    head, body = zeros[:2], zeros[2:]
    with h5py.File(stored, "a") as file:
        size = PIECE // 8
        file.create_dataset("size", (size,), "f8").make_scale("This is a netCDF dimension but not a netCDF variable")
        file["size"].attrs["_Netcdf4Dimid"] = np.int32(99)
        more = add(file, "more", np.zeros(size), ("size",), chunks=(size,), compression="gzip")
        more.id.write_direct_chunk((0,), head + body * (PIECE // len(body)))
    seal.seal(stored)
    with pytest.raises(RefusedError, match=f"{stored}: not a readable HDF5 file|more memory"):
        isolation.admit(stored)


def test_the_child_has_its_limits():
    resource = pytest.importorskip("resource")
    code = f"""
import resource
from stiffdice.io import isolation
isolation._limit(7)
print(*[resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_AS, resource.RLIMIT_CORE)])
try:
    bytearray(isolation.MEMORY)
except MemoryError:
    print("no more")
assert resource.getrlimit(resource.RLIMIT_CPU)[0] <= {7 + 10}
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split("\n")[:2] == [f"{isolation.MEMORY} 0", "no more"]
    assert resource.getrlimit(resource.RLIMIT_AS)[0] != isolation.MEMORY, "the parent keeps its own"


def test_the_child_needs_little_to_start():
    code = "import sys, stiffdice.io.isolation; print(*{'xarray', 'numba', 'h5netcdf', 'yaml'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""


def test_nothing_beside_a_file_is_run(stored, monkeypatch):
    (stored.parent / "h5py.py").write_text("raise SystemExit('imported from the folder of the file')")
    monkeypatch.chdir(stored.parent)
    isolation.admit("x.h5")

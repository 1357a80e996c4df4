"""What is written is read again, by xarray, h5py and the tools of HDF5 and netCDF; what is not ours is refused."""

from __future__ import annotations

import hashlib
import json
import os
import resource
import shutil
import subprocess

import h5py
import numpy as np
import pytest
import xarray as xr

from stiffdice import __version__
from stiffdice.errors import InputError, OutputError, RefusedError
from stiffdice.io import seal
from stiffdice.io.reader import open_file
from stiffdice.io.writer import check_target, clear, write_bytes, write_dataset
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.run import simulate


@pytest.fixture(scope="module")
def run():
    scene = from_mapping({"launch": {"angular_momentum": {"seed": 3}}})
    return simulate(scene, model="tumbling", steps=1000, every=10)


@pytest.fixture
def stored(tmp_path, run):
    path = tmp_path / "run.h5"
    write_dataset(run_dataset(run), path)
    return path


def test_xarray_opens_it_with_its_default_engine(stored, run):
    with xr.open_dataset(stored) as found:
        xr.testing.assert_identical(found.load(), run_dataset(run).load())


def test_our_reader_gives_the_same(stored, run):
    xr.testing.assert_identical(open_file(stored), run_dataset(run))


def test_the_contracts_variables_are_there(stored):
    found = open_file(stored)
    shapes = {
        "time": ("time",),
        "position": ("time", "axis"),
        "velocity": ("time", "axis"),
        "angular_momentum": ("time", "axis"),
        "node_offset": ("time", "node", "axis"),
        "kinetic_energy": ("time",),
        "potential_energy": ("time",),
        "elastic_energy": ("time",),
        "energy_paper": ("time",),
    }
    for name, dims in shapes.items():
        assert found[name].dims == dims
    assert found.attrs["model"] == "tumbling"
    assert found.attrs["scheme"] == "symplectic_euler"
    assert found.attrs["steps"] == 1000
    assert found.attrs["stiffdice_version"] == __version__
    assert len(found.attrs["code_digest"]) == 64


def test_the_scene_inside_is_the_scene_that_ran(stored, run):
    attributes = open_file(stored).attrs
    again = from_mapping(json.loads(attributes["scene"]))
    assert again == run.scene
    assert again.digest == attributes["scene_digest"]
    np.testing.assert_array_equal(attributes["angular_momentum_at_launch"], again.launch.spin)


def test_everything_has_a_unit_and_a_long_name(stored):
    for name, variable in open_file(stored).variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name


def test_enums_are_bytes_with_their_meanings(stored):
    verdict = open_file(stored).verdict
    assert verdict.dtype == np.int8
    assert len(verdict.attrs["flag_meanings"].split()) == len(verdict.attrs["flag_values"])


def test_every_chunk_has_a_checksum(stored):
    with h5py.File(stored) as file:
        for name in ("position", "node_offset", "time"):
            assert (file[name].compression, file[name].shuffle, file[name].fletcher32) == ("gzip", True, True)
        assert "_FillValue" not in file["time"].attrs


def test_equal_runs_give_equal_bytes(tmp_path, run):
    digests = set()
    for name in ("a.h5", "b.h5"):
        write_dataset(run_dataset(run), tmp_path / name)
        digests.add(hashlib.sha256((tmp_path / name).read_bytes()).hexdigest())
    assert len(digests) == 1


def test_sliding_runs_have_no_rotation(tmp_path):
    dataset = run_dataset(simulate(from_mapping({}), model="sliding", steps=100, every=1))
    assert "node_offset" not in dataset
    assert "angular_momentum" not in dataset


@pytest.mark.parametrize("tool", [["h5dump", "-H"], ["h5dump"], ["ncdump", "-h"], ["ncdump"]], ids=" ".join)
def test_the_tools_of_hdf5_and_netcdf_read_it(stored, tool):
    if shutil.which(tool[0]) is None:
        pytest.skip(f"{tool[0]} is not installed (Debian: hdf5-tools, netcdf-bin)")
    done = subprocess.run([*tool, stored], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "node_offset" in done.stdout
    assert "error" not in done.stderr.lower()


def test_a_damaged_file_is_noticed(stored):
    image = bytearray(stored.read_bytes())
    with h5py.File(stored) as file:
        chunk = file["position"].id.get_chunk_info(0)
    image[chunk.byte_offset + chunk.size // 2] ^= 0xFF
    stored.write_bytes(image)
    with pytest.raises(RefusedError, match=rf"{stored}: damaged: its content is not what was sealed"):
        open_file(stored)
    stored.write_bytes(image[: -seal.LENGTH])
    seal.seal(stored)
    with pytest.raises(RefusedError, match=rf"{stored}: not a readable HDF5 file"):
        open_file(stored)


def external_link(file, tmp_path):
    file["elsewhere"] = h5py.ExternalLink("/etc/passwd", "/")


def soft_link(file, tmp_path):
    file["elsewhere"] = h5py.SoftLink("/elsewhere")


def external_storage(file, tmp_path):
    secret = tmp_path / "secret"
    secret.write_bytes(b"x" * 80)
    file.create_dataset("elsewhere", (10,), "f8", external=[(str(secret), 0, 80)])


def virtual_dataset(file, tmp_path):
    layout = h5py.VirtualLayout((10,), "f8")
    layout[:] = h5py.VirtualSource("other.h5", "x", (10,))
    file.create_virtual_dataset("elsewhere", layout)


def group(file, tmp_path):
    file.create_group("elsewhere")


@pytest.mark.parametrize("trick", [external_link, soft_link, external_storage, virtual_dataset, group])
def test_a_file_that_points_elsewhere_is_refused(stored, tmp_path, trick):
    with h5py.File(stored, "a") as file:
        trick(file, tmp_path)
    seal.seal(stored)
    with pytest.raises(InputError, match=rf"{stored}: elsewhere: "):
        open_file(stored)


@pytest.mark.parametrize(
    ("content", "told"),
    [(b"", "not a readable HDF5 file"), (b"hello", "not a readable"), (b"\x89HDF\r\n\x1a\n" * 9, "not a readable")],
)
def test_what_is_not_hdf5_is_refused(tmp_path, content, told):
    path = tmp_path / "x.h5"
    path.write_bytes(content)
    with pytest.raises(InputError, match=told):
        open_file(path)


def test_a_truncated_file_is_refused(stored):
    stored.write_bytes(stored.read_bytes()[:-1000])
    with pytest.raises(InputError, match="not a readable HDF5 file"):
        open_file(stored)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match="No such file or directory"):
        open_file(tmp_path / "x.h5")


@pytest.mark.parametrize(("version", "told"), [("2.0", r"format_version = 2.0: allowed is 1\.x"), (None, "no format")])
def test_other_formats_are_refused(stored, version, told):
    with h5py.File(stored, "a") as file:
        del file.attrs["format_version"]
        if version:
            file.attrs["format_version"] = version
    with pytest.raises(InputError, match=told):
        open_file(stored)


@pytest.mark.parametrize("place", ["nowhere/out.h5", "."])
def test_a_place_that_cannot_be_written_is_told_before_the_work(tmp_path, place):
    with pytest.raises(OutputError):
        check_target(tmp_path / place)


def test_a_read_only_folder_is_told(tmp_path, monkeypatch):
    # The folder's mode would not stop root, as whom tests may run.
    monkeypatch.setattr(os, "access", lambda path, mode: not mode & os.W_OK)
    with pytest.raises(OutputError, match=rf"the folder {tmp_path} is not writable"):
        check_target(tmp_path / "out.h5")


def test_a_full_disk_leaves_what_was_there(tmp_path):
    """A limit on the file size stands for the disk: the write fails half way through."""
    path = tmp_path / "out.h5"
    path.write_bytes(b"before")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, hard))
    try:
        with pytest.raises(OutputError, match=rf"{path}: File too large; nothing was stored"):
            write_bytes(b"x" * 100_000, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert path.read_bytes() == b"before"
    assert [entry.name for entry in tmp_path.iterdir()] == ["out.h5"]


def test_what_is_unfinished_of_a_file_and_nothing_else_is_cleared(tmp_path):
    ours, others = [".a.h5.n1.7.part", ".a.h5.node-2.example.org.8.part"], ["a.h5", ".a.h5", ".ba.h5.n1.7.part"]
    for name in (*ours, *others):
        (tmp_path / name).touch()
    clear(tmp_path / "a.h5")
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(others)
    clear(tmp_path / "nowhere" / "a.h5")

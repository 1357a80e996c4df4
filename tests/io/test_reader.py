"""What we write is read back equal, to the last bit, by everything that people read netCDF and HDF5 with."""

from __future__ import annotations

import re
import shutil
import subprocess

import h5py
import numpy as np
import pytest
import xarray as xr

from stiffdice.io.reader import open_file

KINDS = ("run", "pair", "shard", "sweep", "frontier", "experiment")


def tool(name, package):
    return pytest.mark.skipif(shutil.which(name) is None, reason=f"{name} is not installed (Debian: {package})")


def output(*command):
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def numbers(text):
    """Return the numbers in a printed list; a dash or NaNf is none."""
    words = re.split(r"[\s,]+", text.strip())
    return np.array([float(re.sub(r"(?i)nanf?|_", "nan", word)) for word in words if word])


def by_h5netcdf(path, names):
    with xr.open_dataset(path, engine="h5netcdf", decode_times=False) as dataset:
        return {name: dataset[name].values for name in names}


def by_netcdf4(path, names):
    with xr.open_dataset(path, engine="netcdf4", decode_times=False) as dataset:
        return {name: dataset[name].values for name in names}


def by_netcdf4_alone(path, names):
    import netCDF4

    with netCDF4.Dataset(path) as file:
        return {name: np.ma.filled(file[name][...], np.nan) for name in names}


def by_h5py(path, names):
    with h5py.File(path) as file:
        return {name: file[name][()] for name in names}


def by_h5dump(path, names):
    text = output("h5dump", "-y", "-m", "%.17g", *(word for name in names for word in ("-d", name)), path)
    datasets = dict(re.findall(r'^DATASET "(.*?)" \{.*?^   DATA \{(.*?)\}', text, re.M | re.S))
    return {name: numbers(datasets[name]) for name in names}


def by_ncdump(path, names):
    text = output("ncdump", "-p", "9,17", "-v", ",".join(names), path).split("\ndata:\n")[1]
    return {name: numbers(re.search(rf"^ {name} =(.*?) ;", text, re.M | re.S)[1]) for name in names}


def by_octave(path, names):
    # Octave's arrays run through their first index first, so that it prints ours in their own order.
    shown = "".join(f"printf('{name}: %s\\n', sprintf('%.17g ', s.{name})); " for name in names)
    lines = output("octave-cli", "--no-init-file", "--eval", f"s = load('-hdf5', '{path}'); {shown}").splitlines()
    return {name: numbers(line.partition(":")[2]) for name, line in zip(names, lines, strict=False)}


READERS = [
    by_h5netcdf,
    by_netcdf4,
    by_netcdf4_alone,
    by_h5py,
    pytest.param(by_h5dump, marks=tool("h5dump", "hdf5-tools")),
    pytest.param(by_ncdump, marks=tool("ncdump", "netcdf-bin")),
    pytest.param(by_octave, marks=tool("octave-cli", "octave")),
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("read", READERS)
@pytest.mark.long
def test_every_value_is_read_back_equal(written, read, kind):
    ours = open_file(written[kind])
    found = read(written[kind], [str(name) for name in ours.variables])
    for name, variable in ours.variables.items():
        np.testing.assert_array_equal(np.ravel(found[name]).astype(variable.dtype), variable.values.ravel(), name)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("engine", ["h5netcdf", "netcdf4"])
@pytest.mark.long
def test_attributes_are_read_back_equal(written, engine, kind):
    ours = open_file(written[kind])
    with xr.open_dataset(written[kind], engine=engine, decode_times=False) as theirs:
        assert_equal(theirs.attrs, ours.attrs)
        for name in ours.variables:
            assert theirs[name].dims == ours[name].dims
            assert_equal(theirs[name].attrs, ours[name].attrs)


def assert_equal(theirs, ours):
    assert set(theirs) == set(ours)
    for key, value in ours.items():
        np.testing.assert_array_equal(theirs[key], value, key)
        assert isinstance(theirs[key], str) == isinstance(value, str)

"""The lock files pin and hash everything, and name no place it comes from."""

from __future__ import annotations

import re
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "requirements"


def locked(name: str) -> dict[str, str]:
    text = (FOLDER / f"{name}.lock").read_text()
    return {found[1].lower(): found[2] for found in re.finditer(r"^([\w.-]+)==([^\s;]+)", text, re.MULTILINE)}


@pytest.mark.parametrize("name", ["build", "requirements"])
def test_every_line_is_a_pin_a_hash_or_a_comment(name):
    text = (FOLDER / f"{name}.lock").read_text()
    for line in text.splitlines():
        assert re.fullmatch(r"[\w.-]+==\S+( ; .+)? \\|    --hash=sha256:[0-9a-f]{64}( \\)?| *#.*", line), line
    assert "://" not in text


@pytest.mark.parametrize("name", ["build", "requirements"])
def test_every_requirement_has_its_reason_and_is_locked(name):
    lines = (FOLDER / f"{name}.in").read_text().splitlines()
    for line in lines:
        if line and not line.startswith("#"):
            package, _, reason = line.partition("#")
            assert len(reason.strip()) > 10, line
            assert package.strip().lower() in locked(name)


def test_what_runs_is_what_is_locked():
    for package in ("numpy", "numba", "xarray", "h5py", "h5netcdf", "matplotlib", "snakemake"):
        assert version(package) == locked("requirements")[package]


def test_the_conda_environment_has_the_locked_versions():
    environment = yaml.safe_load((ROOT / "workflow" / "envs" / "stiffdice.yaml").read_text())
    pins = environment["dependencies"][-1]["pip"]
    assert len(pins) >= 9
    for pin in pins:
        package, _, pinned = pin.partition("==")
        assert locked("requirements")[package.lower()] == pinned

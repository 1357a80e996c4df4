"""The lock files pin and hash everything, and name no place it comes from."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pytest
import yaml
from requirements import install_extras

ROOT = Path(__file__).parent.parent
FOLDER = ROOT / "requirements"
LOCKS = ("build", "requirements", *install_extras.EXTRAS)
ENGINES = ("mujoco", "drake", "dartpy", "pybullet")


def locked(name: str) -> dict[str, str]:
    text = (FOLDER / f"{name}.lock").read_text()
    return {found[1].lower(): found[2] for found in re.finditer(r"^([\w.-]+)==([^\s;]+)", text, re.MULTILINE)}


@pytest.mark.parametrize("name", LOCKS)
def test_every_line_is_a_pin_a_hash_or_a_comment(name):
    text = (FOLDER / f"{name}.lock").read_text()
    for line in text.splitlines():
        assert re.fullmatch(r"[\w.-]+==\S+( ; .+)? \\|    --hash=sha256:[0-9a-f]{64}( \\)?| *#.*", line), line
    assert "://" not in text


@pytest.mark.parametrize("name", LOCKS)
def test_every_requirement_has_its_reason_and_is_locked(name):
    lines = (FOLDER / f"{name}.in").read_text().splitlines()
    for line in lines:
        if line and not line.startswith(("#", "-c ")):
            package, _, reason = line.partition("#")
            assert len(reason.strip()) > 10, line
            assert package.split()[0].lower() in locked(name)


def test_what_runs_is_what_is_locked():
    for package in ("numpy", "numba", "xarray", "h5py", "h5netcdf", "matplotlib", "snakemake"):
        assert version(package) == locked("requirements")[package]


@pytest.mark.parametrize(("extra", "package"), [("engines", "numpy"), ("docs", "jinja2")])
def test_extras_are_locked_to_the_versions_that_all_else_runs_with(extra, package):
    shared = locked(extra).keys() & locked("requirements").keys()
    assert package in shared
    for name in shared:
        assert locked(extra)[name] == locked("requirements")[name]


@pytest.mark.parametrize("engine", ENGINES)
def test_an_engine_that_is_here_is_the_locked_one(engine):
    try:
        here = version(engine)
    except PackageNotFoundError:
        pytest.skip(f"{engine} is not installed")
    assert here == locked("engines")[engine]


def test_the_extra_names_what_the_lock_is_made_of():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert tuple(project["optional-dependencies"]["engines"]) == ENGINES
    assert tuple(install_extras.asked(FOLDER / "engines.lock")) == ENGINES


def test_an_engine_is_installed_with_what_it_needs_and_nothing_of_the_others():
    lock = (FOLDER / "engines.lock").read_text()
    parts = {engine: install_extras.needed(lock, engine) for engine in ENGINES}
    assert set(parts["pybullet"]) == {"pybullet"}
    assert set(parts["dartpy"]) == {"dartpy", "numpy"}
    assert {"mujoco", "mujoco-core", "numpy", "glfw"} <= set(parts["mujoco"])
    assert {"drake", "numpy", "matplotlib", "contourpy"} <= set(parts["drake"])
    assert not {"drake", "mosek", "matplotlib"} & set(parts["mujoco"])
    assert set().union(*parts.values()) == set(locked("engines"))
    for blocks in parts.values():
        for block in blocks.values():
            assert "--hash=sha256:" in block
            assert block in lock


def test_what_builds_the_site_is_installed_with_all_that_it_needs():
    lock = (FOLDER / "docs.lock").read_text()
    parts = [install_extras.needed(lock, name) for name in install_extras.asked(FOLDER / "docs.lock")]
    assert set().union(*parts) == set(locked("docs"))


@pytest.mark.long
def test_an_engine_that_cannot_be_installed_is_left_out_with_a_line(tmp_path):
    (tmp_path / "engines.in").write_text("# none\n-c requirements.lock\nengine-of-none  # there is none\n")
    (tmp_path / "engines.lock").write_text(f"engine-of-none==1.0 \\\n    --hash=sha256:{'0' * 64}\n")
    done = subprocess.run(
        [sys.executable, FOLDER / "install_extras.py", tmp_path / "engines.lock"],
        env=os.environ | {"PIP_NO_INDEX": "1", "PIP_CONFIG_FILE": os.devnull, "PYTHON": sys.executable},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert re.fullmatch(r"stiffdice: engine-of-none is left out: no wheel of engine-of-none==1.0 for .+\n", done.stdout)
    assert done.stderr == ""


def test_the_conda_environment_has_the_locked_versions():
    environment = yaml.safe_load((ROOT / "workflow" / "envs" / "stiffdice.yaml").read_text())
    pins = environment["dependencies"][-1]["pip"]
    assert len(pins) >= 9
    for pin in pins:
        package, _, pinned = pin.partition("==")
        assert locked("requirements")[package.lower()] == pinned

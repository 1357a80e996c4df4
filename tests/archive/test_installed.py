"""Whether an archive's code is the installed code, file by file."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from stiffdice import __version__
from stiffdice.archive import contents, installed, manifest
from stiffdice.dynamics.code_digest import PACKAGE

ROOT = PACKAGE.parents[1]


@pytest.fixture(scope="module")
def listed():
    """The digests that a manifest of this project's code has, and of a scene."""
    files = [file for top in ("src", "workflow") for file in contents.tree(ROOT, top, "code")]
    named = {file.path: file.source for file in files} | {name: ROOT / name for name in ("Snakefile", "Makefile")}
    return {name: manifest.digest_of(path) for name, path in named.items()} | {"config/scenes/mine.yaml": "0" * 64}


def test_this_projects_code_is_the_installed_code(listed):
    code = installed.compared(ROOT, listed)
    assert code.is_installed and code.version == __version__ and code.files == len(listed) - 2
    assert str(code).startswith(f"its code is the installed code, stiffdice {__version__}: all {code.files} files")


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("src/stiffdice/dynamics/contact.py", "0" * 64),
        ("src/stiffdice/io/more.py", "0" * 64),
        ("src/numpy/__init__.py", "0" * 64),
        ("workflow/run.py", "0" * 64),
        ("workflow/profiles/default/config.yaml", None),
        ("Snakefile", "0" * 64),
    ],
)
def test_one_file_makes_it_other_code(listed, name, digest):
    """Changed, added or missing."""
    changed = {key: value for key, value in {**listed, name: digest}.items() if value}
    code = installed.compared(ROOT, changed)
    assert not code.is_installed and code.other == (name,)
    assert f"installed is {__version__}: 1 of {code.files} files differ: {name}" in str(code)


def test_some_of_many_are_named(listed):
    code = installed.compared(ROOT, dict.fromkeys(listed, "0" * 64))
    assert str(code).endswith(f" and {len(code.other) - installed.SHOWN} more")


def test_a_package_that_is_no_checkout_has_no_workflow_to_run(listed, tmp_path, monkeypatch):
    """As a wheel installs it: its library is compared, and the difference says what is missing."""
    package = tmp_path / "site-packages" / PACKAGE.name
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(installed, "PACKAGE", package)
    code = installed.compared(ROOT, listed)
    assert {Path(name).parts[0] for name in code.other} == {"Snakefile", "workflow"}
    assert "a package has no Snakefile and no workflow/, a checkout has" in str(code)

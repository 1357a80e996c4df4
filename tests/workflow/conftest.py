from __future__ import annotations

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest
from tests.shared import made_once
from tests.workflow.test_workflow import Project


class Made(NamedTuple):
    """A project whose study `tiny` has run, and what `make study` said of it. Not to be changed."""

    folder: Path
    stdout: str
    stderr: str

    def copy(self, folder: Path) -> Project:
        """Return a copy, as `cp -a` makes it, whose files a test may change."""
        shutil.copytree(self.folder, folder, symlinks=True)
        return Project.at(folder)


@pytest.fixture(scope="session")
def made(tmp_path_factory) -> Made:
    def make(folder: Path) -> dict[str, str]:
        done = Project(folder).make("--cores", "2")
        assert done.returncode == 0, done.stdout + done.stderr
        return {"stdout": done.stdout, "stderr": done.stderr}

    folder, said = made_once(tmp_path_factory, "tiny", make)
    return Made(folder, **said)

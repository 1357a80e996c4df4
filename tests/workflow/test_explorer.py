"""The explorer is published from what is stored, and again whenever it is asked for."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from tests.forks import run_module
from tests.workflow.test_workflow import Project

pytestmark = [pytest.mark.workflow, pytest.mark.long]


def test_the_page_is_published_without_any_study_and_again_when_asked(tmp_path):
    project = Project(tmp_path)
    command = [sys.executable, "workflow/run.py", "explorer", "--cores", "1"]
    page = tmp_path / "results" / "explorer.html"
    done = subprocess.run(command, cwd=tmp_path, env=project.environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    again = run_module("snakemake", "-n", "explorer", cwd=tmp_path, environment=project.environment)
    assert re.search(r"^explorer +1$", again.stdout + again.stderr, re.MULTILINE), again
    assert "</html>" in page.read_text()
    assert "made: explorer.html " in (tmp_path / "results" / "explorer.log").read_text()
    assert {path.name for path in (tmp_path / "results").iterdir()} == {"explorer.html", "explorer.log"}

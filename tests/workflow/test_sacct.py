"""The sacct that stands between Snakemake's plugin and Slurm, with scripts in the place of Slurm's commands."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

SACCT = Path(__file__).parent.parent.parent / "workflow" / "profiles" / "slurm" / "bin" / "sacct"
# As the plugin asks.
ASKED = ["-X", "--parsable2", "--clusters", "all", "--noheader", "--format=JobIdRaw,State", "--name", "some-run"]


@pytest.fixture
def ask(tmp_path):
    """Ask, of a Slurm that says `says` (None: it does not answer), by sacct or by squeue."""

    def ask(says: str | None, *asked: str, by: str = "squeue") -> subprocess.CompletedProcess[str]:
        command = tmp_path / by
        command.write_text(f"#!/bin/sh\n{'exit 1' if says is None else f'printf %b {says!r}'}\n")
        command.chmod(0o755)
        path = os.pathsep.join([str(SACCT.parent), str(tmp_path), os.environ["PATH"]])
        real = str(command) if by == "sacct" else ""
        return subprocess.run(
            ["sacct", *(asked or ASKED)],
            cwd=tmp_path,
            env={**os.environ, "PATH": path, "SLURM_SACCT": real},
            capture_output=True,
            text=True,
            check=False,
        )

    return ask


def states(answer: subprocess.CompletedProcess[str]) -> set[str]:
    assert answer.returncode == 0, answer.stderr
    return set(answer.stdout.split("\n")) - {""}


def test_without_accounting_a_job_that_the_controller_forgot_has_failed(ask):
    assert states(ask("1|RUNNING\n2|COMPLETED\n")) == {"1|RUNNING", "2|COMPLETED"}
    assert ask(None).returncode != 0  # nobody answers: no state is known, and none is forgotten
    assert states(ask("2|COMPLETED\n3|PENDING\n")) == {"1|FAILED", "2|COMPLETED", "3|PENDING"}
    assert states(ask("")) == {"1|FAILED", "2|FAILED", "3|FAILED"}


def test_who_cancelled_a_job_is_left_out(ask):
    assert states(ask("1|CANCELLED by 1000\n2|RUNNING\n", by="sacct")) == {"1|CANCELLED", "2|RUNNING"}
    assert ask(None, by="sacct").returncode != 0


@pytest.mark.parametrize("by", ["sacct", "squeue"])
@pytest.mark.parametrize(
    "asked",
    [("-nu", "me", "-o", "Account%256", "|", "tail", "-1"), ("-j", "1", "-n", "-X", "-o", "nodelist%-256")],
    ids=["account", "lost node"],
)
def test_what_would_be_taken_for_something_else_is_not_said(ask, by, asked):
    assert states(ask("None assigned", *asked, by=by)) == set()


def test_why_a_job_failed_is_said(ask):
    assert states(ask("OutOfMemory", "-j", "1.0", "--format=Reason", "--noheader", by="sacct")) == {"OutOfMemory"}

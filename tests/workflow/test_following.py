"""Of what Snakemake says a person sees what is for people; the rest is withheld, and shown where nothing else tells."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SAID = [
    "Building DAG of jobs...",
    "stiffdice: tiny: 2 jobs, about 9 s on 2 cores",
    "stiffdice: tiny: 0 of 2 jobs done, about 9 s left",
    "1 of 3 steps (33%) done",
    "stiffdice: tiny: 1 of 2 jobs done, about 4 s left",
    "stiffdice: results/tiny/x.png: set aside",
    "Complete log(s): somewhere",
]
SNAKEMAKE = f"import sys; sys.stderr.write({chr(10).join(SAID)!r} + chr(10)); raise SystemExit(3)"
FOLLOW = f"""
import os, sys
sys.path.insert(0, {str(ROOT / "workflow")!r})
import following
status, withheld = following.follow([sys.executable, "-c", {SNAKEMAKE!r}], {str(ROOT)!r}, os.environ, lambda: None)
print(status, withheld.count("\\n"), "Building DAG" in withheld, "stiffdice" in withheld)
"""


def test_elsewhere_our_lines_are_shown_and_no_other():
    done = subprocess.run([sys.executable, "-c", FOLLOW], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines() == [line for line in SAID if line.startswith("stiffdice: ")]
    assert done.stdout == "3 3 True False\n"


def test_on_a_terminal_what_is_left_is_one_line_that_moves():
    parent, child = pty.openpty()
    subprocess.run([sys.executable, "-c", FOLLOW], stderr=child, stdout=subprocess.DEVNULL, check=True)
    os.close(child)
    shown = os.read(parent, 10_000).decode().replace("\r\n", "\n")
    os.close(parent)
    first, zero, one, aside = (line for line in SAID if line.startswith("stiffdice: "))
    assert shown == f"{first}\n{zero}\r\x1b[K{one}\r\x1b[K{aside}\n"


@pytest.mark.long
def test_a_run_that_fails_before_a_job_shows_what_snakemake_says(tmp_path):
    command = [sys.executable, "workflow/run.py", "--cores", "1", "no_such_rule"]
    failed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert failed.returncode == 1
    assert "no_such_rule" in failed.stderr

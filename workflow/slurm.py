"""What has to be there before jobs are sent to Slurm; how they are watched where nobody keeps accounts, and told."""

from __future__ import annotations

import logging
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

from snakemake_interface_logger_plugins.common import LogEvent

# A sacct that answers what the plugin understands; see there.
SACCT = Path(__file__).parent / "profiles" / "slurm" / "bin"
PATIENCE = 60  # seconds that Slurm may take to answer
HOW = "see docs/how-to/slurm.md"
# Of default-resources, those that Slurm may refuse whatever the job.
KEYS = {"slurm_account": "account", "slurm_partition": "partition", "qos": "qos", "constraint": "constraint"}


class SlurmError(Exception):
    """What is missing, in one line."""


def prepare(status_command: str | None, given: Mapping[str, object]) -> str | None:
    """Return a line on what was changed so that jobs can be watched, if anything.

    Raises SlurmError if Slurm is not there, or takes no jobs of the resources `given`, or they cannot be watched.
    status_command: of the profile. Snakemake's plugin waits for ever, without a word, for a sacct that does not answer;
    and where the profile says squeue, it turns to sacct as soon as the controller is away.
    """
    if shutil.which("sbatch") is None:
        raise SlurmError(f"no sbatch on the PATH: is this a login node of the cluster, its Slurm loaded? ({HOW})")
    accounts = re.search(r"^AccountingStorageType\s*=\s*(\S+)", _answer("scontrol", "show", "config"), re.MULTILINE)
    values = {name: str(given[key]).strip("'\"") for key, name in KEYS.items() if given.get(key) is not None}
    named = [f"--{name}={value}" for name, value in values.items() if re.fullmatch(r"[\w.,@&|-]+", value)]
    _answer("sbatch", "--test-only", *named, "--wrap=true")
    sacct = shutil.which("sacct") if accounts and "slurmdbd" in accounts[1] and status_command != "squeue" else None
    if sacct:
        _answer("sacct", "-X", "--noheader", "--name=none")
    os.environ["SLURM_SACCT"] = sacct or ""
    os.environ["PATH"] = os.pathsep.join([str(SACCT), os.environ.get("PATH", "")])
    return None if sacct else f"no accounting is asked: jobs are watched with squeue ({HOW})"


def _answer(*command: str) -> str:
    """Return what a command of Slurm says; raises SlurmError if it fails or says nothing for too long."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        raise SlurmError(f"{command[0]}: no answer within {PATIENCE} s ({HOW})") from None
    except OSError as error:
        raise SlurmError(f"{command[0]}: {error.strerror} ({HOW})") from None
    if done.returncode != 0:
        said = done.stderr.strip().splitlines() or [f"exit status {done.returncode}"]
        asked = " ".join(word for word in command if "=" in word and word.split("=")[0][2:] in KEYS.values())
        raise SlurmError(f"{' '.join([command[0], asked]).strip()}: {said[-1].removeprefix(f'{command[0]}: ')} ({HOW})")
    return done.stdout


class Failures(logging.Handler):
    """Prints a line for every job that failed, also where the profile is quiet about jobs, and Snakemake about this."""

    def emit(self, record: logging.LogRecord) -> None:
        """Say which files were not made, why, and where more is said."""
        told = vars(record)
        if told.get("event") != LogEvent.JOB_ERROR:
            return
        # What was called for is in Snakemake's log; it would fill a screen.
        reason = (told["rule_msg"] or "failed").split("    sbatch call:")[0].split("For further error details")[0]
        logs = "; ".join(log.split(" (check log")[0] for log in told["log"])
        print(f"stiffdice: {', '.join(told['output'])}: {' '.join(reason.split())} (logs: {logs})", file=sys.stderr)

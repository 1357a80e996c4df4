"""New processes: what a person who types a command waits for."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from stiffdice.dynamics.code_digest import PACKAGE
from stiffdice.errors import StiffdiceError


def environment(cache: Path | None = None) -> dict[str, str]:
    """Return the environment of a process that runs this package; cache: the folder for its compiled code."""
    path = os.pathsep.join([str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    return {**os.environ, "PYTHONPATH": path} | ({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})


def command(*arguments: str) -> list[str]:
    """Return the command `stiffdice` with these arguments, in this Python."""
    return [sys.executable, "-m", "stiffdice.cli", *arguments]


def run_all(commands: Sequence[Sequence[str]], cache: Path | None = None, folder: Path | None = None) -> None:
    """Start all commands at once and wait for them; raises StiffdiceError with what one says that fails."""
    started = [
        subprocess.Popen(
            words, env=environment(cache), cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        for words in commands
    ]
    told = [process.communicate()[0] for process in started]
    for words, process, text in zip(commands, started, told, strict=True):
        if process.returncode:
            raise StiffdiceError(f"{' '.join(words)}: exit status {process.returncode}: {text.strip()[-500:]}")

"""`stiffdice status`: how far a study is."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from stiffdice.cli import common

if TYPE_CHECKING:
    from stiffdice.study.status import Status

EXAMPLES = """\
examples:
  stiffdice status                  # every study that has results, a line each
  make study STUDY=quick
  stiffdice status quick
  stiffdice status quick --watch
  stiffdice status quick --json

To be called in the project's folder. Exit status: 0 all is done; 1 something failed; 3 something is not done yet;
2 bad input.
"""
SCHEMA = "workflow/schemas/study.schema.yaml"
SECONDS = 2.0
# Between two jobs nothing runs for a moment: only so many looks in a row tell that a run has ended.
QUIET = 4


def add(commands: common.Commands) -> None:
    """Add the command to the parser."""
    status = common.add_command(
        commands,
        "status",
        _status,
        "say how far a study is: done, running, failed and why, time left, disk used",
        EXAMPLES,
    )
    status.add_argument("study", metavar="STUDY", nargs="?", help="a file in config/, without .yaml")
    status.add_argument("--watch", action="store_true", help="look every two seconds, until the run has ended")
    status.add_argument("--cores", type=int, metavar="N", help="for the time left (default: as many as are at work)")
    common.add_json(status)


def _status(options: argparse.Namespace) -> int:
    from stiffdice.scene import validation

    if options.cores is not None:
        validation.count("--cores", options.cores)
    if options.watch:
        return _watch(options)
    found = _found(options)
    _tell(found, options)
    return _exit_status(found)


def _found(options: argparse.Namespace) -> list[Status]:
    """Return how far the study is that is named, or each that has results."""
    from stiffdice.cli.progress import told_if_slow
    from stiffdice.errors import InputError
    from stiffdice.study import config as study
    from stiffdice.study import status

    if not Path(SCHEMA).is_file():
        raise InputError(f"{SCHEMA}: No such file; call stiffdice status in the project's folder")
    if options.study is not None and not study.NAME.fullmatch(options.study):
        raise InputError(f"STUDY = {options.study}: allowed is the name of a file in config/, without .yaml")
    made = (path.stem for path in sorted(Path("config").glob("*.yaml")) if Path("results", path.stem).is_dir())
    names = [options.study] if options.study is not None else list(made)
    with told_if_slow("planning the sweeps"):
        return [
            status.of(study.load(f"config/{name}.yaml", SCHEMA), Path("results", name), options.cores) for name in names
        ]


def _tell(found: list[Status], options: argparse.Namespace) -> None:
    from stiffdice.study import status_report

    if options.json:
        data = [status_report.as_data(status) for status in found]
        indent = None if options.watch else 2  # a line for each look
        print(json.dumps(data if options.study is None else data[0], indent=indent), flush=True)
    elif options.study is not None:
        print(status_report.as_text(found[0]), flush=True)
    else:
        lines = [status_report.as_line(status) for status in found]
        print("\n".join(lines or ["no study has results yet; `make study STUDY=quick` makes some"]), flush=True)


def _exit_status(found: list[Status]) -> int:
    from stiffdice.study.status import State

    states = {status.state for status in found}
    if State.FAILED in states:
        return 1
    return 0 if states == {State.DONE} else 3


def _watch(options: argparse.Namespace) -> int:
    """Tell again and again, until all is done, or the run that was seen at work has ended, or Ctrl-C."""
    from stiffdice.study.status import State

    ended, quiet, seen = 3, 0, False
    with contextlib.suppress(KeyboardInterrupt):
        while True:
            found = _found(options)
            if sys.stdout.isatty():
                print("\x1b[H\x1b[J", end="")  # from the top of an empty screen
            elif not options.json:
                print()
            _tell(found, options)
            running = any(status.those(State.RUNNING) for status in found)
            seen, quiet, ended = seen or running, 0 if running else quiet + 1, _exit_status(found)
            if quiet >= QUIET if seen else ended == 0:
                break
            time.sleep(SECONDS)
    return ended

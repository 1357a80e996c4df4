"""`stiffdice status`: how far a study is."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output

if TYPE_CHECKING:
    from stiffdice.study.status import Status

HELP = "say how far a study is: done, running, failed and why, time left, disk used"
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
SECONDS = 2.0
# Between two jobs nothing runs for a moment: only so many looks in a row tell that a run has ended.
QUIET = 4


def add(status: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    status.add_argument("study", metavar="STUDY", nargs="?", help="a file in config/, without .yaml")
    status.add_argument("--watch", action="store_true", help="look every two seconds, until the run has ended")
    grammar.add(status, "--cores", ", for the time left (default: as many as are at work)")
    grammar.add_form(status)


def call(options: argparse.Namespace) -> int:
    """Print how far the study is; with --watch again, until all is done, or the run seen at work has ended."""
    from stiffdice.study.status import State

    options.cores = None if options.cores is None else common.whole("--cores", options.cores)
    ended, quiet, seen = 3, 0, False
    with contextlib.suppress(KeyboardInterrupt) if options.watch else contextlib.nullcontext():
        while True:
            found = _found(options)
            _tell(found, options)
            running = any(status.those(State.RUNNING) for status in found)
            seen, quiet, ended = seen or running, 0 if running else quiet + 1, _exit_status(found)
            if not options.watch or (quiet >= QUIET if seen else ended == 0):
                break
            time.sleep(SECONDS)
    return ended


def _found(options: argparse.Namespace) -> list[Status]:
    """Return how far the study is that is named, or each that has results."""
    from stiffdice.cli.terminal.progress import notes
    from stiffdice.study import status

    common.check_folder()
    configured = sorted(path.stem for path in Path("config").glob("*.yaml"))
    with_results = [name for name in configured if Path("results", name).is_dir()]
    with notes("stiffdice: planning the sweeps"):
        names = with_results if options.study is None else [options.study]
        return [status.of(common.study_of(name), Path("results", name), options.cores) for name in names]


def _tell(found: list[Status], options: argparse.Namespace) -> None:
    from stiffdice.study.status import as_data, as_line, as_text

    if options.watch and sys.stdout.isatty():
        print("\x1b[H\x1b[J", end="")
    elif options.watch and not options.json:
        print()
    if options.json:
        data = [as_data(status) for status in found]
        indent = None if options.watch else 2  # a line for each look
        print(json.dumps({"studies": data} if options.study is None else data[0], indent=indent), flush=True)
    elif options.study is not None:
        output.say(as_text(found[0]))
    else:
        lines = [as_line(status) for status in found]
        output.say(lines or ["no study has results yet; `make study STUDY=quick` makes some"])
    sys.stdout.flush()


def _exit_status(found: list[Status]) -> int:
    from stiffdice.study.status import State

    states = {status.state for status in found}
    return 1 if State.FAILED in states else 0 if states == {State.DONE} else 3

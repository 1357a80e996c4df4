"""`stiffdice diff`: whether two results differ, where, and by how much."""

from __future__ import annotations

import argparse
from pathlib import Path

from stiffdice.cli import grammar
from stiffdice.cli.terminal import output

HELP = "say whether two results differ, where, and by how much"
EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-09.yaml -o listed.h5
  stiffdice run config/scenes/figure-09.yaml --preset as_written -o written.h5
  stiffdice diff listed.h5 written.h5
  make study STUDY=quick
  cp -r results/quick before
  stiffdice diff before results/quick --json

The exit status is 0 if both say the same, 1 if they differ, 2 if they cannot be compared. Logs, times, and what shows
times differ from one rebuild to the next; they are left out, unless --all is given. docs/how-to/diff.md says more.
"""


def add(diff: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    diff.add_argument("a", metavar="A", type=Path, help="a file (.h5), a folder of results, or an archive (.zip)")
    diff.add_argument("b", metavar="B", type=Path, help="another of the same kind")
    diff.add_argument("--all", action="store_true", help="compare side files, too: logs, times, reports")
    grammar.add_form(diff)


def call(options: argparse.Namespace) -> int:
    """Print what differs; 1 if anything does."""
    from stiffdice.archive.compare import compare
    from stiffdice.cli.terminal.progress import notes

    with notes("diff: comparing") as tell:
        found = compare(options.a, options.b, all_files=options.all, progress=tell.part)
    output.say(found.as_json() if options.json else found.lines())
    return 0 if found.same else 1

"""`stiffdice verify`: whether an archive is what it was when it was made."""

from __future__ import annotations

import argparse

from stiffdice import __version__
from stiffdice.cli import grammar
from stiffdice.cli.terminal import output
from stiffdice.errors import printable

HELP = "check an archive or a folder of results: digests, seals, schema, physics"
EXAMPLES = f"""\
examples:
  make archive STUDY=quick
  stiffdice verify results/archives/quick-{__version__}.crate.zip
  stiffdice verify results/quick
  stiffdice run config/scenes/figure-04.yaml -o throw.h5
  stiffdice verify throw.h5 --json

Nothing of an archive is executed. Exit status: 0 if nothing fails, 1 if something fails, 2 if it cannot be read
at all. docs/how-to/verify.md says what is checked, and how to check it without stiffdice.
"""


def add(verify: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    verify.add_argument("path", metavar="PATH", help="an archive (.zip), an unpacked one, results, or an .h5 file")
    grammar.add_form(verify)


def call(options: argparse.Namespace) -> int:
    """Print the report; 1 if anything fails."""
    from stiffdice.archive.verify import verify
    from stiffdice.cli.terminal.progress import notes

    with notes(f"verify: checking {printable(options.path)}") as tell:
        report = verify(options.path, tell.part)
    output.say(report.as_json() if options.json else report.lines())
    return 0 if report.ok else 1

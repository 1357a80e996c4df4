"""`stiffdice verify`: whether an archive is what it was when it was made."""

from __future__ import annotations

import argparse

from stiffdice import __version__
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
    verify.add_argument("path", metavar="ARCHIVE|FOLDER", help="an archive, an unpacked one, results, or an .h5 file")
    verify.add_argument("--json", action="store_true", help="the same for programs")


def call(options: argparse.Namespace) -> int:
    """Print the report; 1 if anything fails."""
    from stiffdice.archive.verify import verify
    from stiffdice.cli.terminal.progress import notes

    with notes(f"stiffdice: checking {printable(options.path)}"):
        report = verify(options.path)
    print(report.as_json() if options.json else "\n".join(report.lines()))
    return 0 if report.ok else 1

"""`stiffdice verify`: whether an archive is what it was when it was made."""

from __future__ import annotations

import argparse

from stiffdice import __version__
from stiffdice.cli import common

EXAMPLES = f"""\
examples:
  make archive STUDY=quick
  stiffdice verify results/archives/quick-{__version__}.crate.zip
  stiffdice verify results/quick
  stiffdice run config/scenes/figure-04.yaml -o throw.h5
  stiffdice verify throw.h5 --json

Nothing of an archive is executed. Exit status: 0 if nothing fails, 1 if something fails, 2 if it cannot be read
at all. docs/verify.md says what is checked, and how to check it without stiffdice.
"""


def add(commands: common.Commands) -> None:
    """Add the command to the parser."""
    verify = common.add_command(
        commands,
        "verify",
        _verify,
        "check an archive or a folder of results: digests, seals, schema, physics",
        EXAMPLES,
    )
    verify.add_argument("path", metavar="ARCHIVE|FOLDER", help="an archive, an unpacked one, results, or an .h5 file")
    common.add_json(verify)


def _verify(options: argparse.Namespace) -> int:
    from stiffdice.archive.verify import verify
    from stiffdice.cli.progress import progress

    with progress() as show:
        report = verify(options.path, show)
    print(report.as_json() if options.json else "\n".join(report.lines()))
    return 0 if report.ok else 1

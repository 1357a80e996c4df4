"""`stiffdice inspect`: what a file holds."""

from __future__ import annotations

import argparse

from stiffdice.cli import common

EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-04.yaml -o throw.h5
  stiffdice inspect throw.h5
  stiffdice inspect throw.h5 --json
  make study STUDY=quick
  stiffdice inspect results/quick/sweeps/steps-needed/sweep.h5
"""


def add(commands: common.Commands) -> None:
    """Add the command to the parser."""
    inspect = common.add_command(
        commands, "inspect", _inspect, "say what a file holds: its verdict, its scene, its variables", EXAMPLES
    )
    inspect.add_argument("file", metavar="FILE.h5")
    common.add_json(inspect)


def _inspect(options: argparse.Namespace) -> None:
    from stiffdice.io import isolation
    from stiffdice.io.reader import open_file
    from stiffdice.report import file_page

    isolation.admit(options.file)
    dataset = open_file(options.file)
    print(file_page.as_json(dataset) if options.json else file_page.as_text(dataset, options.file))

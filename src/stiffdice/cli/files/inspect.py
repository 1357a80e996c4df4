"""`stiffdice inspect`: what a file holds."""

from __future__ import annotations

import argparse

from stiffdice.cli import grammar
from stiffdice.cli.terminal import output

HELP = "say what a file holds: its verdict, its scene, its variables"
EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-04.yaml -o throw.h5
  stiffdice inspect throw.h5
  stiffdice inspect throw.h5 --json
  make study STUDY=quick
  stiffdice inspect results/quick/sweeps/steps-needed/sweep.h5
"""


def add(inspect: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    inspect.add_argument("file", metavar="FILE.h5", help="a file of stiffdice")
    grammar.add_form(inspect)


def call(options: argparse.Namespace) -> None:
    """Print what the file holds."""
    from concurrent.futures import ThreadPoolExecutor

    from stiffdice.io import isolation

    with ThreadPoolExecutor(1) as another:
        admitted = another.submit(isolation.admit, options.file)
        from stiffdice.io.reader import plain_file  # in the meantime
        from stiffdice.report import file_page

        admitted.result()
    dataset = plain_file(options.file)
    output.say(file_page.as_json(dataset) if options.json else file_page.as_text(dataset, options.file))

"""`stiffdice infer`: what counts of faces say of a die."""

from __future__ import annotations

import argparse
from pathlib import Path

from stiffdice.cli import grammar
from stiffdice.cli.terminal import output
from stiffdice.errors import InputError

HELP = "say what shape and centre of mass a die has, from how often its faces came up"
EXAMPLES = """\
examples:
  stiffdice infer config/measurements/labby-2009.yaml
  stiffdice infer config/measurements/labby-2009.yaml --throw rolled
  stiffdice infer config/measurements/wolf-white.yaml --json

The file has `counts: [n1, n2, n3, n4, n5, n6]`, how often the faces 1 to 6 came up, and may have `source` and `note`.
Opposite faces sum to seven. What shape and load do to the faces is known from simulated throws: the numbers are in
config/dice/response.yaml, with their errors, by ground and by way of throwing; the answer takes all as equally likely.
`make shapes` computes them anew; --response takes files of yours (docs/how-to/dice-rolls.md).
Exit status: 0; 2 for bad input.
"""

# Where the numbers are, in the project's folder.
RESPONSE = "config/dice/response.yaml"


def add(infer: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    infer.add_argument("counts", metavar="COUNTS.yaml", help="how often each face came up")
    told = f"of the experiment face-response; may be given more than once (default: {RESPONSE})"
    infer.add_argument("--response", metavar="FILE.h5", action="append", default=[], help=told)
    told = "of a die of which is known how it was thrown: dropped, tossed or rolled (default: all are possible)"
    infer.add_argument("--throw", metavar="THROW", help=told)
    grammar.add_form(infer)


def call(options: argparse.Namespace) -> int:
    """Print what the counts say."""
    from stiffdice.experiments.dice import infer, response_table, rolls
    from stiffdice.report import inference_page
    from stiffdice.scene import validation

    given = rolls.load(options.counts)
    if options.response:
        tables, origin = response_table.measured(options.response), ", ".join(options.response)
    elif not Path(RESPONSE).is_file():
        raise InputError(f"{RESPONSE}: No such file; call this in the project's folder, or with --response FILE.h5")
    else:
        tables, origin = response_table.load(RESPONSE), f"{RESPONSE} (make shapes)"
    if options.throw is not None:
        validation.choice("--throw", options.throw, [table.throw for table in tables])
        tables = [table for table in tables if table.throw == options.throw]
    found = infer.posterior(given, tables)
    page = inference_page.as_json if options.json else inference_page.as_text
    output.say(page(given, found, tables, origin))
    return 0

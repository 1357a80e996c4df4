"""`stiffdice check`: what the contacts of a MuJoCo model do at its time step."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output

HELP = "say what a MuJoCo model's contacts do at its time step, and what to change"
EXAMPLES = """\
examples:
  stiffdice check config/models/ball.xml
  stiffdice check config/models/ball.xml --json
  stiffdice check config/models/ball.xml --figure ball.png
  stiffdice check config/models/ball.xml --patch

Every free body lands on the floor, and on other bodies that the model lets it touch, in MuJoCo, by the model's own
options, at the speed of a drop from its own size. Beside it stands what its solref, solimp and inertia predict. MuJoCo
is of `make install-engines`. docs/how-to/check.md says what the numbers and the verdicts mean. Exit status: 0 if
nothing is wrong, 1 for a verdict, 2 for what cannot be checked.
"""


def add(check: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    check.add_argument("model", metavar="MODEL.xml", type=Path, help="a model in MuJoCo's MJCF")
    told = "draw restitution and energy against the time step, too: .png or .svg"
    check.add_argument("--figure", metavar="FILE.png", help=told)
    grammar.add(check, "--force")
    form = check.add_mutually_exclusive_group()
    form.add_argument("--patch", action="store_true", help="print what to change, and nothing else: for patch -p0")
    grammar.add(form, "--json")
    grammar.add_form(check, json=False)


def call(options: argparse.Namespace) -> int:
    """Print what was found; 1 if anything is wrong."""
    figure = None
    if options.figure is not None:
        figure = common.picture_target("--figure", options.figure, [".png", ".svg"], options.force, options.model)
    # These take a while to import.
    from stiffdice.advice import model_check
    from stiffdice.cli.terminal.progress import notes
    from stiffdice.report import model_page

    advice = None
    with notes("check:") as tell:
        found = model_check.check(options.model, tell)
        if not found.passed:
            from stiffdice.advice import model_patch

            advice = model_patch.advised(found, tell)
    if figure is not None:
        from stiffdice.report.figures.contacts import model_check as drawing
        from stiffdice.report.figures.registry import store

        store(partial(drawing.draw, found), {}, f"Landings of {found.model.path.name}", 150, [str(figure)])
    if options.patch:
        print((advice and advice.patch) or "", end="")
    else:
        output.say(model_page.as_json(found, advice) if options.json else model_page.as_text(found, advice))
    return 0 if found.passed else 1

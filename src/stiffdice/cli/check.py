"""`stiffdice check`: what the contacts of a MuJoCo model do at its time step."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from stiffdice.cli import common

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
    form = check.add_mutually_exclusive_group()
    form.add_argument("--json", action="store_true", help="the same for programs")
    form.add_argument("--patch", action="store_true", help="print what to change, and nothing else: for patch -p0")
    told = "draw restitution and energy against the time step: .png or .svg"
    check.add_argument("--figure", metavar="FILE.png", help=told)
    check.add_argument("--force", action="store_true", help="replace a file that is there")


def call(options: argparse.Namespace) -> int:
    """Print what was found; 1 if anything is wrong."""
    figure = None
    if options.figure is not None:
        figure = _figure(options.figure, options.force, str(options.model))
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
        print(model_page.as_json(found, advice) if options.json else model_page.as_text(found, advice))
    return 0 if found.passed else 1


def _figure(text: str, force: bool, model: str) -> Path:
    """Return the file to draw into; raises InputError for another ending, and for what is there already."""
    from stiffdice.errors import InputError

    if Path(text).suffix not in (".png", ".svg"):
        raise InputError(f"--figure = {text}: allowed are files that end in .png or .svg")
    return common.target_of(text, force, lambda _: False, *([model] if Path(model).is_file() else []))

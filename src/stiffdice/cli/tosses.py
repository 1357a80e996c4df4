"""`stiffdice tosses`."""

from __future__ import annotations

import argparse
from pathlib import Path

from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output
from stiffdice.errors import InputError, printable
from stiffdice.scene import validation

HELP = "replay measured tosses of a real cube: restitution and friction, and how right the simulation is"
EXAMPLES = """\
examples:
  stiffdice tosses config/measurements/tosses.h5
  stiffdice tosses config/measurements/tosses.h5 --animate toss.gif --toss 12
  stiffdice tosses config/measurements/tosses.h5 --contact-time '2 ms' --json

Restitution and friction are fitted on a random third of the tosses, and told on the others; it takes about ten
seconds. config/measurements/README.md says what a file of tosses holds. Exit status: 0, or 2 for bad input.
"""

GRAVITY = "9.80"


def add(tosses: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    tosses.add_argument("data", metavar="FILE.h5", help="measured tosses, netCDF-4")
    grammar.add(tosses, "--contact-time", " (default: 5 ms)", default="5 ms")
    grammar.add(tosses, "--gravity", f", where the tosses were made (default: {GRAVITY})", default=GRAVITY)
    grammar.add(tosses, "--seed", ": of the third that is fitted (default: 18)", default="18")
    grammar.add(tosses, "--animate", ": one toss beside its simulation")
    tosses.add_argument("--toss", metavar="N", help="with --animate: the number of the toss, from 1 on (default: 1)")
    grammar.add(tosses, "--force")
    grammar.add_form(tosses)


def call(options: argparse.Namespace) -> int:
    """Print what the tosses say."""
    contact_time = common.number("--contact-time", options.contact_time, "s", above=0)
    gravity = common.number("--gravity", options.gravity, "m/s²", above=0)
    seed = common.whole("--seed", options.seed)
    target = None
    if options.animate is not None:
        target = common.picture_target("--animate", options.animate, [".gif"], options.force, options.data)
    elif options.toss is not None:
        raise InputError("--toss: says which toss to draw, with --animate only")

    # These take about a second to import; bad input is told before.
    from stiffdice.cli.terminal.progress import notes, trials
    from stiffdice.scene import tosses as files
    from stiffdice.scene.scene import Ground, Scene

    if Path(options.data).is_dir():
        raise InputError(f"{options.data}: Is a directory")
    stored = files.admitted(options.data)
    number = 1 if options.toss is None else common.whole("--toss", options.toss)
    validation.count("--toss", number, at_most=len(stored.counts))
    scene = Scene(ground=Ground(contact="gated"), gravity=gravity)

    from stiffdice.experiments.tosses import single
    from stiffdice.experiments.tosses.summary import summary_of
    from stiffdice.report import toss_page

    try:
        with trials("tosses: trying") as tell:
            found = summary_of(stored, scene, contact_time, seed, tell)
    except InputError as error:
        raise error.within(options.data) from None
    output.say(
        toss_page.as_json(options.data, found) if options.json else toss_page.as_text(printable(options.data), found)
    )
    if target is not None:
        from stiffdice.report.figures import registry

        data = {"toss": single.dataset(found.tosses, scene, found.physics, number - 1)}
        with notes("tosses: drawing"):
            registry.draw("toss-animation", data, f"Toss {number} beside its simulation", 80, [str(target)])
    return 0

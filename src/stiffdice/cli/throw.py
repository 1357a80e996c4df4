"""`stiffdice throw`: a die, its face, and how often each face is up."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output
from stiffdice.errors import InputError

if TYPE_CHECKING:
    from stiffdice.experiments.dice.throws import Thrown

_DPI = 120
# Shown of a throw after it is decided [s].
_AFTER = 0.3

HELP = "throw a die: which face is up, and how often each is in many throws"
EXAMPLES = """\
examples:
  stiffdice throw
  stiffdice throw --count 100000
  stiffdice throw --seed 7 --animate throw.gif
  stiffdice throw config/scenes/die.yaml --set cube.load='{at: corner, mass: 1 g}' --count 20000
  stiffdice throw config/scenes/die.yaml --set cube.sides='[16, 16, 20] mm' --count 20000

Without a scene it is a 16 mm die over a table. Pips: 1 up, 2 to the front, 3 to the left of an upright die; opposite
faces sum to seven. Every throw of a seed is the same again. Exit status: 0 when thrown, 2 for bad input.
"""


def add(command: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    grammar.add_scene(command, " (default: a 16 mm die)")
    command.add_argument("--count", default="1", metavar="N", help="number of throws (default: 1)")
    grammar.add(command, "--seed", ": of the launches (default: 0)", default="0")
    told = "uniform: over all rotations; as_launched: the scene's (default: uniform)"
    command.add_argument("--orientation", default="uniform", metavar="ORIENTATION", help=told)
    told = "standard deviation of each component of the velocity [m/s] (default: 0.3)"
    command.add_argument("--velocity-spread", default="0.3", metavar="X", help=told)
    told = "of the angular velocity [rad/s] (default: 30); `scene` draws the angular momentum as the scene says"
    command.add_argument("--spin-spread", default="30", metavar="X", help=told)
    grammar.add(command, "--scheme", " (default: symplectic_euler)", default="symplectic_euler")
    grammar.add(command, "--steps", " to the scene's duration (default: such that ω h is 0.3)")
    grammar.add(command, "--animate", ": one throw")
    grammar.add_changes(command)
    grammar.add(command, "--force")
    grammar.add_form(command)


def call(options: argparse.Namespace) -> None:
    """Throw, and print the face, or how often each was up."""
    from stiffdice.scene import die
    from stiffdice.scene import scene as scenes
    from stiffdice.simulation.launch_distribution import LaunchDistribution

    if options.scene is None:
        scene = scenes.changed(die.SCENE, options.overrides, options.preset)
    else:
        scene = scenes.load(options.scene, options.overrides, options.preset)
    count = common.whole("--count", options.count)
    spread = None if options.spin_spread == "scene" else common.number("--spin-spread", options.spin_spread, "rad/s")
    launches = LaunchDistribution(
        orientation=options.orientation,
        velocity_spread=common.number("--velocity-spread", options.velocity_spread, "m/s"),
        spin_spread=spread,
        seed=common.whole("--seed", options.seed, at_least=0),
    )
    target = None
    if options.animate is not None:
        if count != 1:
            raise InputError(f"--animate = {options.animate}: allowed is with one throw, without --count")
        sources = [] if options.scene is None else [options.scene]
        target = common.picture_target("--animate", options.animate, [".gif"], options.force, *sources)

    from stiffdice.cli.terminal.progress import notes, progress, trials
    from stiffdice.experiments.dice import throws
    from stiffdice.simulation.progress import told_to

    steps = throws.default_steps(scene) if options.steps is None else common.whole("--steps", options.steps)
    if count == 1:
        with trials("throw: throwing"):
            thrown = throws.one(scene, launches, options.scheme, steps)
        _show(options, throws.told_of_one(thrown), thrown.as_mapping())
        if target is not None:
            with notes("throw: drawing"):
                _animate(thrown, target)
        return
    with progress("") as show, told_to(show):
        many = throws.many(scene, launches, options.scheme, steps, count)
    _show(options, throws.told_of_many(many), many.as_mapping())


def _show(options: argparse.Namespace, lines: list[str], mapping: dict[str, Any]) -> None:
    if options.json:
        output.say_json(mapping)
    else:
        output.say(lines)


def _animate(thrown: Thrown, target: Path) -> None:
    """Draw a throw as it goes, until it is decided and a little longer."""
    from stiffdice.report.figures import registry, runs
    from stiffdice.simulation.dataset import run_dataset

    shown = run_dataset(thrown.run)
    if thrown.time is not None:
        shown = shown.sel(time=slice(0, thrown.time + _AFTER))
    registry.store(runs.die_animation, {"throw": shown}, f"A die thrown: {thrown.face} is up", _DPI, [str(target)])

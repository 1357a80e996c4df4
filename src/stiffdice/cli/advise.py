"""`stiffdice advise`: how to run a scene to an error."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output
from stiffdice.errors import InputError
from stiffdice.scene import validation

if TYPE_CHECKING:
    from stiffdice.scene.scene import Scene

HELP = "say how to run a scene to an error you choose: model, scheme, steps, time"
EXAMPLES = """\
examples:
  stiffdice advise config/scenes/figure-04.yaml --error 1%
  stiffdice advise --stiffness 1e6 --mass '20 g' --contact gated --error 1e-6
  stiffdice advise --side '16 mm' --mass '5 g' --restitution 0.5 --position '0,0,30 cm' --velocity 1,0,0 --error 0.1%
  stiffdice advise config/scenes/figure-09.yaml --error 1% --horizon 2 --run -o advised.h5
  stiffdice advise config/scenes/figure-09.yaml --scheme symplectic_euler --json
  stiffdice advise config/scenes/die.yaml --for landing --error 0.003

The error is the root mean square distance of the cube's centre from the exact path until the end (or the horizon), in
radii of the cube: 1% of a 1 m cube is 1 cm. A path that is chaotic may be known for a part of the duration only; the
advice is then for that part (docs/how-to/advice.md). It takes about ten seconds; the first on a machine compiles, which
may take a minute. With --for landing the error is that of the faces' distribution, as total variation, and the advice
is for `stiffdice throw` (docs/explanation/dice.md). Where there is no SCENE.yaml, keys not given have the paper's
values. Exit status: 0 for an advice, with --run for a promise kept; 1 if nothing keeps the error or the promise is
broken; 2 for bad input.
"""

# Keys of the scene that `advise` has an option for, and what they are, unless other commands have that option, too.
_KEYS = {
    "stiffness": ("ground.stiffness", ""),
    "contact_time": ("ground.contact_time", ", with --restitution, in place of a stiffness"),
    "damping": ("ground.damping", ""),
    "restitution": ("ground.restitution", ", in place of a damping"),
    "friction": ("ground.friction", "coefficient of friction"),
    "contact": ("ground.contact", ""),
    "mass": ("cube.mass", ""),
    "radius": ("cube.radius", "of the cube, centre to corner [m]"),
    "side": ("cube.side", ", in place of its radius"),
    "position": ("launch.position", "where the centre starts, as 0,0,3 [m]"),
    "velocity": ("launch.velocity", "of the launch, as 5,0,5 [m/s]"),
    "spin": ("launch.angular_momentum", "angular momentum of the launch, as 0.1,0,0 [kg m²/s]"),
    "duration": ("duration", "of the run [s]"),
}
PURPOSES = ("path", "landing")
_VECTORS = ("position", "velocity", "spin")
_EITHER = (("stiffness", "contact_time"), ("damping", "restitution"), ("radius", "side"))


def add(advise: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    grammar.add_scene(advise, " (default: the options below)")
    grammar.add(advise, "--output", ", an .h5 file; with --run")
    told = "as 1%%, 0.01 or 1e-6 of the radius, or '1 mm' (default: 1%%)"
    advise.add_argument("--error", default="1%", metavar="X", help=told)
    told = "path, or landing: the faces of a die (default: path)"
    advise.add_argument("--for", dest="purpose", default="path", metavar="PURPOSE", help=told)
    advise.add_argument("--horizon", metavar="X", help="until when to keep it [s] (default: the duration)")
    grammar.add(advise, "--scheme", ": advice for this one alone (default: all are compared)")
    told = "do it, and check the promise against a run of twice the cost and another method"
    advise.add_argument("--run", action="store_true", help=told)
    grammar.add_changes(advise)
    grammar.add(advise, "--force")
    grammar.add_form(advise)
    scene = advise.add_argument_group("the scene in numbers, in place of a file or on top of it")
    either = {name: group for names in _EITHER for group in [scene.add_mutually_exclusive_group()] for name in names}
    for name, (_, text) in _KEYS.items():
        option, group = f"--{name.replace('_', '-')}", either.get(name, scene)
        if option in grammar.OPTIONS:
            grammar.add(group, option, text)
        else:
            group.add_argument(option, metavar="X,Y,Z" if name in _VECTORS else "X", help=text)


def _in_radii(text: str, scene: Scene) -> str:
    """Return an error as a part of the radius if it is given as a length, any other as it is."""
    from stiffdice.scene import units

    if comma := units.decimal_comma(text):
        raise InputError(f"--error = {text}: {comma}")
    try:
        return repr(units.in_si(text, "m") / scene.cube.radius)
    except ValueError:
        return text


def _for_landing(options: argparse.Namespace, scene: Scene) -> int:
    """Print how many steps the faces of a die need."""
    given = {"--horizon": options.horizon, "--scheme": options.scheme, "-o": options.output}
    if others := [name for name, value in given.items() if value is not None] + ["--run"] * options.run:
        raise InputError(f"{others[0]}: is of a path; with --for landing allowed are --error and --json")
    from stiffdice.advice import landing, recommend

    found = landing.advise(scene, recommend.parsed_error(options.error))
    print(found.as_json() if options.json else "\n".join([*scene.derived, *found.lines(scene.duration)]))
    return 0


def call(options: argparse.Namespace) -> int:
    """Print the advice; 1 if there is none, or its promise is not kept."""
    from stiffdice.io import seal
    from stiffdice.scene import scene as scenes

    asked = ((key, getattr(options, name), name in _VECTORS) for name, (key, _) in _KEYS.items())
    changes = [f"{key}=[{text}]" if vector else f"{key}={text}" for key, text, vector in asked if text is not None]
    changes += options.overrides
    file, preset = options.scene, options.preset
    scene = scenes.load(file, changes, preset) if file is not None else scenes.changed({}, changes, preset)
    if validation.choice("--for", options.purpose, PURPOSES) == "landing":
        return _for_landing(options, scene)
    horizon = None if options.horizon is None else common.number("--horizon", options.horizon, "s")
    target = None
    if options.output is not None:
        if not options.run:
            raise InputError("-o: a file is written with --run only")
        target = common.target_of(options.output, options.force, seal.is_sealed, *filter(None, [file]))

    # These take about a second to import; bad input is told before.
    from stiffdice.advice import recommend
    from stiffdice.advice.result import check as checked
    from stiffdice.advice.result import run_advised
    from stiffdice.cli.terminal.progress import progress, trials
    from stiffdice.report import advice_page
    from stiffdice.simulation.outcome import Verdict

    error = recommend.parsed_error(_in_radii(options.error, scene))
    with trials("advise: trying") as tell:
        given = recommend.advise(scene, error, horizon=horizon, scheme=options.scheme, tell=tell)
    check = None
    if options.run and given.best is not None:
        with progress() as show:
            run = run_advised(given, given.best, show)
        with progress() as show:
            check = checked(given, run, show)
        if target is not None:
            from stiffdice.io.writer import write_dataset
            from stiffdice.simulation.dataset import plain_run_dataset

            write_dataset(plain_run_dataset(run), target)
    if options.json:
        print(advice_page.as_json(given, check))
    else:
        output.say([*scene.derived, advice_page.as_text(given, common.scene_words(options, changes) if file else [])])
        if check is not None:
            output.say(["", advice_page.check_as_text(check)])
            if target is not None:
                verdict = Verdict(run.verdict[0])
                output.say_verdict([f"{target}: {verdict.sentence}"], str(target), verdict)
    return 0 if given.best is not None and (check is None or check.kept) else 1

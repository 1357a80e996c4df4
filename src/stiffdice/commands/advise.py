"""`stiffdice advise`: how to run a scene to an error."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from stiffdice.commands import changes, numbers
from stiffdice.errors import InputError

EXAMPLES = """\
examples:
  stiffdice advise config/scenes/figure-04.yaml --error 1%
  stiffdice advise --stiffness 1e6 --mass 0.02 --contact gated --error 1e-6
  stiffdice advise my-cube.yaml --error 1% --horizon 2 --run -o out.h5
  stiffdice advise my-cube.yaml --scheme symplectic_euler --json

The error is the root mean square distance of the cube's centre from the exact path, over evenly spread times from the
launch to the end (or the horizon), in radii of the cube: 1% of a 1 m cube is 1 cm. A tumbling cube is chaotic, and a
path may be known for a part of the duration only; the advice is then for that part, and says so. A pilot run ends after
3,000,000 force evaluations: all of it takes about ten seconds, and more where something has to be compiled.
Where there is no SCENE.yaml, keys not given have the paper's values. The first advice on a machine compiles, which may
take a minute. Exit status: 0 for an advice, with --run for a promise kept; 1 if nothing keeps the error, with --run if
the promise is found broken; 2 for bad input.
"""

# Keys of the scene that `advise` has an option for, and what they are.
_KEYS = {
    "stiffness": ("ground.stiffness", "of the ground, per node [kg/s²]"),
    "damping": ("ground.damping", "of the ground, per node [kg/s]"),
    "friction": ("ground.friction", "coefficient of friction"),
    "contact": ("ground.contact", "ungated or gated"),
    "mass": ("cube.mass", "of the cube [kg]"),
    "radius": ("cube.radius", "of the cube, centre to corner [m]"),
    "position": ("launch.position", "where the centre starts, as 0,0,3 [m]"),
    "velocity": ("launch.velocity", "of the launch, as 5,0,5 [m/s]"),
    "spin": ("launch.angular_momentum", "angular momentum of the launch, as 0.1,0,0 [kg m²/s]"),
    "duration": ("duration", "of the run [s]"),
}
_VECTORS = ("position", "velocity", "spin")


def add(commands: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the command to the parser."""
    advise = commands.add_parser(
        "advise",
        help="say how to run a scene to an error you choose: model, scheme, steps, time",
        description="Say how to run a scene to an error: model, scheme, steps or tolerance, what they cost, and why.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    advise.add_argument(
        "scene", metavar="SCENE.yaml", nargs="?", help="the physical problem; without it, the options below"
    )
    advise.add_argument("--error", default="1%", metavar="X", help="as 1%%, 0.01 or 1e-6 of the radius (default: 1%%)")
    advise.add_argument("--horizon", metavar="T", help="until when to keep it [s] (default: the duration)")
    advise.add_argument("--scheme", metavar="NAME", help="advice for this scheme alone (default: all are compared)")
    advise.add_argument(
        "--run",
        action="store_true",
        help="do it, and check the promise against a run of twice the cost and another method",
    )
    advise.add_argument("-o", "--output", metavar="OUT.h5", help="with --run: the file to write")
    advise.add_argument("--json", action="store_true", help="the same for programs")
    changes.add(advise)
    numbers = advise.add_argument_group("the scene in numbers, in place of a file or on top of it")
    for name, (_, text) in _KEYS.items():
        metavar = "X,Y,Z" if name in _VECTORS else "LAW" if name == "contact" else "X"
        numbers.add_argument(f"--{name}", metavar=metavar, help=text)
    advise.set_defaults(call=_advise)


def _given(options: argparse.Namespace) -> list[str]:
    """Return the changes to a scene that the options of `advise` ask for, as `key.path=value`."""
    given = []
    for name, (key, _) in _KEYS.items():
        text = getattr(options, name)
        if text is not None:
            given.append(f"{key}=[{text}]" if name in _VECTORS else f"{key}={text}")
    return given + options.overrides


def _named(options: argparse.Namespace, changes: Sequence[str]) -> list[str]:
    """Return the arguments of `run` that name the scene of `advise`; none without a file, which `run` needs."""
    if options.scene is None:
        return []
    preset = [] if options.preset is None else ["--preset", options.preset]
    return [options.scene, *preset, *(word for change in changes for word in ("--set", change))]


def _advise(options: argparse.Namespace) -> int:
    from stiffdice import scene as scenes
    from stiffdice.io.write import check_target

    changes = _given(options)
    if options.scene is None:
        scene = scenes.changed({}, changes, options.preset)
    else:
        scene = scenes.load(options.scene, changes, options.preset)
    horizon = None if options.horizon is None else numbers.number("--horizon", options.horizon)
    if options.output is not None and not options.run:
        raise InputError("-o: a file is written with --run only")
    target = None if options.output is None else check_target(options.output)
    if target is not None and options.scene is not None and target.exists() and target.samefile(options.scene):
        raise InputError(f"{target}: is the scene itself; name another file for the output")

    # These take about a second to import; bad input is told before.
    from stiffdice import advice, advice_text
    from stiffdice.progress import Notes, Progress
    from stiffdice.verdict import Verdict

    error = advice.parsed_error(options.error)
    with Notes("advise: trying") as notes:
        given = advice.advise(scene, error, horizon=horizon, scheme=options.scheme, tell=notes.show)
    check = None
    if options.run and given.best is not None:
        with Progress() as progress:
            run = advice.run_advised(given, given.best, progress.show)
        with Progress() as progress:
            check = advice.check(given, run, progress.show)
        if target is not None:
            from stiffdice.io.layout import run_dataset
            from stiffdice.io.write import write_dataset

            write_dataset(run_dataset(run), target)
    if options.json:
        print(advice_text.as_json(given, check))
    else:
        print(advice_text.as_text(given, _named(options, changes)))
        if check is not None:
            print("\n" + advice_text.check_as_text(check))
            if target is not None:
                print(f"{target}: {Verdict(run.verdict[0]).sentence}")
    return 0 if given.best is not None and (check is None or check.kept) else 1

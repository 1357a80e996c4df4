"""The command `stiffdice`. Imports what a subcommand needs only when it is called, so that --help is quick."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

from stiffdice import __version__
from stiffdice.bench import BENCHMARKS
from stiffdice.errors import InputError, StiffdiceError

EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-09.yaml --model sliding -o stiff.h5
  stiffdice run my-cube.yaml --steps 1e5 --set ground.stiffness=1e6 --set cube.mass=0.02 -o out.h5
  stiffdice run my-cube.yaml --model auto -o out.h5
  stiffdice advise my-cube.yaml --error 1%
  stiffdice inspect stiff.h5
  stiffdice bench
"""
RUN_EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-04.yaml --steps 100000 -o throw.h5
  stiffdice run config/scenes/figure-09.yaml --model sliding --preset as_written -o stiff.h5
  stiffdice run my-cube.yaml --set launch.angular_momentum='{seed: 7}' --every 100 -o out.h5
  stiffdice run my-cube.yaml --simulator mujoco --preset as_written --steps 20000 -o theirs.h5

The file is netCDF-4 on HDF5: xarray.open_dataset("throw.h5") opens it. Exit status: 0 when the run is done, whatever
its verdict; 2 for bad input.
"""
ADVISE_EXAMPLES = """\
examples:
  stiffdice advise config/scenes/figure-04.yaml --error 1%
  stiffdice advise --stiffness 1e6 --mass 0.02 --contact gated --error 1e-6
  stiffdice advise my-cube.yaml --error 1% --horizon 2 --run -o out.h5
  stiffdice advise my-cube.yaml --scheme symplectic_euler --json

The error is the root mean square distance of the cube's centre from the exact path, over evenly spread times from the
launch to the end (or the horizon), in radii of the cube: 1% of a 1 m cube is 1 cm. A tumbling cube is chaotic, and a
path may be known for a part of the duration only; the advice is then for that part, and says so.
Where there is no SCENE.yaml, keys not given have the paper's values. The first advice on a machine compiles, which may
take a minute. Exit status: 0 for an advice, with --run for a promise kept; 1 if nothing keeps the error, with --run if
the promise is found broken; 2 for bad input.
"""
INSPECT_EXAMPLES = """\
examples:
  stiffdice inspect throw.h5
  stiffdice inspect results/paper/sweep/sweep.h5
  stiffdice inspect throw.h5 --json
"""
BENCH_EXAMPLES = """\
examples:
  stiffdice bench
  stiffdice bench listing engines
  stiffdice bench --against another-machine.h5

Times are medians of rounds in which everything takes turns; let nothing else run meanwhile. Stored are an HDF5 file
with every sample, a page and a table, named by the time; what changed since the last one there is told, row by row,
with what of it may be noise.
"""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="stiffdice",
        description="How many time steps does a stiff ground cost, and what do you get for them?",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"stiffdice {__version__}")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    _add_run(commands)
    _add_advise(commands)
    _add_inspect(commands)
    _add_bench(commands)
    return parser


def _add_run(commands: argparse._SubParsersAction[_Parser]) -> None:
    run = commands.add_parser(
        "run",
        help="run one scene and store its trajectory and verdict",
        description="Run one scene and store its trajectory and verdict in one HDF5 file.",
        epilog=RUN_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    run.add_argument("scene", metavar="SCENE.yaml", help="the physical problem; config/README.md lists its keys")
    run.add_argument("-o", "--output", metavar="OUT.h5", required=True, help="the file to write")
    run.add_argument(
        "--model",
        default="tumbling",
        metavar="M",
        help="vertical, sliding, tumbling, flying, or auto: the least that is exact for the scene (default: tumbling)",
    )
    run.add_argument(
        "--simulator",
        default="stiffdice",
        metavar="NAME",
        help="stiffdice, or another engine where it is installed: mujoco, pybullet, drake, scipy, octave, numpy "
        "(default: stiffdice)",
    )
    run.add_argument(
        "--scheme",
        metavar="NAME",
        help="symplectic_euler, forward_euler, velocity_verlet, rk4, implicit_euler, event, "
        "or exact where that is known (default: symplectic_euler; another engine has its own)",
    )
    run.add_argument("--steps", default="10000", metavar="N", help="number of time steps (default: 10000)")
    run.add_argument(
        "--tolerance",
        metavar="X",
        help="of the error, for a scheme that controls its own (default: 1e-9 of the motion)",
    )
    run.add_argument(
        "--every",
        metavar="K",
        help="keep every K-th step (default: the least K that keeps at most 10,000 of them)",
    )
    run.add_argument(
        "--ledger",
        action="store_true",
        help="book where the energy goes, for every bounce and for the run (takes some times as long)",
    )
    _add_changes(run)
    run.set_defaults(call=_run)


def _add_changes(command: argparse.ArgumentParser) -> None:
    command.add_argument("--preset", metavar="P", help="as_listed, as_written or corrected: defaults of the physics")
    command.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY.PATH=VALUE",
        help="set one key of the scene; may be given more than once",
    )


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


def _add_advise(commands: argparse._SubParsersAction[_Parser]) -> None:
    advise = commands.add_parser(
        "advise",
        help="say how to run a scene to an error you choose: model, scheme, steps, time",
        description="Say how to run a scene to an error: model, scheme, steps or tolerance, what they cost, and why.",
        epilog=ADVISE_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    advise.add_argument(
        "scene", metavar="SCENE.yaml", nargs="?", help="the physical problem; without it, the options below"
    )
    advise.add_argument("--error", default="1%", metavar="X", help="as 1%%, 0.01 or 1e-6 of the radius (default: 1%%)")
    advise.add_argument("--horizon", metavar="T", help="until when to keep it [s] (default: the duration)")
    advise.add_argument("--scheme", metavar="NAME", help="advice for this scheme alone (default: all are compared)")
    advise.add_argument(
        "--run", action="store_true", help="do it, and check the promise against a run of twice the cost"
    )
    advise.add_argument("-o", "--output", metavar="OUT.h5", help="with --run: the file to write")
    advise.add_argument("--json", action="store_true", help="the same for programs")
    _add_changes(advise)
    numbers = advise.add_argument_group("the scene in numbers, in place of a file or on top of it")
    for name, (_, text) in _KEYS.items():
        metavar = "X,Y,Z" if name in _VECTORS else "LAW" if name == "contact" else "X"
        numbers.add_argument(f"--{name}", metavar=metavar, help=text)
    advise.set_defaults(call=_advise)


def _add_inspect(commands: argparse._SubParsersAction[_Parser]) -> None:
    inspect = commands.add_parser(
        "inspect",
        help="say what a file holds: its verdict, its scene, its variables",
        description="Say what a file of stiffdice holds: its verdict, its scene, its variables.",
        epilog=INSPECT_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    inspect.add_argument("file", metavar="FILE.h5")
    inspect.add_argument("--json", action="store_true", help="the same for programs")
    inspect.set_defaults(call=_inspect)


def _add_bench(commands: argparse._SubParsersAction[_Parser]) -> None:
    bench = commands.add_parser(
        "bench",
        help="measure how fast it is, and compare with the last time",
        description="Measure kernels, skipping, cold start, jobs and engines; store, and compare with the last time.",
        epilog=BENCH_EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    bench.add_argument("names", metavar="NAME", nargs="*", help=f"{', '.join(BENCHMARKS)} (default: all)")
    bench.add_argument("--folder", default="results/bench", metavar="DIR", help="where (default: results/bench)")
    bench.add_argument("--against", metavar="FILE.h5", help="compare with this one (default: the last in the folder)")
    bench.add_argument("--quick", action="store_true", help="too short to tell times by; shows that all of it works")
    bench.set_defaults(call=_bench)


def _whole(option: str, text: str) -> int:
    """Return the whole number in an option's text; 1e5 counts as one."""
    from stiffdice import checks

    try:
        return checks.count(option, int(text))
    except ValueError:
        pass
    try:
        return checks.count(option, float(text))
    except ValueError:
        raise InputError(f"{option} = {text}: allowed is a whole number from 1 to {checks.LARGEST_COUNT}") from None


def _number(option: str, text: str) -> float:
    """Return the number in an option's text."""
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{option} = {text}: allowed is a number") from None


def _run(options: argparse.Namespace) -> None:
    from stiffdice import checks
    from stiffdice import scene as scenes
    from stiffdice.io.write import check_target

    scene = scenes.load(options.scene, options.overrides, options.preset)
    steps = _whole("--steps", options.steps)
    target = check_target(options.output)
    if target.exists() and target.samefile(options.scene):
        raise InputError(f"{target}: is the scene itself; name another file for the output")

    # These take about a second to import; bad input is told before.
    from stiffdice import ledger, schemes, simulators
    from stiffdice.io.layout import run_dataset
    from stiffdice.io.write import write_dataset
    from stiffdice.progress import Progress
    from stiffdice.requirement import AUTO
    from stiffdice.simulate import default_every, simulate
    from stiffdice.verdict import Verdict

    scheme = simulators.scheme_of(options.simulator, options.scheme)
    if options.ledger:
        checks.choice("--ledger: simulator", options.simulator, [simulators.OURS])
        checks.choice("--ledger: scheme", scheme, ledger.BOOKED)
    every = default_every(steps) if options.every is None else _whole("--every", options.every)
    tolerance = schemes.TOLERANCE if options.tolerance is None else _number("--tolerance", options.tolerance)
    with Progress() as progress:
        run = simulate(
            scene,
            model=options.model,
            simulator=options.simulator,
            scheme=scheme,
            steps=steps,
            tolerance=tolerance,
            every=every,
            progress=progress.show,
        )
    dataset = run_dataset(run)
    if options.ledger:
        books = ledger.keep(scene, model=run.model, scheme=scheme, steps=steps)
        dataset = dataset.assign(ledger.variables(books))
    write_dataset(dataset, target)
    if options.model == AUTO:
        print(run.model_reason)
    print(f"{target}: {Verdict(run.verdict[0]).sentence}")


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
    horizon = None if options.horizon is None else _number("--horizon", options.horizon)
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


def _inspect(options: argparse.Namespace) -> None:
    from stiffdice import inspection
    from stiffdice.io.read import open_file

    dataset = open_file(options.file)
    print(inspection.as_json(dataset) if options.json else inspection.as_text(dataset, options.file))


def _bench(options: argparse.Namespace) -> None:
    from stiffdice import checks

    for name in options.names:
        checks.choice("NAME", name, BENCHMARKS)

    # These take about a second to import; bad input is told before.
    from stiffdice.bench.run import bench
    from stiffdice.progress import Notes

    against = None if options.against is None else Path(options.against)
    with Notes("bench:") as notes:
        stored = bench(Path(options.folder), names=options.names, quick=options.quick, against=against, tell=notes.show)
    print(stored.page)
    print(f"{stored.path}: stored, with the same as .md and .csv")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit status."""
    options = _parser().parse_args(arguments)
    try:
        status: int | None = options.call(options)
    except StiffdiceError as error:
        print(f"stiffdice: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stiffdice: interrupted; nothing was stored", file=sys.stderr)
        return 130
    except BrokenPipeError:  # as in `stiffdice inspect FILE | head`
        sys.stderr.close()
        return 0
    except MemoryError:
        print("stiffdice: not enough memory; keep fewer samples with a larger --every", file=sys.stderr)
        return 2
    except OSError as error:  # no room for the compiled kernel, say
        print(f"stiffdice: {error}", file=sys.stderr)
        return 2
    return status or 0

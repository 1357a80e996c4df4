"""`stiffdice run`: one scene, one file."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from stiffdice.cli import common, grammar
from stiffdice.cli.terminal import output
from stiffdice.errors import InputError, printable, told_within

if TYPE_CHECKING:
    from stiffdice.io.plain_dataset import PlainDataset

HELP = "run one scene and store its trajectory and verdict in one HDF5 file"
EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-04.yaml --steps 100000 -o throw.h5
  stiffdice run config/scenes/figure-09.yaml --model sliding --preset as_written -o stiff.h5
  stiffdice run config/scenes/figure-04.yaml --set launch.angular_momentum='{seed: 7}' --every 100 -o turning.h5
  stiffdice run config/scenes/figure-09.yaml --set ground.restitution=0.5 --dt '0.1 ms' -o half.h5
  stiffdice run config/scenes/two-cubes.yaml --set cubes.0.launch.velocity='[3, 0, 1]' --animate two.gif -o two.h5
  stiffdice run config/scenes/figure-09.yaml --simulator numpy --preset as_written --steps 2000 -o theirs.h5

The file is netCDF-4 on HDF5: xarray.open_dataset("throw.h5") opens it. Exit status: 0 when the run is done, whatever
its verdict; 2 for bad input.
"""


_DPI = 120  # of an animation


def add(run: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    grammar.add_scene(run)
    grammar.add(run, "--output", ", an .h5 file", required=True)
    told = (
        "vertical, sliding, tumbling, flying, or auto: the least that is exact for the scene (default: tumbling); "
        "pair: two cubes, of a scene with `cubes` (default there)"
    )
    run.add_argument("--model", metavar="MODEL", help=told)
    told = "stiffdice, or mujoco, pybullet, drake, dart, scipy, octave, numpy where installed (default: stiffdice)"
    run.add_argument("--simulator", default="stiffdice", metavar="SIMULATOR", help=told)
    told = ": symplectic_euler, forward_euler, velocity_verlet, rk4, implicit_euler, event, exact (default: the first)"
    grammar.add(run, "--scheme", told)
    steps = run.add_mutually_exclusive_group()
    grammar.add(steps, "--steps", " (default: 10000)", default="10000")
    grammar.add(steps, "--dt", ", in place of --steps: the longest")
    told = "of the error, for a scheme that controls its own (default: 1e-9 of the motion)"
    run.add_argument("--tolerance", metavar="X", help=told)
    run.add_argument("--every", metavar="N", help="keep every N-th step (default: at most 10,000 are kept)")
    told = (
        "most force evaluations of event, exact and scipy (default: 1e7), most steps of all others (default: all); "
        "a run that needs more is stored as undecided"
    )
    run.add_argument("--budget", metavar="N", help=told)
    told = "book where the energy goes, bounce by bounce, of two cubes body by body (takes longer)"
    run.add_argument("--ledger", action="store_true", help=told)
    grammar.add(run, "--animate", ": what turns")
    grammar.add_changes(run)
    grammar.add(run, "--force")
    grammar.add_form(run)


def call(options: argparse.Namespace) -> None:
    """Run the scene, store the run, and print its verdict."""
    from stiffdice.io import yaml_loader
    from stiffdice.scene import pair

    data = yaml_loader.load(options.scene)  # once: it may be a pipe
    run = _run_pair if pair.is_pair(data) else _run_one
    run(options, data)


def _run_one(options: argparse.Namespace, data: Any) -> None:
    """Run a scene of one cube."""
    from stiffdice.scene import scene as scenes
    from stiffdice.scene import validation

    with told_within(options.scene):
        scene = scenes.changed(data, options.overrides, options.preset)
    steps, note = _steps_of(options, scene.duration)
    target, drawing = _targets_of(options)

    # These take about a second to import; bad input is told before.
    from stiffdice.cli.terminal.progress import progress
    from stiffdice.dynamics.model_selection import AUTO
    from stiffdice.dynamics.state import TURNING
    from stiffdice.integrators import registry as schemes
    from stiffdice.io.writer import write_dataset
    from stiffdice.report import run_page
    from stiffdice.simulation import backend, energy_budget
    from stiffdice.simulation.dataset import plain_run_dataset
    from stiffdice.simulation.outcome import Verdict
    from stiffdice.simulation.run import simulate

    model = options.model or "tumbling"
    setup = backend.setup_of(scene, model, options.simulator, options.scheme, steps)
    if options.ledger:
        validation.choice("--ledger: simulator", setup.simulator, [backend.OURS])
        validation.choice("--ledger: scheme", setup.scheme, energy_budget.BOOKED)
    if drawing is not None:
        validation.choice("--animate: model", setup.model, sorted(TURNING))
    every = _every_of(options, steps)
    tolerance = schemes.TOLERANCE if options.tolerance is None else common.number("--tolerance", options.tolerance, "1")
    budget = None if options.budget is None else common.whole("--budget", options.budget)
    output.note(run_page.doubts(scene, setup.model, setup.scheme if setup.ours else "", steps))
    with progress(setup.scheme if setup.ours else "") as show:
        run = simulate(
            scene,
            model=model,
            simulator=options.simulator,
            scheme=options.scheme,
            steps=steps,
            tolerance=tolerance,
            every=every,
            budget=budget,
            progress=show,
        )
    dataset = plain_run_dataset(run)
    if options.ledger:
        done = int(run.steps_done[0])
        ledger = energy_budget.ledger(scene, model=run.model, scheme=run.scheme, steps=steps, budget=done)
        dataset = dataset.assign(ledger.data_vars)
    write_dataset(dataset, target)
    if drawing is not None:
        _animate(dataset, drawing, "A thrown cube")
    reason = [run.model_reason] if model == AUTO else []
    if options.json:
        output.say_json(run_page.as_data(run, str(target), [*scene.derived, *filter(None, [note]), *reason]))
        return
    advise = shlex.join(["stiffdice", "advise", *common.scene_words(options, options.overrides), "--error", "1%"])
    _say([*scene.derived, note, *reason])
    output.say_verdict(run_page.lines(run, str(target), advise), str(target), Verdict(run.verdict[0]))


# Options that mean nothing for two cubes, with what does.
_OF_ONE = {
    "preset": "none for two cubes, whose contact is gated; --set cubes.0.cube.geometry=printed sets one key of it",
    "tolerance": "none for two cubes, whose schemes take steps as given; --steps makes them shorter",
    "budget": "none for two cubes, whose schemes take steps as given; --steps says how many",
}


def _run_pair(options: argparse.Namespace, data: Any) -> None:
    """Run a scene of two cubes."""
    from stiffdice.scene import pair, validation

    for name, allowed in _OF_ONE.items():
        if (given := getattr(options, name)) is not None:
            raise InputError(f"--{name} = {given}: allowed is {allowed}")
    if options.model not in (None, "pair"):
        raise InputError(f"--model = {options.model}: allowed is pair for two cubes, or nothing")
    if options.simulator != "stiffdice":
        told = "allowed is stiffdice for two cubes; `make engines` compares engines, by one cube"
        raise InputError(f"--simulator = {options.simulator}: {told}")
    with told_within(options.scene):
        scene = pair.changed(data, options.overrides)
    steps, note = _steps_of(options, scene.duration)
    target, drawing = _targets_of(options)

    from stiffdice.cli.terminal.progress import progress
    from stiffdice.io.writer import write_dataset
    from stiffdice.report import pair_page
    from stiffdice.simulation import backend
    from stiffdice.simulation.outcome import Verdict
    from stiffdice.simulation.pair import energy_budget
    from stiffdice.simulation.pair.dataset import plain_pair_dataset
    from stiffdice.simulation.pair.run import check_scheme, simulate_pair

    scheme = options.scheme or backend.DEFAULT_SCHEME
    check_scheme(scheme)
    if options.ledger:
        validation.choice("--ledger: scheme", scheme, [energy_budget.BOOKED])
    every = _every_of(options, steps)
    with progress("two cubes") as show:
        output.note(pair_page.doubts(scene, scheme, steps))
        run = simulate_pair(scene, scheme=scheme, steps=steps, every=every, progress=show)
        dataset = plain_pair_dataset(run)
        if options.ledger:
            booked = energy_budget.ledger(scene, steps=steps, every=every, done=int(run.steps_done[0]))
            dataset = dataset.assign(booked.data_vars)
    write_dataset(dataset, target)
    if drawing is not None:
        _animate(dataset, drawing, "Two cubes")
    notes = [*scene.derived, *filter(None, [note])]
    if options.json:
        output.say_json(pair_page.as_data(run, str(target), notes))
        return
    _say(notes)
    output.say_verdict(pair_page.lines(run, str(target)), str(target), Verdict(run.verdict[0]))


def _steps_of(options: argparse.Namespace, duration: float) -> tuple[int, str]:
    """Return the number of steps, and what to say of it."""
    if options.dt is not None:
        return common.steps_of(options.dt, duration)
    return common.whole("--steps", options.steps), ""


def _every_of(options: argparse.Namespace, steps: int) -> int:
    """Return after how many steps each a state is kept."""
    from stiffdice.scene import validation
    from stiffdice.simulation.run import default_every

    if options.every is None:
        return default_every(steps)
    return validation.count("every", common.whole("--every", options.every), at_most=steps)


def _targets_of(options: argparse.Namespace) -> tuple[Path, Path | None]:
    """Return the files to write: the run, and its animation, if one is asked for."""
    from stiffdice.io import seal

    target = common.target_of(options.output, options.force, seal.is_sealed, options.scene)
    if options.animate is None:
        return target, None
    return target, common.picture_target("--animate", options.animate, [".gif"], options.force, options.scene)


def _animate(dataset: PlainDataset, target: Path, title: str) -> None:
    """Draw a run as it goes."""
    import xarray as xr

    from stiffdice.report.figures import registry, runs

    registry.store(runs.animation, {"run": xr.Dataset(*dataset)}, title, _DPI, [str(target)])


def _say(lines: list[str]) -> None:
    for line in filter(None, lines):
        print(printable(line))

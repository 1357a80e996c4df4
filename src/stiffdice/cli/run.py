"""`stiffdice run`: one scene, one file."""

from __future__ import annotations

import argparse
import shlex
import sys

from stiffdice.cli import common
from stiffdice.errors import printable

HELP = "run one scene and store its trajectory and verdict in one HDF5 file"
EXAMPLES = """\
examples:
  stiffdice run config/scenes/figure-04.yaml --steps 100000 -o throw.h5
  stiffdice run config/scenes/figure-09.yaml --model sliding --preset as_written -o stiff.h5
  stiffdice run config/scenes/figure-04.yaml --set launch.angular_momentum='{seed: 7}' --every 100 -o turning.h5
  stiffdice run config/scenes/figure-09.yaml --set ground.restitution=0.5 --dt '0.1 ms' -o half.h5
  stiffdice run config/scenes/figure-09.yaml --simulator numpy --preset as_written --steps 2000 -o theirs.h5

The file is netCDF-4 on HDF5: xarray.open_dataset("throw.h5") opens it. Exit status: 0 when the run is done, whatever
its verdict; 2 for bad input.
"""


def add(run: argparse.ArgumentParser) -> None:
    """Add its options to the command."""
    run.add_argument("scene", metavar="SCENE.yaml", help="the physical problem; config/README.md lists its keys")
    run.add_argument("-o", "--output", metavar="OUT.h5", required=True, help="the file to write")
    told = "vertical, sliding, tumbling, flying, or auto: the least that is exact for the scene (default: tumbling)"
    run.add_argument("--model", default="tumbling", metavar="M", help=told)
    told = "stiffdice, or mujoco, pybullet, drake, dart, scipy, octave, numpy where installed (default: stiffdice)"
    run.add_argument("--simulator", default="stiffdice", metavar="NAME", help=told)
    told = "symplectic_euler, forward_euler, velocity_verlet, rk4, implicit_euler, event, exact (default: the first)"
    run.add_argument("--scheme", metavar="NAME", help=told)
    steps = run.add_mutually_exclusive_group()
    steps.add_argument("--steps", default="10000", metavar="N", help="number of time steps (default: 10000)")
    steps.add_argument("--dt", metavar="H", help="in place of --steps: the longest step, as 1e-4 or '0.1 ms' [s]")
    told = "of the error, for a scheme that controls its own (default: 1e-9 of the motion)"
    run.add_argument("--tolerance", metavar="X", help=told)
    run.add_argument("--every", metavar="K", help="keep every K-th step (default: at most 10,000 are kept)")
    told = (
        "most force evaluations of event, exact and scipy (default: 1e7), most steps of all others (default: all); "
        "a run that needs more is stored as undecided"
    )
    run.add_argument("--budget", metavar="N", help=told)
    told = "book where the energy goes, bounce by bounce (takes longer)"
    run.add_argument("--ledger", action="store_true", help=told)
    run.add_argument("--force", action="store_true", help="replace a file that is not of stiffdice, too")
    common.add_changes(run)


def call(options: argparse.Namespace) -> None:
    """Run the scene, store the run, and print its verdict."""
    from stiffdice.io import seal
    from stiffdice.scene import scene as scenes
    from stiffdice.scene import validation

    scene = scenes.load(options.scene, options.overrides, options.preset)
    steps, note = common.whole("--steps", options.steps), ""
    if options.dt is not None:
        steps, note = common.steps_of(options.dt, scene.duration)
    target = common.target_of(options.output, options.force, seal.is_sealed, options.scene)

    # These take about a second to import; bad input is told before.
    from stiffdice.cli.terminal.progress import progress
    from stiffdice.dynamics.model_selection import AUTO
    from stiffdice.integrators import registry as schemes
    from stiffdice.io.writer import write_dataset
    from stiffdice.report import run_page
    from stiffdice.simulation import backend, energy_budget
    from stiffdice.simulation.dataset import plain_run_dataset
    from stiffdice.simulation.run import default_every, simulate

    setup = backend.setup_of(scene, options.model, options.simulator, options.scheme, steps)
    if options.ledger:
        validation.choice("--ledger: simulator", setup.simulator, [backend.OURS])
        validation.choice("--ledger: scheme", setup.scheme, energy_budget.BOOKED)
    every = default_every(steps)
    if options.every is not None:
        every = validation.count("every", common.whole("--every", options.every), at_most=steps)
    tolerance = schemes.TOLERANCE if options.tolerance is None else common.number("--tolerance", options.tolerance, "1")
    budget = None if options.budget is None else common.whole("--budget", options.budget)
    for line in run_page.doubts(scene, setup.model, setup.scheme if setup.ours else "", steps):
        print(f"stiffdice: note: {printable(line)}", file=sys.stderr)
    with progress(setup.scheme if setup.ours else "") as show:
        run = simulate(
            scene,
            model=options.model,
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
    for line in filter(None, [*scene.derived, note]):
        print(printable(line))
    if options.model == AUTO:
        print(run.model_reason)
    advise = shlex.join(["stiffdice", "advise", *common.scene_words(options, options.overrides), "--error", "1%"])
    print("\n".join(map(printable, run_page.lines(run, str(target), advise))))

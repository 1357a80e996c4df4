"""Throws of a die until their faces are decided; and MuJoCo's `rollout` of as many steps of the same die."""

from __future__ import annotations

import os
from collections.abc import Iterator

from benchmarks.case import Case, Effort, Missing
from benchmarks.ensemble import rolling
from stiffdice.dynamics.state import Ensemble
from stiffdice.errors import NotInstalledError
from stiffdice.experiments.dice.throws import default_steps
from stiffdice.scene import die
from stiffdice.scene.scene import Scene, from_mapping
from stiffdice.simulation.engines.registry import adapter_of
from stiffdice.simulation.landing import land
from stiffdice.simulation.launch_distribution import LaunchDistribution

LAUNCHES = LaunchDistribution(velocity_spread=0.3, spin_spread=30.0)
THROWS, THEIRS = 8192, 64


def cases(effort: Effort) -> Iterator[Case | Missing]:
    """Yield a fair die, one with a load, whose tensor turns with it, and MuJoCo's steps of the fair one."""
    fair = from_mapping(die.SCENE)
    loaded = from_mapping({**die.SCENE, "cube": {**die.SCENE["cube"], "load": {"at": "corner", "mass": "1 g"}}})
    count, threads = min(THROWS, 256 * effort.members), os.cpu_count() or 1
    for name, scene in {"fair": fair, "loaded": loaded}.items():
        steps, launches = default_steps(scene), LAUNCHES.draw(scene, count)
        yield Case(
            f"landing_{name}",
            f"{count} throws of a {name} die until decided, {threads} threads",
            "throw",
            count,
            lambda scene=scene, launches=launches, steps=steps: (  # type: ignore[misc]
                lambda: land(scene, launches, steps=steps, threads=threads)
            ),
            effort.rounds,
            "as the loop of sweeps: roots and quotients of eight nodes",
        )
    yield _rollout(fair, min(THEIRS, effort.members), threads, effort)


def _rollout(fair: Scene, count: int, threads: int, effort: Effort) -> Case | Missing:
    """Return MuJoCo's loop over throws, each as long as one of ours is on average; who decides it costs nothing."""
    try:
        adapter = adapter_of("mujoco")
    except NotInstalledError as error:
        return Missing("mujoco_rollout_landing", f"MuJoCo: {str(error).splitlines()[0]}")
    steps, launches = default_steps(fair), LAUNCHES.draw(fair, count)
    mean = round(float(land(fair, LAUNCHES.draw(fair, 1024), steps=steps).steps.mean()))
    members, h = Ensemble(launches, launches["position"][:, 0] * 0), fair.duration / steps
    return Case(
        "mujoco_rollout_landing",
        f"{count} throws of a fair die, {mean} steps each as ours on average: MuJoCo's rollout, {threads} threads",
        "throw",
        count,
        lambda: rolling(adapter, fair, "tumbling", members, mean, h, threads),
        effort.slow,
        "a general engine: collisions are looked for and a solver is called every step",
        version=adapter.version(),
    )

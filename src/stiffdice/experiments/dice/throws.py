"""One throw with its trajectory, and many with their counts: what `stiffdice throw` tells."""

from __future__ import annotations

import dataclasses
import math
import os
import sys
from dataclasses import dataclass
from typing import Any

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Array, edges_of
from stiffdice.errors import InputError
from stiffdice.experiments.dice import counts as counting
from stiffdice.experiments.dice.counts import Counts
from stiffdice.integrators import linear_stability
from stiffdice.scene import die
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation import progress
from stiffdice.simulation.landing import BATCHED, MODEL, STILL, Rest, faces_of, land
from stiffdice.simulation.launch_distribution import LaunchDistribution
from stiffdice.simulation.run import Run, simulate

# Unless a number of steps is given: ωh of the fastest contact, and the part of the linear limit at most, which is less
# where damping is strong.
OMEGA_H, PART = 0.3, 0.3
# Throws stepped at a time: some seconds' work.
_BATCH = 8 * 4096
# States kept of one throw.
_SAMPLES = 2000


@dataclass(frozen=True)
class Thrown:
    """One throw. face: the one up. rest: how sure. time [s]: after which it was decided, None if it was not."""

    run: Run
    face: int
    rest: Rest
    time: float | None

    def as_mapping(self) -> dict[str, Any]:
        """Return it as plain data."""
        return {"face": self.face, "rest": self.rest.name.lower(), "time_s": self.time, "steps": self.run.steps}


@dataclass(frozen=True)
class Throws:
    """Many throws. counts: of faces, of those settled, shape (6,). rests: throws by `Rest`. times [s]: of settled ones.

    evaluations: steps up to the decisions, in all.
    """

    scene: Scene
    scheme: str
    steps: int
    counts: Counts
    rests: dict[Rest, int]
    times: Array
    evaluations: float

    def as_mapping(self) -> dict[str, Any]:
        """Return them as plain data."""
        low, high = counting.intervals(self.counts)
        value, tail = counting.chi_square(self.counts)
        shares = self.counts / self.counts.sum()
        median, slow = np.quantile(self.times, (0.5, 0.99))
        return {
            "throws": sum(self.rests.values()),
            "scheme": self.scheme,
            "steps": self.steps,
            "faces": {
                str(face): {"count": int(count), "share": float(share), "interval_95": [float(a), float(b)]}
                for face, count, share, a, b in zip(die.FACES, self.counts, shares, low, high, strict=True)
            },
            "rest": {rest.name.lower(): count for rest, count in self.rests.items()},
            "time_to_rest_s": {"median": float(median), "quantile_99": float(slow)},
            "chi_square": value,
            "p_of_a_fair_die": tail,
        }


def steps_at(scene: Scene, omega_h: float) -> int:
    """Return the steps to the scene's duration at which its fastest contact has this ωh."""
    return max(1, math.ceil(linear_stability.hardest(scene, MODEL).omega * scene.duration / omega_h))


def default_steps(scene: Scene) -> int:
    """Return the steps to the scene's duration at which the fastest contact has ωh = OMEGA_H, or PART of its limit."""
    fewest = max(linear_stability.fewest_steps(scene, MODEL, BATCHED))
    return max(1000, steps_at(scene, OMEGA_H), math.ceil(fewest / PART))


def one(scene: Scene, launches: LaunchDistribution, scheme: str, steps: int) -> Thrown:
    """Return the first throw of a distribution, with its trajectory; raises InputError as `simulate` does."""
    faces, launch = faces_of(scene), launches.draw(scene, 1)[0]
    rotation = _rotation_vector(launch["node_offset"], scene)
    vectors = {name: tuple(launch[name].tolist()) for name in ("position", "velocity", "angular_momentum")}
    own = Launch(**vectors, orientation=rotation, node_velocity="rigid")
    run = simulate(
        dataclasses.replace(scene, launch=own), model=MODEL, scheme=scheme, steps=steps, every=max(1, steps // _SAMPLES)
    )
    assert run.trajectory is not None
    states, energy = run.trajectory.state, np.asarray(run.trajectory.mechanical_energy)
    below = die.face_below(-edges_of(scene.cube, states["node_offset"])[:, :, 2], faces.height)
    decided = np.flatnonzero(energy < faces.barrier[below - 1])
    if len(decided):
        first = decided[0]
        return Thrown(run, die.opposite(int(below[first])), Rest.SETTLED, float(run.trajectory.time[first]))
    moving = float(run.trajectory.kinetic_energy[-1])
    gap = float(faces.barrier[below[-1] - 1]) - scene.cube.mass * scene.gravity * float(faces.height[below[-1] - 1])
    rest = Rest.COCKED if moving < STILL * abs(gap) else Rest.UNSETTLED
    return Thrown(run, die.opposite(int(below[-1])), rest, None)


def _rotation_vector(nodes: Array, scene: Scene) -> tuple[float, float, float]:
    """Return the rotation vector [rad] that turns the upright body's nodes into these."""
    turn = edges_of(scene.cube, nodes).T
    # The quaternion's largest part first (Shepperd 1978, J. Guidance and Control 1, 223).
    trace = float(np.trace(turn))
    parts = np.array([trace, *np.diag(turn)])
    k = int(parts.argmax())
    q = np.empty(4)
    if k == 0:
        q[:] = 1 + trace, turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    else:
        i, j, m = k - 1, k % 3, (k + 1) % 3
        q[0] = turn[m, j] - turn[j, m]
        q[1 + i], q[1 + j], q[1 + m] = 1 + 2 * turn[i, i] - trace, turn[i, j] + turn[j, i], turn[i, m] + turn[m, i]
    q /= np.linalg.norm(q)
    size = float(np.linalg.norm(q[1:]))
    angle = 2 * math.atan2(size, float(q[0]))
    x, y, z = (angle / size * q[1:] if size > 0 else q[1:]).tolist()
    return x, y, z


def many(
    scene: Scene,
    launches: LaunchDistribution,
    scheme: str,
    steps: int,
    count: int,
    *,
    empty: bool = False,
) -> Throws:
    """Return the counts of many throws; raises InputError as `land` does, and where no throw settles, unless `empty`.

    As many threads share them as cores are allowed.
    """
    counts, rests, times, evaluations = np.zeros(len(die.FACES), np.int64), dict.fromkeys(Rest, 0), [], 0.0
    for first in progress.each(range(0, count, _BATCH)):
        drawn = launches.draw(scene, min(_BATCH, count - first), first)
        part = land(scene, drawn, steps=steps, scheme=scheme, threads=_cores(), progress=progress.tell)
        settled = part.rest == Rest.SETTLED
        counts += counting.counted(part.face, settled)
        for rest in Rest:
            rests[rest] += int((part.rest == rest).sum())
        evaluations += float(part.steps.sum())
        times.append(part.steps[settled] * (scene.duration / steps))
    if counts.sum() == 0 and not empty:
        told = max(rests, key=lambda rest: rests[rest]).sentence
        raise InputError(f"--steps = {steps}: no throw settled ({told}); allowed are more steps, or a longer duration")
    return Throws(scene, scheme, steps, counts, rests, np.concatenate(times), evaluations)


def _cores() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if sys.platform == "linux" else os.cpu_count() or 1


def told_of_one(thrown: Thrown) -> list[str]:
    """Return what to say of one throw."""
    when = "" if thrown.time is None else f", decided after {thrown.time:.3g} s"
    return [f"{thrown.face} is up{when}", thrown.rest.sentence]


def told_of_many(throws: Throws) -> list[str]:
    """Return a table of the faces, and what else to say of many throws."""
    low, high = counting.intervals(throws.counts)
    total, every = throws.counts.sum(), sum(throws.rests.values())
    lines = ["face    count   share   95 % interval"]
    for face, count, a, b in zip(die.FACES, throws.counts, low, high, strict=True):
        lines.append(f"   {face} {count:8d}  {count / total:.4f}  {a:.4f} to {b:.4f}")
    value, tail = counting.chi_square(throws.counts)
    lines.append(f"chi-square {value:.3g} with 5 degrees of freedom: a fair die has as much in {tail:.2g} of all cases")
    median, late = np.median(throws.times), np.quantile(throws.times, 0.99)
    lines.append(f"decided after {median:.2g} s in the median, {late:.2g} s for 99 %")
    others = [
        f"{count} {rest.name.lower().replace('_', ' ')}" for rest, count in throws.rests.items() if count and rest
    ]
    if others:
        lines.append(f"{total} of {every} throws settled, {', '.join(others)}: those are not counted")
    omega = linear_theory.omega_h(throws.scene, throws.steps)
    lines.append(
        f"{throws.scheme}, {throws.steps} steps to {throws.scene.duration:g} s, ωh = {omega:.2g} of a flat landing"
    )
    return lines

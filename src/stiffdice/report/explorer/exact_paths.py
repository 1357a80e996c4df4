"""Exact paths, thinned for a page: where the cube is and what energy it has, as runs are drawn beside and judged by.

By the scheme `event`. A path is stored as places and velocities at some times: a cubic (Hermite) between two of them
follows a flight exactly, so that a few numbers are a bounce. Energies are a polyline. Numbers are float32.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from stiffdice.dynamics.state import Array, Ensemble, States
from stiffdice.report.explorer.packing import Packer
from stiffdice.scene.scene import Scene
from stiffdice.simulation.reference_run import COARSER, TOLERANCE, references
from stiffdice.simulation.run import Trajectory, simulate

INTERVALS = 5000  # over the whole run, before it is thinned

# What thinning may move: a place, in radii of the cube; an energy, as a share of its range.
PLACE, ENERGY = 1e-4, 1e-3
# Where two runs part by so many radii, one at a hundred times the tolerance, the path is no longer known: chaos.
KNOWN = 1e-2


def packed(packer: Packer, scene: Scene, model: str, launch: States, horizon: float | None) -> dict[str, Any]:
    """Return where the exact path of a launch is stored, as JSON.

    launch: shape (1,). horizon [s]: until when `trajectory` compares, if it does.

    Arrays lie one after another. Of `counts[0]` nodes: time [s], height [m], its rate [m/s]. Of `counts[1]`: time [s],
    mechanical energy [J]. Of `counts[2]`, until the horizon: time [s], place [m] and velocity [m/s], shape (node, 3)
    each. `until` [s]: from when on the path is not known.
    """
    time, place, velocity, energy = _known(scene, model, launch)
    bends = thinned(len(time), lambda a, b: _off_cubic(time, place, velocity, a, b) <= PLACE * scene.cube.radius)
    allowed = ENERGY * float(np.ptp(energy))
    corners = thinned(len(time), lambda a, b: _off_line(time, energy, a, b) <= allowed)
    counts, until = [len(bends), len(corners), 0], float(time[-1])
    parts = [time[bends], place[bends], velocity[bends], time[corners], energy[corners]]
    if horizon is not None:
        reference = _reference(scene, model, launch, horizon)
        counts[2] = len(reference[0])
        parts += reference
    found = packer.put(np.concatenate([part.ravel() for part in parts]), "f4")
    return found | {"counts": counts, "until": until}


def _known(scene: Scene, model: str, launch: States) -> tuple[Array, Array, Array, Array]:
    """Return a path as far as it is known: time [s], height [m] and its rate [m/s], both (time, 1), energy [J]."""
    fine, coarse = (_run(scene, model, launch, tolerance) for tolerance in (TOLERANCE, COARSER * TOLERANCE))
    count = min(len(fine.time), len(coarse.time))
    apart = fine.state["position"][:count] - coarse.state["position"][:count]
    parted = ~(np.sqrt((apart**2).sum(axis=1)) <= KNOWN * scene.cube.radius)
    end = max(2, int(parted.argmax()) if parted.any() else count)
    assert fine.mechanical_energy is not None, "the schemes of our own tell it"
    state = fine.state[:end]
    return fine.time[:end], state["position"][:, 2:], state["velocity"][:, 2:], fine.mechanical_energy[:end]


def _run(scene: Scene, model: str, launch: States, tolerance: float) -> Trajectory:
    how: dict[str, Any] = {"scheme": "event", "steps": INTERVALS, "every": 1, "tolerance": tolerance}
    run = simulate(scene, model=model, members=Ensemble(launch, np.zeros(1)), **how)
    assert run.trajectory is not None, "states are kept"
    return run.trajectory


def _reference(scene: Scene, model: str, launch: States, horizon: float) -> tuple[Array, Array, Array]:
    """Return what `trajectory` compares with, thinned: time [s], place [m], velocity [m/s]."""
    table = references(scene, model, launch, horizon)[0][0]
    time, place, velocity = np.arange(len(table["position"])) * table["spacing"], table["position"], table["velocity"]
    allowed = PLACE * scene.cube.radius
    kept = thinned(len(time), lambda a, b: _off_cubic(time, place, velocity, a, b) <= allowed)
    return time[kept], place[kept], velocity[kept]


def thinned(count: int, follows: Callable[[int, int], bool]) -> list[int]:
    """Return which of so many samples to keep, the first and the last among them.

    follows: whether what is drawn from sample a to sample b leaves out nothing between them. Each piece is about as
    long as it can be.
    """
    kept = [0]
    while kept[-1] < count - 1:
        start, last = kept[-1], count - 1
        length = 1
        while start + length < last and follows(start, min(start + 2 * length, last)):
            length *= 2
        good, bad = min(start + length, last), min(start + 2 * length, last + 1)
        while good + 1 < bad:
            middle = (good + bad) // 2
            good, bad = (middle, bad) if follows(start, middle) else (good, middle)
        kept.append(good)
    return kept


def _off_cubic(time: Array, place: Array, velocity: Array, a: int, b: int) -> float:
    """Return how far the cubic from sample a to b is from a sample between them [m]."""
    span = time[b] - time[a]
    s = ((time[a + 1 : b] - time[a]) / span)[:, None]
    p, q, u, v = place[a], place[b], velocity[a] * span, velocity[b] * span
    drawn = p + s * (u + s * (3 * (q - p) - 2 * u - v + s * (2 * (p - q) + u + v)))
    return float(np.abs(drawn - place[a + 1 : b]).max(initial=0.0))


def _off_line(time: Array, values: Array, a: int, b: int) -> float:
    """Return how far the line from sample a to b is from a sample between them."""
    drawn = values[a] + (values[b] - values[a]) * (time[a + 1 : b] - time[a]) / (time[b] - time[a])
    return float(np.abs(drawn - values[a + 1 : b]).max(initial=0.0))

"""How far chaos allows a toss to be foretold: final faces of launches that differ by the tracker's error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from stiffdice.experiments.measuring import coordinates, mapped, numbers, result
from stiffdice.experiments.tosses.fit import DATA, split
from stiffdice.experiments.tosses.launches import SOURCES, launches_of, measured, perturbed, tracker_of
from stiffdice.experiments.tosses.replay import MODEL, SCHEME, Physics, faces, scene_of, step_of
from stiffdice.scene import die, validation
from stiffdice.scene.scene import Scene

# Faces are the same at shorter steps but for a toss in a hundred (docs/explanation/tosses.md).
_STEP = 0.1

_FOUND = {
    "changed": ("share of perturbed launches whose final face is another", "1", "toss"),
    "likeliest": ("share of perturbed launches that end on the most frequent face", "1", "toss"),
    "right": ("share of perturbed launches that end on the measured face", "1", "toss"),
}


def measure(
    scene: Scene,
    *,
    data: str = DATA,
    restitution: float = 0.125,
    friction: float = 0.18,
    contact_time: float = 0.005,
    sizes: Sequence[float] = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0),
    draws: int = 200,
    seed: int = 18,
) -> xr.Dataset:
    """Return how often the final face of perturbed launches changes, by the source of launches and the error's size.

    scene: gives gravity and the contact law. data: a file of tosses. restitution, friction, contact_time [s]: of the
    board. sizes [1]: of the perturbation, 1 being the tracker's error. draws: perturbed launches of each toss. seed: of
    the third that was fitted, and is left out, and of the perturbations. Dimensions source, size, toss; `unperturbed`
    is 1 if the toss itself ends on the measured face. If the model were exact and the launch known this well, the best
    guess would be right as often as `likeliest` on average.
    Raises InputError as `fit.measure` does.
    """
    asked = numbers("sizes", sizes, "1", at_least=0)
    count, seed = validation.count("draws", draws), validation.count("seed", seed, at_least=0)
    tosses, _ = measured(data, scene.gravity)
    tracker = tracker_of(tosses, scene.gravity)
    _, others = split(len(tosses.counts), seed)
    rest = tosses.chosen(others)
    ours = scene_of(rest, Physics(restitution, friction, contact_time), scene)
    step, real = step_of(ours, _STEP), rest.faces[rest.last]
    launches = {source: launches_of(rest, source, scene.gravity) for source in SOURCES}
    alone = {source: faces(found, ours, step) for source, found in launches.items()}

    def shares(source: str, size: float) -> list[object]:
        random = np.random.default_rng([seed, SOURCES.index(source)])  # the same draws at every size
        drawn = [perturbed(rest, launches[source], source, tracker, size, random) for _ in range(count)]
        found = np.array([faces(launch, ours, step) for launch in drawn])
        often = np.array([(found == face).mean(axis=0) for face in (0, *die.FACES)])
        return [(found != alone[source]).mean(axis=0), often.max(axis=0), (found == real).mean(axis=0)]

    variables = mapped(shares, _FOUND, source=SOURCES, size=asked) | coordinates(toss=others)
    own = {"unperturbed": ("1 if the toss itself ends on the measured face", "1", "toss")}
    variables |= mapped(lambda source: [(alone[source] == real).astype(float)], own, source=SOURCES)
    about = {f"tracker_{name}": value for name, value in tracker._asdict().items()} | {"draws": count}
    return result(variables, "Final faces of perturbed tosses", scene, MODEL, SCHEME, __name__, **about)

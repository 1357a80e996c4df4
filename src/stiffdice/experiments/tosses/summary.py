"""What a file of tosses says in short: its unit of length, restitution and friction, and how right a replay is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from stiffdice.errors import InputError
from stiffdice.experiments.tosses.fit import Fit, Told, fit, split, told
from stiffdice.experiments.tosses.launches import SOURCES, Tracker, Unit, calibrated, launches_of, tracker_of
from stiffdice.experiments.tosses.replay import Physics
from stiffdice.scene.scene import Scene
from stiffdice.scene.tosses import Tosses


class Summary(NamedTuple):
    """What was fitted on a random third of the tosses, and what is told of the others.

    tosses: in true metres. kept: of those told, the share that keeps the face of the first sample. told: by the source
    of the launches, errors of each toss.
    """

    tosses: Tosses
    unit: Unit
    tracker: Tracker
    fitted: int
    fit: Fit
    physics: Physics
    kept: float
    told: Mapping[str, Told]


def summary_of(
    stored: Tosses, scene: Scene, contact_time: float, seed: int, tell: Callable[[str, float], None]
) -> Summary:
    """Return what tosses as stored say.

    scene: gives gravity and the contact law. contact_time [s]: of a flat landing. seed: of the third. tell: called with
    what is tried next and the part of the time that is over.
    Raises InputError for a single toss, and as `calibrated` does.
    """
    tosses, unit = calibrated(stored, scene.gravity)
    fitted, others = split(len(tosses.counts), seed)
    if not len(others):
        raise InputError("row_size: has one toss: allowed are at least two, one to fit and one to tell of")
    mine, rest = tosses.chosen(fitted), tosses.chosen(others)
    physics = Physics(contact_time=contact_time)
    best = fit(
        mine,
        launches_of(mine, SOURCES[0], scene.gravity),
        scene,
        physics,
        tell=lambda text, part: tell(text, _FIT * part),
    )
    tell("the others", _FIT)
    physics = physics._replace(restitution=best.restitution, friction=best.friction)
    found = {
        source: told(rest, launches_of(rest, source, scene.gravity), scene, physics, _OMEGA_H) for source in SOURCES
    }
    kept = float(np.mean(rest.faces[rest.first] == rest.faces[rest.last]))
    return Summary(tosses, unit, tracker_of(tosses, scene.gravity), len(fitted), best, physics, kept, found)


# Errors against reality are known to a hundredth at these steps.
_OMEGA_H = 0.1
_FIT = 0.85  # part of the time that the fit takes

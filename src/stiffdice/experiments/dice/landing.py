"""How often each face of a die is up, how long a throw takes to be decided, and what is not decided at all.

A fair cube that is thrown from all orientations alike has six equal faces, by symmetry, whatever its steps are. What
breaks the symmetry shows: a load, a box, or a launch that always begins upright.
"""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.experiments.dice import counts as counting
from stiffdice.experiments.dice import throws as throwing
from stiffdice.experiments.measuring import coordinates, quantity, result
from stiffdice.scene import die, validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.landing import BATCHED, MODEL, Rest
from stiffdice.simulation.launch_distribution import LaunchDistribution

# How spins are drawn: about the scene's, or as its {seed, low, high} says.
SPINS = ("gaussian", "scene")
# Of the times to the decision.
_QUANTILES = (0.01, 0.1, 0.5, 0.9, 0.99)


def launches_of(
    orientation: str, velocity_spread: float, spin: str, spin_spread: float, seed: int
) -> LaunchDistribution:
    """Return the distribution that an experiment's options say; raises InputError."""
    gaussian = validation.choice("spin", spin, SPINS) == "gaussian"
    return LaunchDistribution(orientation, velocity_spread, spin_spread if gaussian else None, seed)


def measure(
    scene: Scene,
    *,
    throws: int = 200_000,
    steps: int | None = None,
    orientation: str = "uniform",
    velocity_spread: float = 0.3,
    spin: str = "gaussian",
    spin_spread: float = 30.0,
    seed: int = 0,
) -> xr.Dataset:
    """Return counts and probabilities of the faces of a die, dimension face, and times to the decision.

    scene: the die, its ground and the mean launch. throws: how many. steps: to the scene's duration; None takes those
    at which the fastest contact has ωh = 0.3. orientation: `uniform` or `as_launched`. velocity_spread [m/s] and
    spin_spread [rad/s]: standard deviations of each component. spin: `gaussian`, or `scene`, which draws the angular
    momentum as the scene's {seed, low, high} says. seed: of the launches.
    Raises InputError for a value out of range, and where no throw settles.
    """
    launches = launches_of(orientation, velocity_spread, spin, spin_spread, seed)
    steps = throwing.default_steps(scene) if steps is None else validation.count("steps", steps)
    many = throwing.many(scene, launches, BATCHED, steps, validation.count("throws", throws))
    low, high = counting.intervals(many.counts)
    value, tail = counting.chi_square(many.counts)
    found = {
        "count": quantity("face", many.counts, "throws that ended with this face up"),
        "probability": quantity("face", many.counts / many.counts.sum(), "share of the throws that settled"),
        "probability_low": quantity("face", low, "lower end of the 95 % interval of the probability"),
        "probability_high": quantity("face", high, "upper end of the 95 % interval of the probability"),
        "rest_count": quantity("rest", [many.rests[rest] for rest in Rest], "throws that ended so"),
        "time_to_decision": quantity("quantile", np.quantile(many.times, _QUANTILES), "time to the decision", "s"),
        "chi_square": quantity((), value, "Pearson's chi-square against a fair die, five degrees of freedom"),
        "fair_die_probability": quantity((), tail, "probability that a fair die has a chi-square as large"),
    }
    axes = coordinates(face=die.FACES, quantile=_QUANTILES, rest=[rest.name.lower() for rest in Rest])
    told = {"steps": steps, "throws": throws, "seed": seed, "orientation": orientation}
    told |= {"velocity_spread": launches.velocity_spread, "spin": spin, "spin_spread": spin_spread}
    return result(found | axes, "Faces of a die thrown many times", scene, MODEL, BATCHED, __name__, **told)

"""One toss, measured and simulated side by side."""

from __future__ import annotations

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import coordinates, quantity, result
from stiffdice.experiments.tosses.fit import DATA
from stiffdice.experiments.tosses.launches import launches_of, measured
from stiffdice.experiments.tosses.replay import (
    CONVERGED,
    MODEL,
    SCHEME,
    Paths,
    Physics,
    replay,
    scene_of,
    step_of,
    whole_step,
)
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.scene.tosses import Tosses


def measure(
    scene: Scene,
    *,
    data: str = DATA,
    restitution: float = 0.125,
    friction: float = 0.18,
    contact_time: float = 0.005,
    toss: int = 1,
    source: str = "sample",
) -> xr.Dataset:
    """Return the nodes of the measured cube and of the simulated one over time.

    scene: gives gravity and the contact law. data: a file of tosses. restitution, friction, contact_time [s]: of the
    board. toss: its number, from 1 on. source: of its launch, `sample` or `flight`, a fit to all before contact.
    Dimensions time, node, axis; positions also.
    Raises InputError as `fit.measure` does.
    """
    tosses, _ = measured(data, scene.gravity)
    number = validation.count("toss", toss, at_most=len(tosses.counts))
    return dataset(tosses, scene, Physics(restitution, friction, contact_time), number - 1, source)


def dataset(tosses: Tosses, scene: Scene, physics: Physics, toss: int, source: str = "sample") -> xr.Dataset:
    """Return the same of tosses in true metres; toss: its number, from 0 on."""
    one = tosses.chosen(np.array([toss]))
    ours = scene_of(one, physics, scene)
    launches = launches_of(one, source, scene.gravity)
    paths = replay(one, launches, ours, whole_step(one.rate, step_of(ours, CONVERGED)))
    nodes = ours.cube.node_offsets()
    variables = coordinates(time=one.time)
    for name, who in (("measured", one), ("simulated", paths)):
        variables[f"{name}_position"] = quantity(("time", "axis"), who.position, f"centre of the {name} cube", "m")
        variables[f"{name}_nodes"] = quantity(
            ("time", "node", "axis"), _nodes(who, nodes), f"nodes of the {name} cube", "m"
        )
    return result(variables, "One toss beside its simulation", scene, MODEL, SCHEME, __name__, toss=toss + 1)


def _nodes(who: Tosses | Paths, offsets: Array) -> Array:
    found: Array = who.position[:, None] + offsets @ who.orientation.swapaxes(1, 2)
    return found

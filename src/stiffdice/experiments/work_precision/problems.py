"""The problems that every method is tried on: a scene each, and how far off a run of it is.

All are on level ground under the gated law. A path is known at the launch and after SAMPLES equal parts of its time.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from stiffdice.dynamics import flat_bounce
from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.state import States, physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import bisected
from stiffdice.experiments.placement import level, relaunched, upright
from stiffdice.scene.rotation import rotated
from stiffdice.scene.scene import Scene

# Few, so that keeping them costs next to nothing; between two of them there is a flight after the first landing.
SAMPLES = 12

# By measure: what is stored of it.
MEASURES = {
    "position": "root mean square distance of the centre from the reference over the samples, in radii",
    "restitution": "error of the centre's speed up from the first landing over its speed down",
    "energy": "error of the energy at the end, over that of the launch",
}


class Problem(NamedTuple):
    """A kind of motion: the model that computes it, whether the ground rubs, and its name in a figure."""

    model: str
    rubs: bool
    name: str

    @property
    def turns(self) -> bool:
        """Whether the cube keeps the launch's spin and orientation, and so lands on its corners."""
        return self.model == "tumbling"


PROBLEMS: dict[str, Problem] = {
    "flat-bounce": Problem("sliding", False, "flat bounce"),
    "sliding-bounce": Problem("sliding", True, "sliding bounce with friction"),
    "tumbling-throw": Problem("tumbling", True, "tumbling throw"),
}


def scene_of(problem: Problem, scene: Scene, stiffness: float) -> Scene:
    """Return the problem's scene on the cube, launch and ground of another, at one stiffness [kg/s²].

    Raises InputError for a launch that is not from above the ground, under gravity.
    """
    friction = scene.ground.friction if problem.rubs else 0.0
    scene = relaunched(level(scene, stiffness=stiffness, friction=friction), node_velocity="rigid")
    scene = scene if problem.turns else upright(scene)
    if scene.gravity == 0 or not _clearance(scene, 0.0) > 0:
        raise InputError("allowed are launches from above the ground, under gravity")
    return scene


def _clearance(scene: Scene, time: float) -> float:
    """Return how far the lowest node is above the ground [m], so long [s] after the launch, in free flight."""
    launch = scene.launch
    turned = rotated(scene.cube.node_offsets(), np.array(launch.orientation))
    turned = rotated(turned, np.array(launch.spin) / scene.cube.moment_of_inertia * time)
    return float(_height(scene, time) + turned[:, 2].min())


def _height(scene: Scene, time: float) -> float:
    return scene.launch.position[2] + scene.launch.velocity[2] * time - scene.gravity * time**2 / 2


def touchdown(scene: Scene) -> float:
    """Return the centre's height [m] when the launch first touches the ground; found to a sixtieth of a sample first.

    Raises InputError if it does not within the duration.
    """
    times = np.linspace(0, scene.duration, 60 * SAMPLES + 1)
    below = next((k for k, time in enumerate(times) if _clearance(scene, time) <= 0), None)
    if below is None:
        raise InputError(f"duration = {scene.duration:g}: allowed is one in which the cube lands [s]")
    early, late = float(times[below - 1]), float(times[below])
    return _height(scene, bisected(lambda time: _clearance(scene, time) > 0, early, late)[1])


class Judge:
    """How far off paths of one problem's scene are; height [m]: of the centre at the first touch."""

    def __init__(self, problem: Problem, scene: Scene, reference: States) -> None:
        """Take the scene (of `scene_of`) and the states that are right; raises InputError if it stays on the ground."""
        self._scene, self._problem, self._reference = scene, problem, reference
        self.height = touchdown(scene)
        self._after = _next_flight(scene, reference)
        self._launch_energy = _energy(scene, start_of(scene, problem.model))
        self._end_energy = _energy(scene, reference[-1:])
        down, up = self._speeds(reference, 0.0)
        self._restitution = up / down

    def errors(self, states: States, lag_time: float = 0.0) -> dict[str, float]:
        """Return the error by each of MEASURES; not-a-number where a run left the range of doubles.

        lag_time [s]: by how much the velocity is behind the place, as the scheme's LAG says.
        """
        found = dict.fromkeys(MEASURES, math.nan)
        with np.errstate(all="ignore"):
            away = states["position"] - self._reference["position"]
            found["position"] = math.sqrt(float(np.mean((away**2).sum(axis=1)))) / self._scene.cube.radius
            down, up = self._speeds(states, lag_time)
            if 0 < down < math.inf:
                exact = self._restitution if self._problem.turns else flat_bounce.restitution(self._scene, down)
                found["restitution"] = abs(up / down - exact)
            found["energy"] = abs(_energy(self._scene, states[-1:]) - self._end_energy) / self._launch_energy
        return {name: value if math.isfinite(value) else math.nan for name, value in found.items()}

    def _speeds(self, states: States, lag_time: float) -> tuple[float, float]:
        """Return the centre's speed down and up [m/s] at the height of the first touch, on the flights' parabolas."""
        known = states[[0, self._after]]
        slopes = known["velocity"][:, 2] - lag_time * self._scene.gravity
        squares = slopes**2 + 2 * self._scene.gravity * (known["position"][:, 2] - self.height)
        down, up = np.sqrt(np.maximum(squares, 0.0)).tolist()
        return down, up


def _next_flight(scene: Scene, states: States) -> int:
    """Return the first sample after the first landing from which on nothing but gravity acts until the next."""
    fall = scene.gravity * scene.duration / (len(states) - 1)
    change = np.diff(states["velocity"], axis=0) + np.array([0.0, 0.0, fall])
    twist = np.diff(states["angular_momentum"], axis=0)
    flown = (np.abs(change).max(axis=1) < 1e-5 * fall) & (np.abs(twist).max(axis=1) < 1e-5)
    landed = int(np.argmin(flown))
    later = np.flatnonzero(flown[landed:])
    if flown.all() or not later.size:
        raise InputError(f"ground.stiffness = {scene.ground.stiffness:g}: the cube does not leave the ground in time")
    return landed + int(later[0])


def _energy(scene: Scene, states: States) -> float:
    """Return kinetic, potential and elastic energy [J] of one state."""
    return float(sum(energies(physics_of(scene), states))[0])

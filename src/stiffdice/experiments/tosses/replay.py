"""Tosses replayed by the simulator from their launches, and how far from the measured ones they are."""

from __future__ import annotations

import dataclasses
import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import Array, Ensemble
from stiffdice.experiments.tosses.launches import Launches
from stiffdice.scene import derived_parameters
from stiffdice.scene.cube import SIGNS, Cube, radius_of
from stiffdice.scene.scene import Ground, Scene
from stiffdice.scene.tosses import Tosses
from stiffdice.simulation import landing
from stiffdice.simulation.run import simulate

MODEL, SCHEME = "tumbling", "symplectic_euler"

# Steps by which errors against reality are known to a hundredth (docs/explanation/tosses.md).
CONVERGED = 0.05
# A toss is given so long to come to rest [s]: the longest measured one takes 3 s.
_REST = 4.0


class Physics(NamedTuple):
    """What the measured cube and its board leave open.

    restitution e and contact_time [s]: of a flat landing without gravity. friction: coefficient. inertia: `measured`,
    or as one of a cube's (`solid`, `corners`). law: of contact; None takes the scene's.
    """

    restitution: float = 0.125
    friction: float = 0.18
    contact_time: float = 0.005
    inertia: str = "measured"
    law: str | None = None


class Paths(NamedTuple):
    """Where replayed cubes are at the tosses' samples; not a number where a replay left the range of doubles.

    position [m]: shape (sample, 3). orientation: matrices from body to world, shape (sample, 3, 3).
    """

    position: Array
    orientation: Array


class Errors(NamedTuple):
    """How far replayed tosses are from others, at each sample, shape (sample,).

    path [sides]: distance of the centres. orientation [rad]: angle of the rotation from one to the other. Infinite
    where the replay left the range of doubles.
    """

    path: Array
    orientation: Array

    def means(self, tosses: Tosses) -> Errors:
        """Return the means over time of each toss, shape (toss,)."""
        return Errors(*(np.add.reduceat(part, tosses.first) / tosses.counts for part in self))


def scene_of(tosses: Tosses, physics: Physics, scene: Scene, duration: float = 1.0) -> Scene:
    """Return a scene of the measured cube on ground with this physics.

    scene: gives gravity, and the contact law where the physics names none. duration [s]. Raises InputError for values
    out of range.
    """
    law = physics.law or scene.ground.contact
    moments = (tosses.moment_of_inertia,) * 3 if physics.inertia == "measured" else None
    inertia = "solid" if physics.inertia == "measured" else physics.inertia
    cube = Cube(radius_of(tosses.side, "exact"), tosses.mass, "exact", inertia, moments=moments)
    given = {"restitution": physics.restitution, "contact_time": physics.contact_time, "friction": physics.friction}
    keys, _ = derived_parameters.ground(given | {"contact": law}, cube, Ground.stiffness)
    ground = Ground(**keys, normal=scene.ground.normal)
    return Scene(cube, ground, gravity=scene.gravity, duration=duration)


def step_of(scene: Scene, omega_h: float) -> float:
    """Return the step size [s] at which a flat landing has this ωh."""
    return omega_h / linear_theory.contact_frequency(scene.ground.stiffness, scene.cube.mass)


def whole_step(rate: float, step: float) -> float:
    """Return the longest step, at most this long [s], of which a sample's time is a whole number; rate [Hz]."""
    return 1 / (rate * math.ceil(1 / (rate * step) - 1e-9))


def replay(
    tosses: Tosses,
    launches: Launches,
    scene: Scene,
    step: float,
    *,
    model: str = MODEL,
    scheme: str = SCHEME,
    tolerance: float = 1e-9,
) -> Paths:
    """Return the paths that the simulator makes from the tosses' launches.

    scene: of `scene_of`. step [s]: of any length; between two steps the motion is the step's, a straight line and a
    steady turn. model, scheme, tolerance: as of `simulate`.
    """
    starts = launches.states(scene)
    found = Paths(np.full(tosses.position.shape, math.nan), np.full(tosses.orientation.shape, math.nan))
    per_sample = 1 / (tosses.rate * step)
    whole = per_sample >= 1 and abs(per_sample - round(per_sample)) < 1e-9 * per_sample
    every = round(per_sample) if whole else 1
    kept = every * step
    for k, part in enumerate(tosses.slices()):
        times = np.arange(tosses.counts[k]) / tosses.rate
        later = np.ceil(times / kept - 1e-9).astype(np.int64)  # the state kept at or after each sample
        run = simulate(
            dataclasses.replace(scene, duration=float(later[-1] * kept)),
            model=model,
            scheme=scheme,
            steps=int(later[-1]) * every,
            every=every,
            tolerance=tolerance,
            leap=True,
            criteria={},
            members=Ensemble(starts[k : k + 1], np.zeros(1)),
        )
        assert run.trajectory is not None
        known = run.trajectory.state[later[later < len(run.trajectory.state)]]
        back = later[: len(known)] * kept - times[: len(known)]
        here = slice(part.start, part.start + len(known))
        found.position[here] = known["position"] - back[:, None] * known["velocity"]
        found.orientation[here] = orientation_of(known["node_offset"], tosses.half_width)
        if not whole:
            turn = Rotation.from_rotvec(-back[:, None] * known["angular_velocity"]).as_matrix()
            found.orientation[here] = turn @ found.orientation[here]
    return found


def errors(tosses: Tosses, paths: Paths, reference: Paths | Tosses | None = None) -> Errors:
    """Return how far paths are from a reference; None is the measured one."""
    other = tosses if reference is None else reference
    with np.errstate(over="ignore", invalid="ignore"):
        path = np.linalg.norm(paths.position - other.position, axis=1) / tosses.side
        turn = angles(paths.orientation @ np.swapaxes(other.orientation, 1, 2))
    return Errors(*(np.where(np.isfinite(part), part, math.inf) for part in (path, turn)))


def orientation_of(nodes: Array, half_width: float) -> Array:
    """Return matrices from body to world, shape (..., 3, 3), of cubes with these nodes [m], shape (..., 8, 3)."""
    return np.asarray(np.einsum("...nx,ne->...xe", nodes, SIGNS) / (len(SIGNS) * half_width))


def angles(rotations: Array) -> Array:
    """Return the angles [rad] of rotation matrices, shape (..., 3, 3), from 0 to π."""
    across = rotations - np.swapaxes(rotations, -1, -2)
    sine = np.sqrt(np.square(across).sum(axis=(-1, -2)) / 8)
    return np.asarray(np.arctan2(sine, (np.trace(rotations, axis1=-2, axis2=-1) - 1) / 2))


def faces(launches: Launches, scene: Scene, step: float) -> npt.NDArray[np.int8]:
    """Return the face that is up in the end, or nearest to up, 1 to 6, shape (toss,); 0 of a toss that blew up."""
    longer = dataclasses.replace(scene, duration=_REST)
    found = landing.land(longer, launches.states(scene), steps=max(1, math.ceil(_REST / step)))
    return np.where(found.rest == landing.Rest.BLEW_UP, 0, found.face).astype(np.int8)

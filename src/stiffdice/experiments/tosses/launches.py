"""What the data say before any contact: their unit of length, the tracker's error, and how each toss was launched.

A cube in the air falls as a point does and, its moments of inertia being equal, keeps its angular velocity. So a flight
is two numbers for each coordinate, known from many samples: better than the velocity that comes with the first sample.
What is left over is the tracker's error.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from stiffdice.dynamics.state import STATE, Array, States
from stiffdice.errors import InputError
from stiffdice.scene import tosses as files
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.scene.tosses import Tosses

SOURCES = ("sample", "flight")

# A flight ends when a node comes as near to the board as this, in half widths; a fit takes so many samples at least.
_NEAR, _FEWEST = 0.1, 6
# Gauss-Newton rounds of the orientation's fit: what is left is below 0.1 rad at first, and each round squares it.
_ROUNDS = 4


class Unit(NamedTuple):
    """The data's unit of length, and what shows that it is right.

    length: metres for each metre that is stored, from the height of the cube at rest, which is half its width;
    length_error: its standard error. fall, fall_error [m/s²]: acceleration of the flights in true metres, and its
    standard error.
    """

    length: float
    length_error: float
    fall: float
    fall_error: float


class Launches(NamedTuple):
    """Where each toss begins; first dimension: the toss.

    position [m], velocity [m/s], orientation: matrix from body to world, angular_velocity [rad/s], along the world's
    axes.
    """

    position: Array
    velocity: Array
    orientation: Array
    angular_velocity: Array

    def states(self, scene: Scene) -> States:
        """Return STATE records of the scene's cube, whose moments of inertia are equal."""
        found = np.zeros(len(self.position), STATE)
        found["position"], found["velocity"] = self.position, self.velocity
        found["angular_velocity"] = self.angular_velocity
        found["angular_momentum"] = scene.cube.moment_of_inertia * self.angular_velocity
        found["node_offset"] = scene.cube.node_offsets() @ np.swapaxes(self.orientation, 1, 2)
        return found


class Tracker(NamedTuple):
    """Standard errors: of a tracked sample, along each axis, and of a launch by its first sample.

    position [m], orientation [rad]: what flights leave over. velocity [m/s], angular_velocity [rad/s]: of the first
    sample, from those of the flights.
    """

    position: float
    orientation: float
    velocity: float
    angular_velocity: float


def measured(path: str, gravity: float) -> tuple[Tosses, Unit]:
    """Return the tosses in a file in true metres, and their unit; gravity [m/s²]. Raises InputError as `load` does."""
    return calibrated(files.load(path), gravity)


def calibrated(tosses: Tosses, gravity: float) -> tuple[Tosses, Unit]:
    """Return tosses in true metres, and their unit of length; gravity [m/s²]: for a fall of too few samples to tell.

    Raises InputError where the cube at rest is not half its width high, by more than a tenth.
    """
    heights = tosses.position[tosses.last, 2]
    length = tosses.half_width / float(np.median(heights))
    if not abs(length - 1) < 0.1:
        raise InputError(
            f"half_width = {tosses.half_width:g}: the cube at rest is {np.median(heights):.4g} m high; allowed is the "
            "same within a tenth"
        )
    scaled = tosses.in_units_of(length)
    error = length * float(heights.std() / np.median(heights)) / math.sqrt(len(heights))
    return scaled, Unit(length, error, *_fall(scaled, gravity))


def flight_counts(tosses: Tosses) -> npt.NDArray[np.int64]:
    """Return how many samples of each toss are of its flight, shape (toss,)."""
    clear = tosses.clearance > _NEAR * tosses.half_width
    parts = [clear[part] for part in tosses.slices()]
    return np.array([len(part) if part.all() else max(0, int(part.argmin()) - 1) for part in parts])


def _fall(tosses: Tosses, gravity: float) -> tuple[float, float]:
    """Return the acceleration of the flights, down [m/s²], and its standard error; weights are each fit's own."""
    falls, weights = [], []
    for part, count in zip(tosses.slices(), flight_counts(tosses), strict=True):
        if count >= _FEWEST + 1:
            times = np.arange(count) / tosses.rate
            design = np.column_stack([np.ones(count), times, -(times**2) / 2])
            inverse = np.linalg.inv(design.T @ design)
            falls.append(inverse[2] @ design.T @ tosses.position[part][:count, 2])
            weights.append(1 / inverse[2, 2])
    if len(falls) < 2:
        return gravity, math.inf
    shares = np.array(weights) / np.sum(weights)
    mean = float(shares @ falls)
    return mean, float(np.sqrt(np.sum(shares**2 * (np.array(falls) - mean) ** 2)))


def launches_of(tosses: Tosses, source: str, gravity: float) -> Launches:
    """Return the launches as a source has them: `sample`, the first one, or `flight`, a fit to all before contact.

    gravity [m/s²]. A flight too short to fit has the first sample's launch. Raises InputError for
    another source.
    """
    found = _first(tosses)
    if validation.choice("source", source, SOURCES) == "flight":
        for k, (part, count) in enumerate(zip(tosses.slices(), flight_counts(tosses), strict=True)):
            if count >= _FEWEST:
                for mine, fitted in zip(found, _fitted(tosses, part, int(count), gravity, found, k)[0], strict=True):
                    mine[k] = fitted
    return found


def _first(tosses: Tosses) -> Launches:
    first = tosses.first
    return Launches(
        tosses.position[first].copy(),
        tosses.velocity.copy(),
        tosses.orientation[first].copy(),
        tosses.angular_velocity.copy(),
    )


def _fitted(
    tosses: Tosses, part: slice, count: int, gravity: float, first: Launches, k: int
) -> tuple[tuple[Array, Array, Array, Array], Array, Array]:
    """Return the launch that fits a flight best, and what is left of places [m] and turns [rad], shape (count, 3)."""
    times = np.arange(count) / tosses.rate
    design = _design(times)
    fallen = tosses.position[part][:count] + 0.5 * gravity * times[:, None] ** 2 * [0.0, 0.0, 1.0]
    place, *_ = np.linalg.lstsq(design, fallen)
    measured = Rotation.from_matrix(tosses.orientation[part][:count])
    start, spin = Rotation.from_matrix(first.orientation[k]), first.angular_velocity[k]
    for _ in range(_ROUNDS):
        turned = Rotation.from_rotvec(spin * times[:, None])
        off = (measured * (turned * start).inv()).as_rotvec()
        # Turning the start by a and the spin by b turns the cube by R a + J b t later, J the rotation's left Jacobian.
        both = np.concatenate([turned.as_matrix(), _jacobians(spin * times[:, None]) * times[:, None, None]], axis=2)
        change, *_ = np.linalg.lstsq(both.reshape(-1, 6), off.reshape(-1))
        start, spin = Rotation.from_rotvec(change[:3]) * start, spin + change[3:]
    launch = place[0], place[1], start.as_matrix(), spin
    return launch, fallen - design @ place, off - (both @ change)


def _jacobians(vectors: Array) -> Array:
    """Return the left Jacobians of rotations by these vectors [rad], shape (K, 3): exp(v + d) = exp(J d) exp(v)."""
    square = np.maximum(np.square(vectors).sum(axis=1), 1e-12)[:, None, None]
    angle = np.sqrt(square)
    across = np.zeros((len(vectors), 3, 3))
    for k, (row, column) in enumerate(((2, 1), (0, 2), (1, 0))):
        across[:, row, column], across[:, column, row] = vectors[:, k], -vectors[:, k]
    first, second = (1 - np.cos(angle)) / square, (angle - np.sin(angle)) / (angle * square)
    return np.asarray(np.eye(3) + first * across + second * across @ across)


def _design(times: Array) -> Array:
    return np.column_stack([np.ones(len(times)), times])


def tracker_of(tosses: Tosses, gravity: float) -> Tracker:
    """Return the tracker's errors; raises InputError if no toss flies long enough to tell.

    gravity [m/s²].
    """
    first, places, turns, freedom, fitted = _first(tosses), 0.0, 0.0, 0, []
    for k, (part, count) in enumerate(zip(tosses.slices(), flight_counts(tosses), strict=True)):
        if count >= _FEWEST:
            (_, speed, _, spin), place, turn = _fitted(tosses, part, int(count), gravity, first, k)
            places, turns, freedom = places + np.sum(place**2), turns + np.sum(turn**2), freedom + 3 * (int(count) - 2)
            fitted.append([speed - first.velocity[k], spin - first.angular_velocity[k]])
    if not fitted:
        raise InputError(
            f"position: no toss flies for {_FEWEST} samples before it meets the board: allowed is at least one"
        )
    speed, spin = np.sqrt(np.square(fitted).mean(axis=(0, 2)))
    return Tracker(math.sqrt(places / freedom), math.sqrt(turns / freedom), float(speed), float(spin))


def perturbed(
    tosses: Tosses, found: Launches, source: str, tracker: Tracker, size: float, random: np.random.Generator
) -> Launches:
    """Return launches with errors as the tracker makes them, times a size [1], drawn anew.

    Those of a `flight` are as far off as a straight line through that many samples with independent errors is.
    """
    count = len(found.position)
    roots = np.zeros((count, 2, 2))
    roots[:, 0, 0] = roots[:, 1, 1] = 1.0
    places, turns = (tracker.position, tracker.velocity), (tracker.orientation, tracker.angular_velocity)
    scales = np.broadcast_to(np.array([places, turns]), (count, 2, 2)).copy()
    if source == "flight":
        for k, samples in enumerate(flight_counts(tosses)):
            if samples >= _FEWEST:
                design = _design(np.arange(samples) / tosses.rate)
                roots[k] = np.linalg.cholesky(np.linalg.inv(design.T @ design))
                scales[k] = [[tracker.position] * 2, [tracker.orientation] * 2]
    # (toss, place or turn, value or rate, axis)
    drawn = size * scales[..., None] * np.einsum("kab,kpbx->kpax", roots, random.standard_normal((count, 2, 2, 3)))
    turned = Rotation.from_rotvec(drawn[:, 1, 0]).as_matrix() @ found.orientation
    place, speed = found.position + drawn[:, 0, 0], found.velocity + drawn[:, 0, 1]
    return Launches(place, speed, turned, found.angular_velocity + drawn[:, 1, 1])

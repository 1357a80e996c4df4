"""How the faces of a die answer to its shape and to its load: three coefficients, with their errors.

For lengths of the axes ℓ_k (their product fixed, y_k their logarithms, which sum to zero) and offsets d_k of the centre
of mass over the sides, to second order in y and first in d, symmetry leaves

    p(pair k) ∝ exp(3/2 χ y_k + G y_k²),    p(face at +k)/p(face at −k) = exp(ψ d_k)

with p normalised over the three pairs: reflection makes pairs even in d, and an even function of the other two axes'
difference is one of y_k but for a factor that all pairs share. χ is then d ln p(end pair)/d ln(c/a) of a square box
(a, a, c) at the cube. χ and G are of one box with sides in the ratios e^−w : 1 : e^w, whose two outer pairs differ by
an odd function of w: ln(p_z/p_x) = 3χw + O(w³). ψ is the mean over three axes of a cube with an offset along each.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import NamedTuple

import numpy as np
import xarray as xr

from stiffdice.errors import InputError
from stiffdice.experiments.dice.axes import FACES, pairs_of
from stiffdice.experiments.dice.boxes import MODEL, SCHEME, Throwing, box_of, faces_up
from stiffdice.experiments.measuring import mapped, numbers, result
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene

_CHI = {
    "chi": ("d ln p(end pair)/d ln(c/a) of a square box, at the cube", "1"),
    "chi_error": ("standard error of chi", "1"),
    "curvature": ("G: of ln p(pair) in the square of the axis' logarithm", "1"),
    "curvature_error": ("standard error of the curvature", "1"),
}
_PSI = {
    "psi": ("d ln(p(face)/p(opposite face))/d(offset of the centre of mass towards the face, over the side)", "1"),
    "psi_error": ("standard error of psi", "1"),
}
_REST = {"unsettled": ("part of the throws that did not settle", "1")}
_NOTE = "body and ground are the experiment's, not the scene's; ground: level, gated"


class Found(NamedTuple):
    """Coefficients with standard errors; unsettled: the part of the throws that did not come to rest."""

    chi: float
    chi_error: float
    curvature: float
    curvature_error: float
    psi: float
    psi_error: float
    unsettled: float


def measure(
    scene: Scene,
    *,
    restitution: Sequence[float] = (0.3, 0.45, 0.6),
    friction: Sequence[float] = (0.1, 0.2, 0.3),
    stretch: float = 0.2,
    offset: float = 0.05,
    velocity_spread: float = 0.3,
    spin_spread: float = 30.0,
    contact_time: float = 1e-3,
    steps: int = 40_000,
    throws: int = 40_000,
    seed: int = 1,
) -> xr.Dataset:
    """Return χ, G and ψ with their errors, dimensions restitution and friction.

    scene: gives mass, volume, launch, gravity and duration; the ground is level. stretch [1]: w, of the box. offset
    [1]: of the loaded cube's centre of mass along each axis, over the side. throws: of each of the two bodies on each
    ground. The others as of `box-faces`. Raises InputError for a number out of range.
    """
    grounds = {"restitution": numbers("restitution", restitution, "1", above=0)}
    grounds["friction"] = numbers("friction", friction, "1", at_least=0)
    throwing = Throwing(velocity_spread, spin_spread, contact_time, steps, throws)
    seeds = iter(range(validation.count("seed", seed, at_least=0), 2**53))
    found = mapped(
        lambda e, mu: coefficients(scene, throwing, e, mu, next(seeds), stretch, offset),
        _CHI | _PSI | _REST,
        **grounds,
    )
    told = asdict(throwing) | {"stretch": stretch, "offset": offset, "scene_note": _NOTE}
    return result(found, "Faces of a die by shape and load", scene, MODEL, SCHEME, __name__, **told)


def launches(
    scene: Scene,
    *,
    speed: Sequence[float] = (0.0, 1.0, 3.0, 6.0),
    spin: Sequence[float] = (10.0, 30.0, 60.0, 100.0, 200.0),
    restitution: float = 0.45,
    friction: float = 0.2,
    stretch: float = 0.2,
    offset: float = 0.05,
    velocity_spread: float = 0.3,
    contact_time: float = 1e-3,
    steps: int = 30_000,
    throws: int = 20_000,
    seed: int = 1,
) -> xr.Dataset:
    """Return χ, G and ψ by how a die is launched, dimensions speed and spin.

    speed [m/s]: along the ground, in the mean. spin [rad/s]: standard deviation of each component. restitution,
    friction [1]: of the one ground. The others as of `face-response`. Raises InputError for a number out of range.
    """
    ways = {"speed": numbers("speed", speed, "m/s", at_least=0), "spin": numbers("spin", spin, "rad/s", at_least=0)}
    seeds = iter(range(validation.count("seed", seed, at_least=0), 2**53))

    def one(fast: float, turning: float) -> Found:
        thrown = replace(scene, launch=replace(scene.launch, velocity=(fast, 0.0, 0.0)))
        throwing = Throwing(velocity_spread, turning, contact_time, steps, throws)
        return coefficients(thrown, throwing, restitution, friction, next(seeds), stretch, offset)

    found = mapped(one, _CHI | _PSI | _REST, **ways)
    told = {"restitution": restitution, "friction": friction, "throws": throws, "steps": steps, "scene_note": _NOTE}
    return result(found, "Faces of a die by its launch", scene, MODEL, SCHEME, __name__, **told)


def checks(
    scene: Scene,
    *,
    restitution: float = 0.45,
    friction: float = 0.2,
    stretch: float = 0.2,
    offset: float = 0.05,
    velocity_spread: float = 0.3,
    spin_spread: float = 30.0,
    contact_time: float = 1e-3,
    steps: int = 40_000,
    throws: int = 60_000,
    seed: int = 1,
) -> xr.Dataset:
    """Return χ, G and ψ with one choice of `measure` changed at a time, dimension check; options as there.

    `as_measured`; half, twice and four times the step; half and twice the contact time, the former with half the step;
    half of stretch and offset, which says whether they are small enough. `square` takes χ of two square boxes with
    ln(c/a) = ± stretch/2, and of the cube between, which needs no throw: χ of a parabola through the three.
    Raises InputError for a number out of range.
    """
    throwing = Throwing(velocity_spread, spin_spread, contact_time, steps, throws)
    seeds = iter(range(validation.count("seed", seed, at_least=0), 2**53))
    variants = {
        "as_measured": (throwing, stretch, offset),
        "half_step": (replace(throwing, steps=2 * steps), stretch, offset),
        "double_step": (replace(throwing, steps=max(1, steps // 2)), stretch, offset),
        "fourfold_step": (replace(throwing, steps=max(1, steps // 4)), stretch, offset),
        "half_contact_time": (replace(throwing, contact_time=contact_time / 2, steps=2 * steps), stretch, offset),
        "double_contact_time": (replace(throwing, contact_time=2 * contact_time), stretch, offset),
        "half_size": (throwing, stretch / 2, offset / 2),
        "square": (throwing, stretch / 2, offset),
    }

    def one(name: str) -> Found:
        how, wide, off = variants[name]
        found = coefficients(scene, how, restitution, friction, next(seeds), wide, off)
        if name == "square":
            chi, error = _of_squares(scene, how, restitution, friction, next(seeds), wide)
            return found._replace(chi=chi, chi_error=error, curvature=math.nan, curvature_error=math.nan)
        return found

    found = mapped(one, _CHI | _PSI | _REST, check=list(variants))
    told = {"restitution": restitution, "friction": friction} | asdict(throwing)
    told |= {"stretch": stretch, "offset": offset, "scene_note": _NOTE}
    return result(found, "Faces of a die, checked", scene, MODEL, SCHEME, __name__, **told)


def coefficients(
    scene: Scene, throwing: Throwing, restitution: float, friction: float, seed: int, stretch: float, offset: float
) -> Found:
    """Return the coefficients on one ground, from as many throws of a box as of a loaded cube.

    Raises InputError for a stretch or an offset that is none, and for so few throws that a face never comes up.
    """
    validation.number("stretch", stretch, "1", above=0)
    validation.number("offset", offset, "1", above=0)
    time = throwing.contact_time
    box = box_of(scene, restitution, friction, time, stretch=(-stretch, 0.0, stretch))
    loaded = box_of(scene, restitution, friction, time, offset=(offset,) * 3)
    # The seed of the second is of another sequence than those of the first of other grounds.
    of_box, lost = faces_up(box, throwing, 2 * seed)
    of_loaded, more = faces_up(loaded, throwing, 2 * seed + 1)
    x, y, z = pairs_of(of_box)
    up, down = (np.array([of_loaded[pair[k] - 1] for pair in FACES], dtype=np.float64) for k in range(2))
    if min(x, y, z, *up, *down) == 0:
        raise InputError(f"throws = {throwing.throws}: a face never comes up; allowed are more throws")
    return Found(
        math.log(z / x) / (3 * stretch),
        math.sqrt(1 / x + 1 / z) / (3 * stretch),
        math.log(x * z / (y * y)) / (2 * stretch**2),
        math.sqrt((1 / x + 1 / z) / 4 + 1 / y) / stretch**2,
        float(np.log(up / down).mean() / offset),
        float(np.sqrt((1 / up + 1 / down).sum()) / 3 / offset),
        (lost + more) / (2 * throwing.throws),
    )


def _of_squares(
    scene: Scene, throwing: Throwing, restitution: float, friction: float, seed: int, wide: float
) -> tuple[float, float]:
    """Return χ and its error from square boxes with ln(c/a) = ± wide; the parabola's slope is that of its chord."""
    logs, variances = [], []
    for sign in (-1.0, 1.0):
        box = box_of(scene, restitution, friction, throwing.contact_time, stretch=(0.0, 0.0, sign * wide))
        pairs = pairs_of(faces_up(box, throwing, 2 * seed + (sign > 0))[0])
        p = float(pairs[2] / pairs.sum())
        logs.append(math.log(p))
        variances.append((1 - p) / (p * pairs.sum()))
    return (logs[1] - logs[0]) / (2 * wide), math.sqrt(sum(variances)) / (2 * wide)

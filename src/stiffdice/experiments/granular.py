"""The longest steps of spheres in contact: as codes for granular matter bound them, by theory, and as measured.

A sphere of mass m and radius R feels another by F = k δ (linear) or F = 4/3 E* √R* δ^(3/2) (Hertz), δ their overlap,
without tension; here without damping and friction. The scheme is the paper's, which such codes use, too: symplectic
Euler takes the places of leapfrog. It is linearly stable for ωh < 2, ω the largest of the packing; k is the slope of
the force where it stands, and steps are told in √(m/k).

- YADE, `GlobalStiffnessTimeStepper` (its documentation, DEM formulation, stability considerations): h < √2 √(m/K),
  K the largest diagonal term of a particle's Σ k n nᵀ;
- exaDEM, `check_dt_critical` (Collab4exaNBody/exaDEM, issue 139 and pull request 143): h < π √(min m/max k);
- LIGGGHTS, `fix check/timestep/gran` (its manual): a part of the Rayleigh time π R √(ρ/G)/(0.1631 ν + 0.8766), and of
  the duration of a Hertz impact, 2.87 (m*²/(R* E*² v))^(1/5).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import bisected, mapped, numbers, result
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene

# By force: the power of the overlap.
FORCES = {"linear": 1.0, "hertz": 1.5}

# Of a packing under pressure: the overlap over the distance at touch, and the nudges over the overlap.
_PRESSED, _NUDGE = 1e-5, 1e-3
# Unstable: nudges have grown by so much in so many steps. A hundredth of a percent beyond the limit is enough.
_GROWN, _STEPS = 100.0, 300
_EXADEM = math.pi

SCHEME = "symplectic_euler"

# Packings whose stable steps are put beside LIGGGHTS' times.
_BEADS = ("pair", "face_centred")

# Steps of an impact over its duration: 0.1 and 0.2 are what manuals recommend, √2 what exaDEM's rule allows of a pair.
_FRACTIONS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.2, math.sqrt(2))


class Packing(NamedTuple):
    """Spheres that touch, the distance of two being one.

    places: shape (sphere, 3). pairs: which touch, shape (contact, 2). shifts: of the second's image, shape
    (contact, 3). held: those that do not move.
    """

    places: Array
    pairs: npt.NDArray[np.int64]
    shifts: Array
    held: npt.NDArray[np.bool_]


def _row(count: int, held: Sequence[int]) -> Packing:
    places = np.arange(count, dtype=float)[:, None] * np.array([1.0, 0.0, 0.0])
    pairs = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    return Packing(places, pairs, np.zeros((count - 1, 3)), np.isin(np.arange(count), held))


def _lattice(basis: Sequence[Sequence[float]], cells: int) -> Packing:
    """Return a packing without an end: so many cells a side, spheres of a cell at places in its side."""
    side = 1.0 / min(math.dist(basis[0], other) for other in (*basis[1:], (1.0, 0.0, 0.0)))
    corners = np.stack(np.meshgrid(*[np.arange(cells)] * 3, indexing="ij"), axis=-1).reshape(-1, 1, 3)
    places, period = side * (corners + np.array(basis)).reshape(-1, 3), side * cells
    apart = places[None] - places[:, None]
    shifts = -period * np.round(apart / period)
    near = np.triu(np.abs(np.linalg.norm(apart + shifts, axis=-1) - 1.0) < 1e-9, 1)
    first, second = np.nonzero(near)
    pairs = np.column_stack([first, second])
    return Packing(places, pairs, shifts[first, second], np.zeros(len(places), bool))


_FACE_CENTRED = ((0.0, 0.0, 0.0), (0.5, 0.5, 0.0), (0.5, 0.0, 0.5), (0.0, 0.5, 0.5))
# By name: a pair; a sphere between two that are held; a row; 6 and 12 neighbours each. Even numbers of cells have the
# fastest mode, neighbours against each other.
PACKINGS = {
    "pair": _row(2, ()),
    "between_walls": _row(3, (0, 2)),
    "row": _row(60, (0, 59)),
    "cubic": _lattice(_FACE_CENTRED[:1], 4),
    "face_centred": _lattice(_FACE_CENTRED, 4),
}


def directions(packing: Packing) -> Array:
    """Return the direction from the first to the second sphere of each contact, shape (contact, 3)."""
    return packing.places[packing.pairs[:, 1]] + packing.shifts - packing.places[packing.pairs[:, 0]]


def largest_square(packing: Packing) -> float:
    """Return the largest ω² of a packing [k/m]: an eigenvalue of the matrix of its springs, pressure left out."""
    free = np.flatnonzero(~packing.held)
    matrix = np.zeros((len(packing.places), 3, len(packing.places), 3))
    for (i, j), n in zip(packing.pairs, directions(packing), strict=True):
        spring = np.outer(n, n)
        matrix[i, :, i] += spring
        matrix[j, :, j] += spring
        matrix[i, :, j] -= spring
        matrix[j, :, i] -= spring
    size = 3 * len(free)
    return float(np.linalg.eigvalsh(matrix[free][:, :, free].reshape(size, size))[-1])


def yade_step(packing: Packing) -> float:
    """Return YADE's longest step [√(m/k)]: √2 √(m/K), K the largest diagonal term of a sphere's stiffness."""
    stiffness = np.zeros_like(packing.places)
    for k in (0, 1):
        np.add.at(stiffness, packing.pairs[:, k], directions(packing) ** 2)
    return math.sqrt(2 / stiffness[~packing.held].max())


@njit(cache=True)
def _advance(
    places: Array,
    moves: Array,
    pairs: Array,
    shifts: Array,
    held: Array,
    power: float,
    pressed: float,
    h: float,
    n: int,
) -> float:
    """Take so many steps of a packing, in units of m, k and the distance at touch; return the largest |move| in it."""
    speeds, start, largest = np.zeros_like(places), places - moves, 0.0
    for _ in range(n):
        for c in range(len(pairs)):
            i, j = pairs[c]
            apart = places[j] + shifts[c] - places[i]
            distance = math.sqrt(apart[0] ** 2 + apart[1] ** 2 + apart[2] ** 2)
            # The slope is one at the overlap under pressure, and that force is balanced from outside.
            overlap = max(0.0, 1.0 - distance) / pressed
            push = pressed / power * (overlap**power - 1.0) * h / distance
            for axis in range(3):
                speeds[i, axis] -= push * apart[axis]
                speeds[j, axis] += push * apart[axis]
        for i in range(len(places)):
            for axis in range(3):
                if held[i]:
                    speeds[i, axis] = 0.0
                places[i, axis] += h * speeds[i, axis]
                largest = max(largest, abs(places[i, axis] - start[i, axis]))
    return largest


def _grows(packing: Packing, force: str, h: float) -> bool:
    """Return whether nudges to a packing under pressure grow at steps of h [√(m/k)]."""
    nudges = np.random.default_rng(0).uniform(-1, 1, packing.places.shape) * _PRESSED * _NUDGE
    nudges[packing.held] = 0.0
    if not packing.held.any():
        nudges -= nudges.mean(axis=0)
    shrunk = 1.0 - _PRESSED
    arrays = shrunk * packing.places + nudges, nudges, packing.pairs, shrunk * packing.shifts, packing.held
    return bool(_advance(*arrays, FORCES[force], _PRESSED, h, _STEPS) > _GROWN * np.abs(nudges).max())


def _limit(name: str, force: str) -> list[float]:
    return [bisected(lambda h: not _grows(PACKINGS[name], force, h), 0.1, 4.0, relative=1e-4)[0]]


def steps(scene: Scene) -> xr.Dataset:
    """Return the longest stable steps of packings [√(m/k)], dimensions packing and force: theory, rules, measured.

    scene: named in the file only, as all is told in √(m/k).
    """
    limits = mapped(
        _limit,
        {"measured": ("longest step at which nudges do not grow, over sqrt(m/k)", "1")},
        packing=PACKINGS,
        force=FORCES,
    )
    rules = mapped(
        lambda name: [2 / math.sqrt(largest_square(PACKINGS[name])), yade_step(PACKINGS[name]), _EXADEM],
        {
            "theory": ("2/omega over sqrt(m/k), omega the largest of the packing", "1"),
            "yade": ("longest step by YADE's rule, over sqrt(m/k)", "1"),
            "exadem": ("longest step by exaDEM's rule, over sqrt(m/k)", "1"),
        },
        packing=PACKINGS,
    )
    return result({**limits, **rules}, "Longest steps of packings", scene, "case", SCHEME, __name__)


def duration(force: str) -> float:
    """Return how long an impact lasts, in units of the depth it reaches over its speed: π, or for Hertz 2.94."""
    power = FORCES[force]
    # 2 ∫ dx/√(1 − x^(p + 1)) from 0 to 1, p the power.
    part = 1 / (power + 1)
    return 2 * math.sqrt(math.pi) * part * math.gamma(part) / math.gamma(part + 0.5)


def restitutions(force: str, h: float, phases: int) -> Array:
    """Return speed out over speed in of an impact at steps of h, in units of its duration; shape (phase,).

    The impact begins so many parts of a step before the spheres touch. Depth in units of the deepest, speed of the
    approach: δ'' = −(p + 1)/2 δ^p. Not-a-number where the spheres are past each other: deeper than a thousand times.
    """
    power, step = FORCES[force], h * duration(force) / 2
    depth = -step * (np.arange(phases) + 0.5) / phases
    speed, out = np.ones(phases), np.full(phases, np.nan)
    touched = np.zeros(phases, bool)
    for _ in range(math.ceil(4 / h) + 4):
        inside = depth > 0
        touched |= inside
        speed = speed - step * (power + 1) / 2 * np.maximum(depth, 0.0) ** power
        depth = depth + step * speed
        left = touched & (depth <= 0) & (speed < 0) & np.isnan(out)
        out[left] = -speed[left]
    return out


def impacts(scene: Scene, *, step: Sequence[float] = _FRACTIONS, phases: int = 64) -> xr.Dataset:
    """Return the least and the largest restitution of an undamped impact by its steps, dimensions force and part.

    step: over the duration of the impact. phases: of the step when the spheres touch. scene: named in the file only.
    Raises InputError for a number out of range.
    """
    parts = numbers("step", step, "1", above=0)
    phases = validation.count("phases", phases)

    def ends(force: str, part: float) -> list[float]:
        found = restitutions(force, part, phases)
        return [float(found.min()), float(found.max())]

    described = {
        "least": ("least speed out over speed in, over the phases of the first step in contact", "1"),
        "largest": ("largest speed out over speed in", "1"),
    }
    found = mapped(ends, described, force=FORCES, part=parts)
    return result(found, "Restitution of undamped impacts", scene, "case", SCHEME, __name__, phases=phases)


def rayleigh_time(radius: float, density: float, young: float, poisson: float) -> float:
    """Return the Rayleigh time [s] of a sphere: radius [m], density [kg/m³], Young's modulus [Pa], Poisson's ratio."""
    shear = young / (2 * (1 + poisson))
    return math.pi * radius * math.sqrt(density / shear) / (0.1631 * poisson + 0.8766)


class Impact(NamedTuple):
    """A Hertz impact of two equal spheres: its duration [s], the deepest overlap [m], the slope there [N/m]."""

    duration: float
    depth: float
    slope: float


def hertz_impact(radius: float, density: float, young: float, poisson: float, speed: float) -> Impact:
    """Return the impact of two equal spheres that approach at a speed [m/s] (Johnson, Contact Mechanics, 11.4)."""
    mass = 2 / 3 * math.pi * radius**3 * density  # half of a sphere's
    modulus, curvature = young / (2 * (1 - poisson**2)), radius / 2
    depth = (15 * mass * speed**2 / (16 * math.sqrt(curvature) * modulus)) ** 0.4
    return Impact(duration("hertz") * depth / speed, depth, 2 * modulus * math.sqrt(curvature * depth))


def beads(
    scene: Scene,
    *,
    young: Sequence[float] = (5e6, 5e7, 5e8, 7e10),
    speed: Sequence[float] = (0.1, 1.0, 10.0),
    radius: float = 1e-3,
    density: float = 2500.0,
    poisson: float = 0.25,
) -> xr.Dataset:
    """Return LIGGGHTS' times of equal spheres, and the longest stable steps at an impact's deepest overlap [s].

    young [Pa], radius [m], density [kg/m³], poisson [1]: of the spheres. speed [m/s]: at which they meet. Dimensions
    young and speed. scene: named in the file only. Raises InputError for a number out of range.
    """
    moduli, speeds = numbers("young", young, "Pa", above=0), numbers("speed", speed, "m/s", above=0)
    size = validation.number("radius", radius, "m", above=0)
    heavy = validation.number("density", density, "kg/m³", above=0)
    ratio = validation.number("poisson", poisson, "1", at_least=0)
    mass = 4 / 3 * math.pi * size**3 * heavy

    def times(modulus: float, fast: float) -> list[float]:
        impact = hertz_impact(size, heavy, modulus, ratio, fast)
        stable = [2 * math.sqrt(mass / (impact.slope * largest_square(PACKINGS[name]))) for name in _BEADS]
        return [rayleigh_time(size, heavy, modulus, ratio), impact.duration, impact.depth, *stable]

    described = {
        "rayleigh": ("Rayleigh time", "s"),
        "hertz": ("duration of an impact", "s"),
        "depth": ("deepest overlap of an impact", "m"),
        **{f"stable_{name}": (f"longest stable step at that overlap, {name}", "s") for name in _BEADS},
    }
    found = mapped(times, described, young=moduli, speed=speeds)
    told = {"radius": size, "density": heavy, "poisson": ratio}
    return result(found, "LIGGGHTS' times of spheres", scene, "case", SCHEME, __name__, **told)

"""What the literature says of the faces of a square box (a, a, c): formulas without dynamics.

Each gives the probability of the two square ends together, by c/a.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.state import Array

# Of a difference quotient at the cube, in ln(c/a).
_NEAR = 1e-4
# Of β, by which a box that is 1 % too long comes up on its ends a third as often.
_LARGEST = 200.0


def solid_angle(aspect: npt.ArrayLike) -> Array:
    """Return the part of all directions that the two ends take up, seen from the centre.

    The face below the centre of a box of random orientation: p = (2/π) arctan(a²/(c √(2a² + c²))). Proposed by
    D. Singmaster, Mathematical Gazette 65 (1981) 208, and by others before. aspect [1]: c/a.
    """
    c = np.asarray(aspect, dtype=np.float64)
    return np.asarray(2 / np.pi * np.arctan(1 / (c * np.sqrt(2 + c * c))))


def gibbs(aspect: npt.ArrayLike, beta: float) -> Array:
    """Return a Gibbs distribution over the six faces: p_i ∝ exp(−β h_i/V^(1/3)), h_i the height of the centre at rest.

    W. Riemer, D. Stoyan, D. Obreschkow, "Cuboidal Dice and Gibbs Distributions", Metrika 77 (2014) 247
    (arXiv:1302.3925): one parameter stands for all physical conditions. Their scale of the energy could not be looked
    up; here it is m g times the cube root of the volume, which only renames β where the volume is fixed.
    """
    r = np.exp(beta * energy_gap(aspect))
    return np.asarray(r / (r + 2))


def energy_gap(aspect: npt.ArrayLike) -> Array:
    """Return how much lower the centre is on an end than on a side: (a − c)/2, over the cube root of the volume."""
    c = np.asarray(aspect, dtype=np.float64)
    return np.asarray((1 - c) / 2 * c ** (-1 / 3))


def fitted_beta(aspect: npt.ArrayLike, ends: Array, throws: Array) -> float:
    """Return the β of `gibbs` under which counts of ends are likeliest, within ± `_LARGEST`; all arrays of one shape.

    The derivative of the likelihood falls with β, so that halving finds where it is zero. Zero if all are cubes.
    """
    gap, low, high = energy_gap(aspect), -_LARGEST, _LARGEST
    for _ in range(60):
        beta = (low + high) / 2
        score = float((gap * (ends - throws * gibbs(aspect, beta))).sum())
        if score == 0:
            return beta
        low, high = (beta, high) if score > 0 else (low, beta)
    return (low + high) / 2


def pender_uhrin(aspect: npt.ArrayLike) -> Array:
    """Return what the formula for two dimensions says, each pair of sides beside the ends as in a plane of its own.

    Of a rectangle with sides k and l, p_l/p_k = (R − k)/(R − l) · arctan(l/k)/arctan(k/l), R = √(k² + l²): G. Pender
    and M. Uhrin, "Predicting Non-Square 2D Dice Probabilities", arXiv:1407.6307, from energy lost at random while the
    die rolls through many turns. Here k = c and l = a; the step to three dimensions, p = r/(r + 2), is ours.
    """
    c = np.asarray(aspect, dtype=np.float64)
    diagonal = np.hypot(1, c)
    r = (diagonal - c) / (diagonal - 1) * np.arctan(1 / c) / np.arctan(c)
    return np.asarray(r / (r + 2))


def slope(ends: Array) -> float:
    """Return χ = d ln p/d ln(c/a), for p at the two places `NEAR_CUBE`."""
    return float(np.log(ends[1] / ends[0]) / (2 * _NEAR))


NEAR_CUBE = np.exp([-_NEAR, _NEAR])

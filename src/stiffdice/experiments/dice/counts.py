"""Counts of faces: shares with their intervals, and whether a fair die would give them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from stiffdice.scene import die
from stiffdice.scene.die import Array

Counts = npt.NDArray[np.int64]

# Standard deviations of a normal distribution that hold 95 %.
_Z95 = 1.959963984540054


def counted(faces: npt.NDArray[np.int8], decided: npt.NDArray[np.bool_]) -> Counts:
    """Return how often each face was up, shape (6,), of the throws that were decided."""
    return np.bincount(faces[decided], minlength=len(die.FACES) + 1)[1:].astype(np.int64)


def intervals(counts: Counts) -> tuple[Array, Array]:
    """Return both ends of the 95 % interval of each face's probability, shape (face,) each.

    Wilson 1927, J. Am. Stat. Assoc. 22, 209.
    """
    total = counts.sum()
    share, z = counts / total, _Z95
    middle = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * np.sqrt(share * (1 - share) / total + z * z / (4 * total * total))
    return middle - half, middle + half


def chi_square(counts: Counts) -> tuple[float, float]:
    """Return Pearson's chi-square against a fair die, and the probability of one as large (five degrees of freedom)."""
    expected = counts.sum() / len(counts)
    value = float(((counts - expected) ** 2).sum() / expected)
    tail = math.erfc(math.sqrt(value / 2)) + math.sqrt(2 * value / math.pi) * math.exp(-value / 2) * (1 + value / 3)
    return value, min(1.0, tail)


def total_variation(a: Counts, b: Counts) -> float:
    """Return half the sum of the differences of two face distributions, of their counts [1]."""
    return float(np.abs(a / a.sum() - b / b.sum()).sum() / 2)


def sampling_distance(p: Array, a: int, b: int, *, draws: int = 4000, quantile: float = 0.95) -> tuple[float, float]:
    """Return mean and quantile of the total variation between samples of a and b throws of one distribution.

    p: of the faces, shape (6,). Drawn with a fixed seed: sampling alone makes two distributions so different.
    """
    random = np.random.default_rng(6)
    first, second = random.multinomial(a, p, draws) / a, random.multinomial(b, p, draws) / b
    distances = np.abs(first - second).sum(axis=1) / 2
    return float(distances.mean()), float(np.quantile(distances, quantile))

"""What counts of faces say of a die: lengths of its axes and its centre of mass, with a posterior.

The response (`response`) has five numbers for the five free probabilities of six faces, so each set of probabilities is
one die. Rolls are multinomial; Jeffreys' prior of the probabilities is a Dirichlet distribution with ½ each, and since
that prior does not depend on the parameters, it is also the one of lengths and offsets. So the posterior is sampled
without a chain: probabilities from a Dirichlet distribution with the counts plus ½, and for each sample a way of
throwing, a ground (restitution and friction uniform over what was measured) and coefficients within their errors, by
which the probabilities become a die. What is not known of the throw is so carried through.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from stiffdice.experiments.dice.axes import FACES, Array
from stiffdice.experiments.dice.response_table import COEFFICIENTS, Table
from stiffdice.experiments.dice.rolls import Rolls

SAMPLES = 50_000
# Of the posterior, between the two quantiles that are told.
LEVEL = 0.95
_TURNS = 30


@dataclass(frozen=True)
class Posterior:
    """Samples of the posterior, first dimension: the sample; second: the axis, by `boxes.PAIRS`.

    length [1]: of an axis over the geometric mean of the two others, less one. offset [1]: of the centre of mass
    towards the lower number of pips on each axis, over the side. beyond: the part of the samples whose shape is beyond
    those that were thrown. throw: index of the table. chi, psi: coefficients.
    """

    length: Array
    offset: Array
    beyond: float
    throw: npt.NDArray[np.int64]
    chi: Array
    psi: Array


def posterior(given: Rolls, tables: Sequence[Table], samples: int = SAMPLES, seed: int = 0) -> Posterior:
    """Return samples of the posterior of a die from counts of its faces. tables: ways of throwing, each as likely."""
    random = np.random.default_rng(seed)
    p = random.dirichlet(np.array(given.counts) + 0.5, samples)
    throw = random.integers(len(tables), size=samples)
    coefficients = {name: np.empty(samples) for name in COEFFICIENTS}
    for index, table in enumerate(tables):
        mine = throw == index
        e, mu = (random.uniform(grid[0], grid[-1], mine.sum()) for grid in (table.restitution, table.friction))
        there = table.at(e, mu)
        for name, values in coefficients.items():
            values[mine] = there[name] + there[f"{name}_error"] * random.standard_normal(mine.sum())
    chi, curvature, psi = (coefficients[name] for name in COEFFICIENTS)
    towards, opposite = (np.stack([p[:, pair[k] - 1] for pair in FACES], axis=1) for k in range(2))
    y = shape_of(towards + opposite, chi, curvature)
    stretch = np.array([table.stretch for table in tables])[throw]
    beyond = float((np.abs(y).max(axis=1) > stretch).mean())
    offset = np.log(towards / opposite) / psi[:, None]
    return Posterior(np.exp(1.5 * y) - 1, offset, beyond, throw, chi, psi)


def shape_of(pairs: Array, chi: Array, curvature: Array) -> Array:
    """Return logarithms of the axes' lengths, which sum to zero, from probabilities of the pairs, shape (sample, 3).

    Solves 3/2 χ y_k + G y_k² = ln p_k + a constant by iteration. As far as the response was measured this converges;
    steps beyond twice that far are cut.
    """
    logs = np.log(pairs)
    logs -= logs.mean(axis=1, keepdims=True)
    y = np.zeros_like(logs)
    for _ in range(_TURNS):
        bent = curvature[:, None] * y * y
        y = np.clip((logs - bent + bent.mean(axis=1, keepdims=True)) / (1.5 * chi[:, None]), -0.4, 0.4)
    return y


def interval(samples: Array) -> tuple[float, float, float]:
    """Return the median and the ends of the central interval of `LEVEL`."""
    low, middle, high = np.quantile(samples, [(1 - LEVEL) / 2, 0.5, (1 + LEVEL) / 2])
    return float(middle), float(low), float(high)


def longest(given: Rolls) -> tuple[int, float]:
    """Return the index of the longest axis, and by how many standard errors it is longer than the next.

    The longest axis is that whose faces come up least, whatever the coefficients are: the errors are those of the
    counts alone.
    """
    pairs = np.array([given.counts[a - 1] + given.counts[b - 1] for a, b in FACES]) + 1.0
    least, following, _ = np.argsort(pairs, kind="stable")
    gap = math.log(pairs[following] / pairs[least]) / math.sqrt(1 / pairs[following] + 1 / pairs[least])
    return int(least), float(gap)

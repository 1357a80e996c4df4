"""What accuracy costs: from the errors and costs along a method's ladder of efforts to the cost of an error."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.experiments.work_precision.measure import fixed_step
from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.methods import name_of
from stiffdice.report.number_format import duration, readable
from stiffdice.simulation.engines.registry import PEERS, SOLVERS

# The errors to which costs are told.
ERRORS = (1e-2, 1e-3, 1e-6)

# A ladder is continued by its last rungs, if there are so many below this error, and not farther than so many times its
# last cost.
_RUNGS, _BELOW, _FARTHEST = 4, 0.3, 1e4


class Cost(NamedTuple):
    """The cost from which on an error stays below a bound; reached, or continued from where the ladder ends.

    NaN: neither the ladder nor its continuation says; then it is more than `tried`, the ladder's last.
    """

    value: float
    reached: bool
    tried: float


def cost_of(errors: Array, costs: Array, bound: float, *, continued: bool) -> Cost:
    """Return what it costs to come below an error and stay there, along a ladder from the least effort on.

    Between two rungs it is interpolated in the logarithms. A curve that comes and goes counts from where it stays.
    continued: whether a ladder that ends before may be continued along its last rungs (least squares), as is right for
    a scheme of fixed step that was not driven on for want of time. Rungs without a cost are left out; one whose error
    is not a number counts as off.
    """
    known = np.isfinite(costs) & (costs > 0)
    errors, costs = np.where(np.isnan(errors), np.inf, errors)[known], costs[known]
    if not errors.size:
        return Cost(math.nan, False, math.nan)
    off = np.flatnonzero(~(errors <= bound))
    last = float(costs[-1])
    if not off.size:
        return Cost(float(costs[0]), True, last)
    k = int(off[-1])
    if k + 1 < len(errors):
        if not np.isfinite(errors[k]) or errors[k + 1] == 0:
            return Cost(float(costs[k + 1]), True, last)
        share = math.log(errors[k] / bound) / math.log(errors[k] / errors[k + 1])
        return Cost(math.exp(math.log(costs[k]) + share * math.log(costs[k + 1] / costs[k])), True, last)
    return Cost(_continued(errors, costs, bound) if continued else math.nan, False, last)


def _continued(errors: Array, costs: Array, bound: float) -> float:
    """Return the cost on the power law through the last rungs, NaN if they show none."""
    x, y = np.log(costs[-_RUNGS:]), np.log(errors[-_RUNGS:])
    if len(x) < _RUNGS or not (errors[-_RUNGS:] < _BELOW).all():
        return math.nan
    slope = float(np.polyfit(x, y, 1)[0])
    if slope > -0.5:  # no scheme is of less than first order; contacts may hide half of it
        return math.nan
    value = float(costs[-1]) * (float(errors[-1]) / bound) ** (-1 / slope)
    return value if value <= _FARTHEST * costs[-1] else math.nan


def seconds_of(found: xr.Dataset, timed: xr.Dataset) -> tuple[Array, Array]:
    """Return the wall time of each rung of an experiment [s], and whether it was timed itself; shapes as `evaluations`.

    A fixed step's is its time per step times the steps. NaN where nobody knows.
    """
    measured = {rung: timed.seconds.values[place] for place, rung in _rungs(timed)}
    per_step = {rung[:2]: timed.seconds_per_step.values[place[:2]] for place, rung in _rungs(timed)}
    seconds = np.full(found.evaluations.shape, np.nan)
    itself = np.zeros(seconds.shape, bool)
    for place, rung in _rungs(found):
        if found.evaluations.values[place] > 0:
            itself[place] = np.isfinite(measured.get(rung, np.nan))
            seconds[place] = measured[rung] if itself[place] else rung[2] * per_step.get(rung[:2], np.nan)
    return seconds, itself


def _rungs(data: xr.Dataset) -> Iterator[tuple[tuple[int, ...], tuple[float, str, int, str]]]:
    """Yield the place of each rung, and its stiffness, method, steps and tolerance."""
    names, stiffness = meanings_of(data.method), data.stiffness.values.tolist()
    steps, tolerances = data.steps.values, data.tolerance.values
    for place in np.ndindex(steps.shape):
        yield place, (stiffness[place[0]], names[place[1]], int(steps[place]), f"{tolerances[place]:.6g}")


class Found(NamedTuple):
    """What was found of a problem: its errors and evaluations, and if it was timed its seconds, as `seconds_of`."""

    data: xr.Dataset
    seconds: Array | None
    itself: Array | None

    @property
    def problem(self) -> str:
        """The problem's name in PROBLEMS."""
        return str(self.data.attrs["problem"])

    @property
    def methods(self) -> list[str]:
        """The names of the methods tried."""
        return meanings_of(self.data.method)

    def cost(self, method: str, stiffness: int, measure: str, bound: float, *, timed: bool) -> Cost:
        """Return what a method costs on ground number `stiffness` to an error by a measure: evaluations, or seconds."""
        costs = self.seconds if timed else self.data.evaluations.values
        assert costs is not None
        k = self.methods.index(method)
        rungs = self.data.evaluations.values[stiffness, k] > 0
        return cost_of(
            self.data[f"{measure}_error"].values[stiffness, k][rungs],
            np.asarray(costs[stiffness, k][rungs], float),
            bound,
            continued=fixed_step(method),
        )


def found_in(data: Iterable[xr.Dataset]) -> list[Found]:
    """Return experiments with the timings of their problems, in the experiments' order.

    Raises InputError for a timing of a problem that no experiment is of.
    """
    data = list(data)
    timed = {str(part.attrs["problem"]): part for part in data if "seconds" in part}
    found = []
    for part in data:
        if "seconds" not in part:
            timing = timed.pop(str(part.attrs["problem"]), None)
            found.append(Found(part, *((None, None) if timing is None else seconds_of(part, timing))))
    if timed:
        raise InputError(f"timings of {', '.join(timed)}: needs an experiment of the same problem")
    return found


def best(found: Found, methods: Sequence[str], stiffness: int, bound: float, *, timed: bool) -> tuple[str, float]:
    """Return the method that reaches an error of the position at the least cost, and it; ("", NaN) if none does."""
    tried = [name for name in methods if name in found.methods]
    costs = {name: found.cost(name, stiffness, "position", bound, timed=timed) for name in tried}
    reached = {name: cost.value for name, cost in costs.items() if cost.reached}
    name = min(reached, key=lambda key: reached[key], default="")
    return name, reached.get(name, math.nan)


def table(data: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return for each problem, ground and error of the position which scheme is cheapest, and SciPy's best beside."""
    rows = []
    for found in found_in(data.values()):
        for stiffness, bound in ((i, bound) for i in range(found.data.sizes["stiffness"]) for bound in ERRORS):
            row = [PROBLEMS[found.problem].name, readable(float(found.data.stiffness[stiffness])), f"{bound:g}"]
            for timed in (False, True) if found.seconds is not None else (False,):
                row += _compared(found, stiffness, bound, timed=timed)
            rows.append([*row, *[""] * (9 - len(row))])
    columns = ["problem", "S [kg/s²]", "error [r]"]
    for what in ("evaluations", "time"):
        columns += [f"least {what}", f"SciPy's best {what}", f"ratio of {what}"]
    return rendered(title, columns, rows, _NOTE)


_NOTE = (
    "Error: root mean square distance of the centre from the reference, in radii; the cost is the least from which on "
    "it stays below. Only what was reached is listed. Evaluations are of the force, in plain stepping; times are "
    "medians of warm runs."
)


def _compared(found: Found, stiffness: int, bound: float, *, timed: bool) -> list[str]:
    schemes = [name for name in found.methods if name not in PEERS]
    both = [best(found, methods, stiffness, bound, timed=timed) for methods in (schemes, list(SOLVERS))]
    (_, ours), (_, theirs) = both
    return [
        *(
            f"{duration(cost) if timed else f'{cost:,.0f}'} ({name_of(name)})" if name else "none reaches it"
            for name, cost in both
        ),
        f"{theirs / ours:.3g}" if ours and math.isfinite(theirs / ours) else "—",
    ]


# Problem, our scheme, error, whether in time; what was aimed at: growth over S, and SciPy's best over it.
_AIMS = (
    ("tumbling-throw", "event", 1e-6, False, "at most 1.5", ""),
    ("tumbling-throw", "event", 1e-6, True, "at most 1.5", "at least 50"),
    ("flat-bounce", "exact", 1e-6, True, None, "at least 500"),
    ("flat-bounce", "exact", 1e-9, True, None, "at least 500"),
)


def targets(data: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return what was aimed at and what is reached, ratios of one run each."""
    problems = {part.problem: part for part in found_in(data.values())}
    rows: list[list[str]] = []
    for problem, scheme, bound, timed, growth, ratio in _AIMS:
        found = problems.get(problem)
        if found is None or scheme not in found.methods or (timed and found.seconds is None):
            continue
        what, grounds = "time" if timed else "evaluations", range(found.data.sizes["stiffness"])
        ours, theirs = (
            np.array([best(found, methods, ground, bound, timed=timed)[1] for ground in grounds])
            for methods in ([scheme], list(SOLVERS))
        )
        of = f"{scheme}, {PROBLEMS[problem].name} to {bound:g}:"
        if growth is not None:
            rows.append([f"{of} growth of {what} over S", growth, "", _reached(ours.max() / ours[0])])
        ratios = theirs / ours
        ends = (np.fmin.reduce(ratios), np.fmax.reduce(ratios))
        rows.append([f"{of} SciPy's best over it, in {what}", ratio, *map(_reached, ends)])
    return rendered(title, ["ratio", "aimed at", "least over S", "most over S"], rows, _NOTE)


def _reached(ratio: float) -> str:
    return "not reached" if math.isnan(ratio) else f"{ratio:.3g}"

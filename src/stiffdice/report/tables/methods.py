"""Methods compared: what an error costs by each, and engines' contacts, longest steps and speeds."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.experiments.engines import OUTCOMES, RATIOS
from stiffdice.experiments.work_precision.measure import fixed_step
from stiffdice.experiments.work_precision.problems import PROBLEMS
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.number_format import duration, ground_words, readable, scene_of
from stiffdice.simulation.engines.registry import ENGINES, METHODS, PEERS, SOLVERS

# The errors to which costs are told.
ERRORS = (1e-2, 1e-3, 1e-6)

# A ladder is continued by its last rungs, if there are so many below this error, and not farther than so many times its
# last cost.
_RUNGS, _BELOW, _FARTHEST = 4, 0.3, 1e4

# How far a restitution may be off at any phase, and what energy may be gained.
OFF = (0.05, 0.1)
GAIN = 0.02
# A nudge of a cube at rest, a hundredth of the sag, that has grown more lifts it off the ground.
GROWTH = 100.0

OURS = "symplectic_euler"

_SHORT = {
    "rest_depth": "depth at rest",
    "restitution": "restitution",
    "contact_time": "contact time",
    "rough_restitution": "restitution with friction",
    "friction": "friction",
}


def name_of(method: str) -> str:
    """Return a scheme's or an engine's name as a person reads it."""
    return PEERS[method].name if method in PEERS else method.replace("_", " ")


def engines_note(data: Iterable[xr.Dataset]) -> str:
    """Return the versions of the engines in files, and the names of those missing; nothing if they compare none."""
    data = list(data)
    methods = {name for found in data for name in meanings_of(found.method)}
    if not methods & set(ENGINES):
        return ""
    # All of SciPy's solvers are one package, and so are not missing beside each other.
    used = {PEERS[name].needs for name in methods if name in PEERS}
    missing = [engine.name for engine in ENGINES.values() if engine.needs not in used]
    versions = dict.fromkeys(
        part for found in data for part in str(found.attrs.get("engine_versions", "")).split("; ") if part
    )
    parts = [("Engines", versions), ("Left out or not installed", missing)]
    return " ".join(f"{what}: {', '.join(names)}." for what, names in parts if names)


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
        place = stiffness, self.methods.index(method)
        rungs = self.data.evaluations.values[place] > 0
        errors = self.data[f"{measure}_error"].values[place][rungs]
        return cost_of(errors, costs[place][rungs].astype(float), bound, continued=fixed_step(method))


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


def best(found: Found, methods: Iterable[str], stiffness: int, bound: float, *, timed: bool) -> tuple[str, float]:
    """Return the method that reaches an error of the position at the least cost, and it; ("", NaN) if none does."""
    tried = [name for name in methods if name in found.methods]
    costs = [(found.cost(name, stiffness, "position", bound, timed=timed), name) for name in tried]
    reached = [(name, cost.value) for cost, name in costs if cost.reached]
    return min(reached, key=lambda pair: pair[1], default=("", math.nan))


def work_precision(data: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return for each problem, ground and error of the position which scheme is cheapest, and SciPy's best beside."""
    rows = []
    for found in found_in(data.values()):
        both = [name for name in found.methods if name not in PEERS], SOLVERS
        for stiffness, bound in itertools.product(range(found.data.sizes["stiffness"]), ERRORS):
            row = [PROBLEMS[found.problem].name, readable(float(found.data.stiffness[stiffness])), f"{bound:g}"]
            for timed in (False, True) if found.seconds is not None else (False,):
                costs = [best(found, methods, stiffness, bound, timed=timed) for methods in both]
                for name, cost in costs:
                    number = duration(cost) if timed else f"{cost:,.0f}"
                    row.append(f"{number} ({name_of(name)})" if name else "none reaches it")
                (_, ours), (_, theirs) = costs
                row.append(f"{theirs / ours:.3g}" if ours and math.isfinite(theirs / ours) else "—")
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
            for methods in ([scheme], SOLVERS)
        )
        of = f"{scheme}, {PROBLEMS[problem].name} to {bound:g}:"
        if growth is not None:
            rows.append([f"{of} growth of {what} over S", growth, "", _reached(ours.max() / ours[0])])
        ratios = theirs / ours
        ends = [_reached(reduced(ratios)) for reduced in (np.fmin.reduce, np.fmax.reduce)]
        rows.append([f"{of} SciPy's best over it, in {what}", ratio, *ends])
    return rendered(title, ["ratio", "aimed at", "least over S", "most over S"], rows, _NOTE)


def _reached(ratio: float) -> str:
    return "not reached" if math.isnan(ratio) else f"{ratio:.3g}"


def engine_contact(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each method and ground: by how much its contact is off the exact one, at each ωh."""
    (found,) = experiments.values()
    found = found.sortby("omega_h")
    rows = []
    for (k, name), s, d in itertools.product(
        enumerate(meanings_of(found.method)), range(found.sizes["stiffness"]), range(found.sizes["damping"])
    ):
        there = found.isel(method=k, stiffness=s, damping=d)
        row = [name_of(name), readable(float(there.stiffness)), f"{float(there.damping):g}"]
        rows.append([*row, *(", ".join(map(_percent, there[ratio].values - 1)) for ratio in RATIOS)])
    note = (
        "By how much what was found differs from what is exact, at ωh = "
        f"{' and '.join(f'{part:g}' for part in found.omega_h.values)}; — where the cube did not leave the ground. "
        "Depth at rest: over m g/(4S), the mean of ten periods. Restitution: of a flat bounce, the mean over phases of "
        f"the step. Friction: horizontal over normal impulse, over mu. {engines_note([found])}"
    )
    return rendered(title, ["method", "S [kg/s²]", "D [kg/s]", *(_SHORT[name] for name in RATIOS)], rows, note)


def _percent(part: float) -> str:
    if math.isnan(part):
        return "—"
    return "0" if abs(part) < 5e-7 else f"{100 * part:+.2g} %".replace("-", "−")


class Limit(NamedTuple):
    """The longest ωh up to which all scanned ones pass, and the first that fails; NaN if none does."""

    passes: float
    fails: float

    def __str__(self) -> str:
        """Return it as a person reads it."""
        if math.isnan(self.fails):
            return f"≥ {self.passes:g}"
        return f"< {self.fails:.2g}" if math.isnan(self.passes) else f"{self.passes:.2g}"


def limit_of(omega_h: Array, passed: npt.NDArray[np.bool_]) -> Limit:
    """Return the limit of a criterion that holds at some of the scanned ωh, ascending, shape (omega_h,)."""
    failed = np.flatnonzero(~passed)
    if not failed.size:
        return Limit(float(omega_h[-1]), math.nan)
    first = int(failed[0])
    return Limit(float(omega_h[first - 1]) if first else math.nan, float(omega_h[first]))


def within(found: xr.Dataset, method: int, off: float) -> npt.NDArray[np.bool_]:
    """Return at which ωh the restitution is within a part of the exact one at every phase, shape (omega_h,)."""
    ratio = found.restitution.values[method] / float(found.exact_restitution)
    return np.asarray((np.abs(ratio - 1) <= off).all(axis=1))


def engine_limits(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each method: how long its step may be by each criterion, and its restitution beyond."""
    (found,) = experiments.values()
    omega_h, exact = found.omega_h.values, float(found.exact_restitution)
    shown = sorted({int(np.abs(omega_h - 2.0).argmin()), len(omega_h) - 1})
    rows = []
    for k, name in enumerate(meanings_of(found.method)):
        restitution, outcomes = found.restitution.values[k], found.outcome.values[k]
        passed = [
            *(within(found, k, off) for off in OFF),
            (np.nan_to_num(restitution / exact, nan=0.0) ** 2 <= 1 + GAIN).all(axis=1),
            ~np.isin(outcomes, [OUTCOMES.index("sinks"), OUTCOMES.index("blows_up")]).any(axis=1),
            found.rest_growth.values[k] <= GROWTH,
            (outcomes != OUTCOMES.index("stays")).all(axis=1),
        ]
        rows.append([name_of(name), *(str(limit_of(omega_h, part)) for part in passed)])
        rows[-1] += [_span(restitution[place]) for place in shown]
    columns = ["method", *(f"e within {off:.0%}" for off in OFF), f"no energy gain above {GAIN:.0%}"]
    columns += ["whole", "stays at rest", "leaves the ground", *(f"e at ωh = {omega_h[place]:.3g}" for place in shown)]
    ground = scene_of(found)["ground"]
    note = (
        f"The longest ωh of {len(omega_h)} from {omega_h[0]:g} to {omega_h[-1]:g} up to which each of them passes, at "
        f"all of {found.sizes['phase']} phases of the step at touch-down. One flat bounce without friction, "
        f"{ground_words(stiffness=ground['stiffness'], damping=ground['damping'])}, exact restitution {exact:.6g}. "
        "Whole: it neither sinks through nor leaves the range of doubles. Stays at rest: a nudge by a hundredth of its "
        f"depth grows less than {GROWTH:g}-fold in 200 steps. {engines_note([found])}"
    )
    return rendered(title, columns, rows, note)


def _span(restitution: Array) -> str:
    """Return the least and the most over the phases at which the cube left the ground."""
    low, high = np.fmin.reduce(restitution), np.fmax.reduce(restitution)
    return "—" if math.isnan(low) else f"{low:.2g} … {high:.3g}"


def engine_speed(timings: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each method: steps a second of each problem, and how many times as many ours does."""
    (found,) = timings.values()
    names = meanings_of(found.method)
    rates = found.taken.values / found.seconds.values
    ours = rates[:, names.index(OURS)] if OURS in names else np.full(len(rates), np.nan)
    rows = []
    for k, name in enumerate(names):
        row = [name_of(name), "force evaluations" if METHODS[name].own_steps else "steps"]
        for p in range(len(rates)):
            row += [_count(rates[p, k]), _count(ours[p] / rates[p, k])]
        rows.append([*row, f"{100 * np.nanmax(found.spread.values[:, k]):.2g} %"])
    columns = ["method", "what is counted"]
    for problem in meanings_of(found.problem):
        columns += [f"{PROBLEMS[problem].name} [1/s]", "ours over it"]
    note = (
        f"Medians of {found.attrs['rounds']} interleaved rounds, of {found.attrs['steps']:,} steps each, on one thread "
        f"of {found.attrs['machine_processor']}; what took long, once. Ours: {name_of(OURS)}, plain stepping. Engines "
        f"are started before the clock is. Spread: half the range between the quartiles. {engines_note([found])}"
    )
    return rendered(title, [*columns, "spread"], rows, note)


def _count(value: float) -> str:
    return "—" if math.isnan(value) else readable(value, digits=2)

"""A scheme of fixed steps: how many steps an error takes.

The scheme is tried with more and more steps, as far as a budget goes; what is beyond that is extrapolated by its order
under contact, which is one wherever a force sets in with a jump (docs/method.md). A run that was ended early, or is too
far off to say anything, is known until then only; from there on its error is taken to grow as one of the pilot's
tolerance does, or as the square of time if that is more.
"""

from __future__ import annotations

import itertools
import math
import statistics
import time
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from stiffdice.advice.pilot import SAFETY, SAMPLES, Pilot, Trial, tried
from stiffdice.advice.result import EXTRAPOLATED, MEASURED, THEORY, Option
from stiffdice.dynamics.state import Array
from stiffdice.integrators import linear_stability
from stiffdice.scene import validation
from stiffdice.simulation.run import simulate

# A run whose error is extrapolated to be so many times smaller keeps a promise.
_FAR_SAFETY = 3.0

# Twice the steps divide an error of second order by four; by less than this it is taken for one of first order.
_SECOND = 3.0

# Fixed steps are tried up to so many computed ones; a run of so many is timed.
BUDGET = 200_000
_TIMED = 20_000

# Errors above this part of a radius do not grow as small ones do.
LINEAR = 0.05

# Runs that an extrapolation takes the worst of: errors depend on the phase of a landing, too.
_RUNGS = 3

# Past this many steps counting them is no longer exact.
_MOST_STEPS = float(validation.LARGEST_COUNT)

# Schemes that are of second order under a contact without a jump.
_SECOND_ORDER = frozenset({"velocity_verlet", "rk4"})


class Search(NamedTuple):
    """What all schemes of fixed steps are tried with on a pilot's scene.

    hardest: the fastest contact. shape: how a small error grows, shape (SAMPLES + 1,), up to a factor. budget: steps
    that a run may compute one by one.
    """

    pilot: Pilot
    hardest: linear_stability.Hardest
    shape: Array
    budget: int

    def option(self, scheme: str, error: float) -> Option:
        """Return how many steps of a scheme an error [radii] takes."""
        pilot, runs, keeping = self.pilot, list[tuple[Trial, Array]](), 0
        for steps in self._ladder(scheme):
            trial = tried(pilot.scene, pilot.model, scheme, steps, budget=self.budget)
            off = pilot.error(trial)
            runs.append((trial, off))
            keeping = keeping + 1 if SAFETY * off[-1] + pilot.floor[-1] <= error else 0
            # One that keeps it might be lucky.
            if keeping == 2 or trial.computed >= self.budget or (keeping == 0 and steps > _MOST_STEPS / 4):
                break
        if keeping < 2:
            return self._extrapolated(runs, error)
        trial, off = runs[-2]
        evidence = (
            f"this very run was made, flights taken at once, and compared with {pilot.best.scheme}; so was one of "
            "half the step"
        )
        return self._option(trial, trial.steps, max(float(off[-1]), float(pilot.floor[-1])), MEASURED, error, evidence)

    def _ladder(self, scheme: str) -> Iterator[int]:
        """Yield steps, twice as many every time, from where the scheme is stable on."""
        limit = linear_stability.stability_limit(scheme, self.hardest.zeta)
        longest = min(1.0, 0.9 * limit) if limit > 0.1 else 1.0
        steps = SAMPLES * max(1, math.ceil(self.hardest.omega * self.pilot.scene.duration / longest / SAMPLES))
        while steps <= _MOST_STEPS:
            yield steps
            steps *= 2

    def _extrapolated(self, runs: list[tuple[Trial, Array]], asked: float) -> Option:
        known, last = self._known(runs), runs[-1][0]
        if not known:
            evidence = "no run within the budget says how far off it is; more steps than these, by its stability limit"
            return self._option(last, last.steps, None, THEORY, asked, evidence)
        order = self._order(last.scheme, [end for _, end in known])
        worst = max(end * float(trial.steps) ** order for trial, end in known)
        wanted = (_FAR_SAFETY * worst / asked) ** (1 / order)
        evidence = (
            f"extrapolated by order {order} under contact (docs/method.md) from runs of "
            f"{known[0][0].steps:.3g} to {known[-1][0].steps:.3g} steps"
        )
        if wanted >= _MOST_STEPS:
            evidence += ": more than can be counted"
            return self._option(last, wanted, asked / _FAR_SAFETY, EXTRAPOLATED, asked, evidence)
        steps = SAMPLES * math.ceil(max(wanted, last.steps) / SAMPLES)
        return self._option(last, steps, worst / float(steps) ** order, EXTRAPOLATED, asked, evidence)

    def _order(self, scheme: str, errors: list[float]) -> int:
        """Return the order to extrapolate by: two only for a scheme of second order, where the last runs show it."""
        ground = self.pilot.scene.ground
        if scheme not in _SECOND_ORDER or ground.damping > 0 or ground.friction > 0:
            return 1
        shown = all(a / b > _SECOND for a, b in itertools.pairwise(errors) if b > 0)
        return 2 if len(errors) == _RUNGS and shown else 1

    def _known(self, runs: list[tuple[Trial, Array]]) -> list[tuple[Trial, float]]:
        """Return some runs with their errors at the end [radii], by their steps.

        They are the finest of those that are known to the end; if there is none, of those that are known longest.
        """
        grown = [(trial, self._grown(off)) for trial, off in runs]
        known = [(trial, *found) for trial, found in grown if found is not None]
        whole = [each for each in known if each[1] == SAMPLES]
        longest = whole or sorted(known, key=lambda each: (each[1], each[0].steps))
        return sorted(((trial, end) for trial, _, end in longest[-_RUNGS:]), key=lambda each: each[0].steps)

    def _grown(self, off: Array) -> tuple[int, float] | None:
        """Return until which sample a run is known, and its error at the end [radii]; None if it says nothing."""
        small = np.flatnonzero((off <= LINEAR) & (off > 0) & (self.shape > 0))
        if not small.size:
            return None
        last = int(small[-1])
        if last == SAMPLES:
            return last, float(off[-1])
        landed = self.pilot.landings
        # Until the second landing a chaotic motion has not shown how errors grow.
        if len(landed) and last <= landed[0]:
            return None
        # What a scheme does to every bounce adds up in the speed, and so twice in the place, where nothing is chaotic.
        grown = float(off[last] * max((SAMPLES / last) ** 2, self.shape[-1] / self.shape[last]))
        return (last, grown) if math.isfinite(grown) else None

    def _option(
        self, trial: Trial, steps: float, error: float | None, basis: str, asked: float, evidence: str
    ) -> Option:
        """Return an option of a trial's scheme, which tells how long a step takes; error [radii]: expected."""
        pilot, counted = self.pilot, steps < _MOST_STEPS
        # Half a unit of the place in each step, all in one direction.
        rounding = steps * 2.0**-53 * float(np.nanmax(np.abs(pilot.best.places))) / pilot.scene.cube.radius
        if counted and error is not None and rounding > asked:
            evidence += f"; round-off of so many steps may come to {rounding:.1g} radii"
        return Option(
            scheme=trial.scheme,
            steps=int(steps) if counted else validation.LARGEST_COUNT,
            tolerance=None,
            error=error,
            basis=basis,
            evaluations=trial.evaluations / max(1, trial.computed) * steps,
            seconds=steps * self._seconds_per_step(trial),
            omega_h=self.hardest.omega * pilot.scene.duration / steps,
            limit=linear_stability.stability_limit(trial.scheme, self.hardest.zeta),
            keeps=counted and error is not None and max(rounding, float(pilot.floor[-1])) <= asked,
            evidence=evidence,
        )

    def _seconds_per_step(self, trial: Trial) -> float:
        """Return how long a step takes [s], of plain stepping: the median of three runs."""
        scene, model, steps, took = self.pilot.scene, self.pilot.model, trial.steps, []
        for _ in range(3):
            begun = time.perf_counter()
            run = simulate(scene, model=model, scheme=trial.scheme, steps=steps, every=steps // SAMPLES, budget=_TIMED)
            took.append((time.perf_counter() - begun) / max(1, int(run.steps_computed[0])))
        return statistics.median(took)

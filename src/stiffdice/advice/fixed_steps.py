"""A scheme of fixed steps: how many steps an error takes.

The scheme is tried with more and more steps, as far as a budget goes; what is beyond that is extrapolated by its order
under contact, which is one wherever a force sets in with a jump (docs/explanation/method.md). A run that was ended
early, or is too far off to say anything, is known until then only; from there on its error is taken to grow as one of
the pilot's tolerance does, or as the square of time if that is more.
"""

from __future__ import annotations

import itertools
import math
import statistics
import time
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
        # From where the scheme is stable on, twice as many steps every time.
        limit = linear_stability.stability_limit(scheme, self.hardest.zeta)
        longest = min(1.0, 0.9 * limit) if limit > 0.1 else 1.0
        steps = SAMPLES * max(1, math.ceil(self.hardest.omega * pilot.scene.duration / longest / SAMPLES))
        while steps <= _MOST_STEPS:
            trial = tried(pilot.scene, pilot.model, scheme, steps, budget=self.budget)
            off = pilot.error(trial)
            runs.append((trial, off))
            keeping = keeping + 1 if SAFETY * off[-1] + pilot.floor[-1] <= error else 0
            # One that keeps it might be lucky.
            if keeping == 2 or trial.computed >= self.budget or (keeping == 0 and steps > _MOST_STEPS / 4):
                break
            steps *= 2
        if keeping < 2:
            return self._extrapolated(runs, error)
        trial, off = runs[-2]
        evidence = (
            f"this very run was made, flights taken at once, and compared with {pilot.best.scheme}; so was one of "
            "half the step"
        )
        return self._option(trial, trial.steps, max(float(off[-1]), float(pilot.floor[-1])), MEASURED, error, evidence)

    def _extrapolated(self, runs: list[tuple[Trial, Array]], asked: float) -> Option:
        known, last = self._known(runs), runs[-1][0]
        if not known:
            evidence = "no run within the budget says how far off it is; more steps than these, by its stability limit"
            return self._option(last, last.steps, None, THEORY, asked, evidence)
        # Of second order only where the last runs of such a scheme show it.
        ground, pairs = self.pilot.scene.ground, itertools.pairwise(end for _, end in known)
        smooth = last.scheme in _SECOND_ORDER and ground.damping == 0 and ground.friction == 0
        shown = len(known) == _RUNGS and all(a / b > _SECOND for a, b in pairs if b > 0)
        order = 2 if smooth and shown else 1
        worst = max(end * float(trial.steps) ** order for trial, end in known)
        wanted = (_FAR_SAFETY * worst / asked) ** (1 / order)
        evidence = (
            f"extrapolated by order {order} under contact (docs/explanation/method.md) from runs of "
            f"{known[0][0].steps:.3g} to {known[-1][0].steps:.3g} steps"
        )
        if wanted >= _MOST_STEPS:
            evidence += ": more than can be counted"
            return self._option(last, wanted, asked / _FAR_SAFETY, EXTRAPOLATED, asked, evidence)
        steps = SAMPLES * math.ceil(max(wanted, last.steps) / SAMPLES)
        return self._option(last, steps, worst / float(steps) ** order, EXTRAPOLATED, asked, evidence)

    def _known(self, runs: list[tuple[Trial, Array]]) -> list[tuple[Trial, float]]:
        """Return some runs with their errors at the end [radii], by their steps.

        They are the finest of those that are known to the end; if there is none, of those that are known longest.
        """
        known = []
        for trial, off in runs:
            small = np.flatnonzero((off <= LINEAR) & (off > 0) & (self.shape > 0))
            last = int(small[-1]) if small.size else 0
            # Until the second landing a chaotic motion has not shown how errors grow.
            if last == 0 or (last < SAMPLES and last <= min(self.pilot.landings, default=0)):
                continue
            # What a scheme does to every bounce adds up in the speed, and so twice in the place, without any chaos.
            growth = max((SAMPLES / last) ** 2, self.shape[-1] / self.shape[last]) if last < SAMPLES else 1.0
            if math.isfinite(end := float(off[last] * growth)):
                known.append((last, trial, end))
        whole = [each for each in known if each[0] == SAMPLES]
        longest = whole or sorted(known, key=lambda each: (each[0], each[1].steps))
        return sorted(((trial, end) for _, trial, end in longest[-_RUNGS:]), key=lambda each: each[0].steps)

    def _option(
        self, trial: Trial, steps: float, error: float | None, basis: str, asked: float, evidence: str
    ) -> Option:
        """Return an option of a trial's scheme, which tells how long a step takes; error [radii]: expected."""
        pilot, counted, took = self.pilot, steps < _MOST_STEPS, []
        for _ in range(3):  # of plain stepping
            begun, scheme, many = time.perf_counter(), trial.scheme, trial.steps
            every = many // SAMPLES
            run = simulate(pilot.scene, model=pilot.model, scheme=scheme, steps=many, every=every, budget=_TIMED)
            took.append((time.perf_counter() - begun) / max(1, int(run.steps_computed[0])))
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
            seconds=steps * statistics.median(took),
            omega_h=self.hardest.omega * pilot.scene.duration / steps,
            limit=linear_stability.stability_limit(trial.scheme, self.hardest.zeta),
            keeps=counted and error is not None and max(rounding, float(pilot.floor[-1])) <= asked,
            evidence=evidence,
        )

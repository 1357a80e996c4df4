"""Figure 13 for two cubes: the steps that they need not to gain energy when they meet, against stiffness.

Two equal cubes that are launched at each other in space: two faces, two crossed edges, or a corner and a face, each
along the line of the centres, so that nothing turns and what meets is half a mass on k springs, ω² = k S/(m/2). Without
damping only the time step takes and gives energy: by `linear_theory.largest_gain` at the worst phase of the step in
which they touch. Below `bound` steps no phase may gain too much; linear theory says no more than ωh < 2.

And two cubes on each other, dropped from a little above each other and the ground: on what they stand, the fastest of
the two bounces of a stack has ω² = (6 + 2√5) S/m. It is damped: without damping a stack never rests, and what is
measured is once more how much single bounces gain.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.box_contact import modes
from stiffdice.dynamics.box_contact.pair_state import Pairs
from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import bisected, mapped, numbers, quantity, result
from stiffdice.experiments.pair.placement import IN_THE_AIR, UPRIGHT, above, pair_of, speeds, still
from stiffdice.scene import validation
from stiffdice.scene.pair import PairScene
from stiffdice.scene.scene import Scene
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.pair.run import TOLERANCE, simulate_pair
from stiffdice.sweep import stability_limits

MODEL, SCHEME = "tumbling", "symplectic_euler"

_UP = np.array([0.0, 0.0, 1.0])
# About (1, −1, 0) this puts a node below the centre.
_ON_CORNER = math.acos(1 / math.sqrt(3)) / math.sqrt(2)
# Orientations of the lower and the upper cube.
MEETINGS = {
    "head_on": (UPRIGHT, UPRIGHT),
    "edge_edge": ((math.pi / 4, 0.0, 0.0), (0.0, math.pi / 4, 0.0)),
    "corner_face": (UPRIGHT, (_ON_CORNER, -_ON_CORNER, 0.0)),
}
CASES = (*MEETINGS, "stacked")

# In units of the side: how deep a contact is of which modes are told; how high a stack is above the ground, and its
# upper cube above the lower one.
_SHALLOW, _DROP = 1e-6, 1e-2
# By how much of a step the upper cube's phase goes beyond the lower one's from member to member, less whole steps.
_GOLDEN = (math.sqrt(5) - 1) / 2

_EDGES = {
    "first_pass": ("fewest steps at which all members pass", "1"),
    "last_fail": ("most steps at which a member fails", "1"),
    "steps_needed": ("fewest steps from which on all members pass", "1"),
    "flips": ("changes between passing and failing along the scan", "1"),
    "limit": ("steps at the linear limit of the contact's fastest bounce", "1"),
    "gain": ("steps from which on no phase gains too much, by the largest gain", "1"),
    "bound": ("steps from which on no phase gains too much, by its bound", "1"),
    "mode_number": ("k of omega^2 = k S/m of the contact's fastest bounce", "1"),
    "scanned": ("steps of the scan", "1", "scan"),
    "pass_fraction": ("share of the members that pass", "1", "scan"),
}
_FITS = {
    "exponent": ("exponent of the power law of the steps needed", "1"),
    "exponent_error": ("its standard error", "1"),
}


class _Motion(NamedTuple):
    """A case at one stiffness: the scene, its fastest bounce, and a step size [s] -> launches."""

    scene: PairScene
    omega: float  # [rad/s]
    zeta: float
    launches: Callable[[float], Pairs]


def measure(
    scene: Scene,
    *,
    cases: Sequence[str] = CASES,
    stiffness: Sequence[float] = tuple(np.geomspace(1e2, 1e7, 11)),
    steps: Sequence[float] = (0.3, 6.0),
    count: int = 60,
    members: int = 16,
    speed: float = 1.0,
    zeta: float = 0.02,
    seed: int = 0,
) -> xr.Dataset:
    """Return the edges of stability of two cubes by case and stiffness, and as predicted.

    scene: gives the cube that both are, gravity for the stack, and the duration. cases: head_on, edge_edge,
    corner_face, stacked. stiffness [kg/s²]: of all contacts. steps: ends of the scan, over those of the linear limit;
    count: values in it, evenly in their logarithm, jittered. members: launches of each cell, spread over the phase of a
    step. speed [m/s]: at which the cubes near each other. zeta: damping ratio of the stack's fastest bounce. seed: of
    the jitter. A member passes if it never has more than 1.05 of its launch's energy while nothing touches, and never
    sinks too deep. Raises InputError for a value out of range.
    """
    cases = [validation.choice("cases", case, CASES) for case in cases]
    stiffness = numbers("stiffness", stiffness, "kg/s²", above=0)
    low, high = numbers("steps", steps, "1", above=0)
    count, members = validation.count("count", count, at_least=2), validation.count("members", members)
    speed, zeta = validation.number("speed", speed, "m/s", above=0), validation.number("zeta", zeta, "1", at_least=0)
    jitter = np.random.default_rng(validation.count("seed", seed, at_least=0))

    def found(case: str, value: float) -> list[Any]:
        motion = (
            _stack(scene, value, zeta, members) if case == "stacked" else _meeting(scene, case, value, speed, members)
        )
        predicted = _predicted(motion, free=case != "stacked")
        part = (np.arange(count) + jitter.random(count)) / count
        scanned = np.maximum(1, np.rint(predicted[0] * low * (high / low) ** part)).astype(np.int64)
        share = np.array([_passing(motion, int(number)) for number in scanned])
        edges = stability_limits.edges(scanned, share == 1)
        return [*edges.values(), *predicted, motion.omega**2 * scene.cube.mass / value, scanned, share]

    variables = mapped(found, _EDGES, case=cases, stiffness=stiffness)
    fits = [stability_limits.power_law(np.array(stiffness), row) for row in variables["steps_needed"][1]]
    for name, (meaning, unit) in _FITS.items():
        variables[name] = quantity("case", [fit[name] for fit in fits], meaning, unit)
    note = "two such cubes, launches and damping are the experiment's, not the scene's; contact: gated, no friction"
    told = {"speed": speed, "zeta": zeta, "members": members, "tolerance": TOLERANCE}
    return result(variables, "Edges of stability of two cubes", scene, MODEL, SCHEME, __name__, scene_note=note, **told)


def _phases(members: int) -> Array:
    return (np.arange(members) + 0.5) / members


def _meeting(scene: Scene, case: str, stiffness: float, speed: float, members: int) -> _Motion:
    """Return two cubes that near each other in space."""
    launches = [still(orientation=turn) for turn in MEETINGS[case]]
    pair = pair_of(scene, launches, gravity=0.0, stiffness=stiffness, damping=0.0, friction=0.0)
    height, half = IN_THE_AIR * scene.cube.side, speed / 2 * _UP
    touching = above(pair, height, -_SHALLOW * scene.cube.side)
    omega = math.sqrt(modes.translations(pair, touching, _UP)[-1])

    def start(h: float) -> Pairs:
        apart = np.repeat(speeds(above(pair, height, 0.0), half, -half), members)
        apart["b"]["position"][:, 2] += speed * h * _phases(members)
        return apart

    return _Motion(pair, omega, 0.0, start)


def _stack(scene: Scene, stiffness: float, zeta: float, members: int) -> _Motion:
    """Return two cubes above each other and the ground."""
    side, launches = scene.cube.side, [still(), still()]
    bare = pair_of(scene, launches, stiffness=stiffness, damping=0.0, friction=0.0)
    standing = above(bare, -_SHALLOW * side, -_SHALLOW * side)
    omega = math.sqrt(modes.translations(bare, standing, _UP)[-1])
    pair = pair_of(scene, launches, stiffness=stiffness, damping=2 * zeta * stiffness / omega, friction=0.0)
    fall = math.sqrt(2 * scene.gravity * _DROP * side)

    def start(h: float) -> Pairs:
        apart, phases = np.repeat(above(pair, _DROP * side, _DROP * side), members), _phases(members)
        apart["a"]["position"][:, 2] += fall * h * phases
        apart["b"]["position"][:, 2] += fall * h * (phases + np.arange(members) * _GOLDEN % 1)
        return apart

    return _Motion(pair, omega, zeta, start)


def _passing(motion: _Motion, steps: int) -> float:
    """Return the share of the members that pass."""
    launches = motion.launches(motion.scene.duration / steps)
    run = simulate_pair(motion.scene, scheme=SCHEME, steps=steps, launches=launches)
    return float(np.mean(run.verdict == Verdict.PASSED))


def _predicted(motion: _Motion, *, free: bool) -> list[float]:
    """Return the steps of the linear limit; and, of a single bounce, from which on no phase gains too much."""
    swing = motion.omega * motion.scene.duration
    limit = swing / linear_theory.stability_limit(motion.zeta)
    if not free:
        return [limit, math.nan, math.nan]
    return [limit, swing / longest_harmless(TOLERANCE), swing / (2 * math.sqrt(1 - 1 / (1 + TOLERANCE)))]


def longest_harmless(tolerance: float) -> float:
    """Return the ωh [1] up to which no bounce of the largest gain has e² above 1 + tolerance.

    Between the magic steps of n and n + 1 steps, the largest gain rises from one at ωh of n + 1 to its bound, and falls
    to one again. The first rise that is too high is bisected.
    """
    n = 2
    while linear_theory.gain_bound(linear_theory.magic_step(n + 0.5)) > 1 + tolerance:
        n += 1
    # The bound between these two is that at the middle, where the largest gain reaches it.
    low, high = linear_theory.magic_step(n), linear_theory.magic_step(n - 0.5)
    harmless, _ = bisected(lambda value: linear_theory.largest_gain(value) <= 1 + tolerance, low * (1 + 1e-9), high)
    return harmless

"""What is said of a run: doubts before it, and afterwards what its verdict rests on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import TOUCHING, TURNING, start_of
from stiffdice.integrators import linear_stability
from stiffdice.integrators import registry as schemes
from stiffdice.report.number_format import finite
from stiffdice.scene.rotation import along
from stiffdice.scene.scene import Scene
from stiffdice.simulation.backend import OURS
from stiffdice.simulation.criteria.registry import CRITERIA
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import Run

# Densities [kg/m³] beyond which a cube is rather a slip in a unit: below hydrogen's, above osmium's several times.
_DENSITIES = 0.08, 1e5

# The printed formula for the side puts the corners of the paper's cube at 0.9 of its radius, of smaller cubes nearer.
_FAR = 1.5


def doubts(scene: Scene, model: str, scheme: str, steps: int) -> list[str]:
    """Return what speaks against a run before it is made, a line each.

    scheme: an engine's own has no limit that is known here. Raises InputError for a model that does not fit the scene.
    """
    said = []
    density = scene.cube.mass / scene.cube.side / scene.cube.side / scene.cube.side
    if not _DENSITIES[0] <= density <= _DENSITIES[1]:
        size = f"{scene.cube.side:g} m of side, {scene.cube.mass:g} kg"
        said.append(f"the cube has a density of {density:.2g} kg/m³ ({size}); the units are m and kg")
    corner = scene.cube.side * math.sqrt(3) / 2
    if scene.cube.radius > _FAR * corner:
        said.append(
            f"cube.geometry = printed: of a cube of radius {scene.cube.radius:.3g} m it puts the corners "
            f"{corner:.3g} m from the centre; exact puts them at the radius"
        )
    start = start_of(scene, model)[0]
    heights = along(start["position"] + start["node_offset"], scene.ground.normal)
    depth = -float(heights.min())
    if depth > 2 * min(linear_theory.sag(scene), scene.cube.side):  # more than it sinks in at rest
        stored = 0.5 * scene.ground.stiffness * float((np.minimum(heights, 0.0) ** 2).sum())
        said.append(
            f"launch.position: the cube starts in the ground, its lowest node {depth:.3g} m deep; "
            f"the springs hold {stored:.3g} J and throw it out"
        )
    turn = float(linear_stability.half_turn_steps(scene, np.array(scene.launch.spin)))
    if model in TURNING & TOUCHING and steps < turn and scheme not in schemes.OWN_STEPS:
        said.append(
            f"launch.angular_momentum turns the cube by {math.pi * turn / steps:.3g} rad in a step, more than half a "
            f"turn; {_rounded_up(turn)} steps or more resolve it"
        )
    fewest = max(linear_stability.fewest_steps(scene, model, scheme)) if scheme in schemes.SCHEMES else 0.0
    if steps < fewest:
        said.append(beyond_limit(scheme, steps, fewest, "symplectic_euler or event has"))
    return said


def beyond_limit(scheme: str, steps: int, fewest: float, better: str) -> str:
    """Return the doubt about too few steps; better: what has a limit where the scheme has none, `fewest` infinite."""
    needed = f"{scheme} needs {_rounded_up(fewest)} or more"
    limit = f"{scheme} has none on this ground; {better}" if math.isinf(fewest) else needed
    return f"{steps:,} steps are beyond the limit of linear stability: {limit}"


def _rounded_up(steps: float) -> str:
    """Return a number of steps in two digits, not less than it."""
    if not 0 < steps < 1e9:
        return f"{steps:.2g}"
    unit = 10.0 ** (math.floor(math.log10(steps)) - 1)
    return f"{math.ceil(steps / unit) * unit:,.0f}"


def lines(run: Run, name: str, advise: str) -> list[str]:
    """Return how a run of one member ended, and what that was looked at by.

    name: of its file. advise: the command that tells how accurate such a run is.
    """
    said = [f"{name}: {Verdict(run.verdict[0]).sentence}"]
    for criterion, tolerance in run.tolerances.items():
        part = CRITERIA[criterion]
        measure = float(run.measures[part.MEASURE][0])
        found = f"{measure:.6g}, allowed {part.BASE + tolerance:g}: {part.LONG_NAME}"
        none = criterion == "apex" and measure == 0
        said.append(f"  {criterion:9} {'no rebound to compare with the one before' if none else found}")
    said.append(f"  steps     {_steps(run)}")
    if run.simulator == OURS:
        said.append(f"  accuracy  was not looked at; this does: {advise}")
    return said


def as_data(run: Run, name: str, notes: list[str]) -> dict[str, Any]:
    """Return the same as plain data, units in the keys. notes: what was derived, and why this model, a line each."""
    criteria = {}
    for criterion, tolerance in run.tolerances.items():
        part = CRITERIA[criterion]
        measure = float(run.measures[part.MEASURE][0])
        criteria[criterion] = {"measure": part.MEASURE, "value": finite(measure), "limit": part.BASE + tolerance}
    return {
        **verdict_as_data(name, Verdict(run.verdict[0])),
        "model": run.model,
        "simulator": run.simulator_version,
        "scheme": run.scheme,
        "steps": run.steps,
        "steps_done": int(run.steps_done[0]),
        "step_size_s": run.scene.duration / run.steps,
        "omega_h": finite(float(linear_theory.omega_h(run.scene, run.steps))),
        "criteria": criteria,
        "notes": notes,
    }


def verdict_as_data(name: str, verdict: Verdict) -> dict[str, Any]:
    """Return what the data on any run begin with; name: of its file."""
    return {
        "file": name,
        "passed": verdict == Verdict.PASSED,
        "verdict": verdict.name.lower(),
        "sentence": verdict.sentence,
    }


def _steps(run: Run) -> str:
    if run.simulator != OURS:
        return f"ωh = {linear_theory.omega_h(run.scene, run.steps):.3g} of a flat landing"
    if run.scheme in schemes.OWN_STEPS or run.scheme == "exact":
        return f"{run.scheme} has no limit of stability; its steps are output intervals"
    mode = linear_stability.hardest(run.scene, run.model)
    if mode.omega == 0:
        return "nothing springs back, so that no contact limits the step"
    omega_h = mode.omega * run.scene.duration / run.steps
    limit = linear_stability.stability_limit(run.scheme, mode.zeta)
    if math.isinf(limit):
        return f"ωh = {omega_h:.3g} ({mode.mode}); {run.scheme} is stable at any"
    return f"ωh = {omega_h:.3g}, linear limit {limit:.3g} ({run.scheme}; {mode.mode})"

"""What is said of a run of two boxes: doubts before it, and afterwards how it went."""

from __future__ import annotations

from typing import Any

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.box_contact.pair_state import pair_physics_of, pair_start_of
from stiffdice.dynamics.state import Array
from stiffdice.integrators import linear_stability
from stiffdice.report import run_page
from stiffdice.report.number_format import finite
from stiffdice.scene.pair import PairScene
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.pair import energy, linear_limit
from stiffdice.simulation.pair.run import TOLERANCE, PairRun, PairTrajectory

# Of the energy in the springs between the boxes at the launch: so many times that of one that rests on the other.
_PRESSED = 4.0


def doubts(scene: PairScene, scheme: str, steps: int) -> list[str]:
    """Return what speaks against a run before it is made, a line each."""
    said = []
    for number, part in enumerate(scene.parts):
        for line in run_page.doubts(part, "tumbling", "", steps):
            said.append(f"cubes.{number}{'.' if line.startswith('launch.') else ': '}{line}")
    stored = float(energy.energies(pair_physics_of(scene), pair_start_of(scene), 0.0)[3, 0])
    rest = max(0.5 * part.cube.mass * scene.gravity * linear_theory.sag(part) for part in scene.parts)
    if stored > _PRESSED * rest:
        said.append(f"the cubes start in each other; the springs between them hold {stored:.3g} J and throw them apart")
    if steps < (fewest := linear_limit.fewest_steps(scene, scheme)):
        said.append(run_page.beyond_limit(scheme, steps, fewest, "symplectic_euler has"))
    return said


def lines(run: PairRun, name: str) -> list[str]:
    """Return how a run of one launch with its trajectory went; name: of its file."""
    meetings, deepest = int(run.meetings[0]), float(run.deepest[0])
    times = f"{meetings} time{'' if meetings == 1 else 's'}"
    ratio = f"{run.energy_ratio[0]:.6g}, allowed {1 + TOLERANCE:g}"
    said = [
        f"{name}: {Verdict(run.verdict[0]).sentence}",
        f"  energy    {ratio}: largest energy in the air over that of the launch",
        f"  contact   they met {times}{f', {deepest:.3g} m deep at most' if meetings else ''}",
    ]
    if run.trajectory is not None:
        said += _motion(run.trajectory)
    return [*said, f"  steps     {_steps(run)}"]


def as_data(run: PairRun, name: str, notes: list[str]) -> dict[str, Any]:
    """Return the same as plain data, units in the keys. notes: what was derived, a line each."""
    ratio = {"measure": "energy_ratio", "value": finite(float(run.energy_ratio[0])), "limit": 1 + TOLERANCE}
    return {
        **run_page.verdict_as_data(name, Verdict(run.verdict[0])),
        "model": "pair",
        "scheme": run.scheme,
        "steps": run.steps,
        "steps_done": int(run.steps_done[0]),
        "step_size_s": run.scene.duration / run.steps,
        "criteria": {"energy": ratio},
        "meetings": int(run.meetings[0]),
        "deepest_contact_m": finite(float(run.deepest[0])),
        "notes": notes,
    }


def _motion(trajectory: PairTrajectory) -> list[str]:
    """Return how the boxes move once they have parted first, as far as kept states tell, and at the end; energies."""
    touching, whole = trajectory.contact_energy > 0, trajectory.mechanical_energy
    parted = np.flatnonzero(touching[:-1] & ~touching[1:]) + 1
    said = [line for k in parted[:1] for line in _moving(trajectory, "parted", k)]
    said += _moving(trajectory, "ended", -1)
    return [*said, f"  budget    {whole[0]:.6g} J at the launch, {whole[-1]:.6g} J at the end, springs included"]


def _moving(trajectory: PairTrajectory, event: str, k: int) -> list[str]:
    at = f"t = {trajectory.time[k]:.4g} s"
    said = []
    for number, (head, body) in enumerate(((f"  {event:9} {at:13}", "a"), (" " * 25, "b"))):
        state = trajectory.state[body][k]
        moving = f"{_vector(state['velocity'])} m/s, spin {_vector(state['angular_velocity'])} rad/s"
        said.append(f"{head} cube {number}: {moving}")
    return said


def _vector(v: Array) -> str:
    return "[" + ", ".join(f"{part:.3g}" for part in v) + "]"


def _steps(run: PairRun) -> str:
    mode = linear_limit.hardest(run.scene)
    if mode.omega == 0:
        return "nothing springs back, so that no contact limits the step"
    limit = linear_stability.stability_limit(run.scheme, mode.zeta)
    omega_h = mode.omega * run.scene.duration / run.steps
    return f"ωh = {omega_h:.3g}, linear limit {limit:.3g} ({run.scheme}; {mode.mode})"

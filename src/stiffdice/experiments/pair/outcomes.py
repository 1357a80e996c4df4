"""How two cubes react when they meet: spin, velocity and energy of each, by offset, friction and restitution.

The paper's section 7 leaves this open. One cube flies at another of its kind that is at rest, along x, offset from it
along y; its faces are parallel to the other's, or the other is turned by 45° about z, an edge ahead. All forces lie in
the plane of x and y, and so does the motion: spins are about z. Nothing else acts, so that momentum is kept; and what
another observer sees, as one to whom both move, is the same but for his velocity.

Beside it is what a single impulse gives without friction: J = (1 + e) v/(2/m + (r_a² + r_b²)/I), r the arms of the
force about either centre, where it passes the middle of the patch in which the faces meet, or the edge.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from stiffdice.dynamics.box_contact.pair_state import Pairs, pair_start_of
from stiffdice.dynamics.state import Array
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import coordinates, mapped, numbers, quantity, result
from stiffdice.experiments.pair.placement import IN_THE_AIR, UPRIGHT, pair_of, still
from stiffdice.scene import flat_landing, validation
from stiffdice.scene.pair import PairScene
from stiffdice.scene.scene import Scene
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.pair.run import simulate_pair

MODEL, SCHEME = "tumbling", "velocity_verlet"

# Orientation of the cube that is struck, and how far its foremost points are ahead of its centre, in units of the side.
POSES = {"parallel": (UPRIGHT, 0.5), "turned": ((0.0, 0.0, math.pi / 4), math.sqrt(0.5))}
BODIES = ("moving", "struck")

# Between the cubes at the launch, and as far as they move in a run, in units of the side.
_GAP, _WAY = 0.02, 2.0

_LEFT = {
    "spin": ("angular velocity about z after the meeting", "rad s-1", "offset", "body"),
    "velocity": ("velocity after the meeting", "m s-1", "offset", "body", "axis"),
    "energy": ("kinetic energy after the meeting, over that of the launch", "1", "offset", "body"),
    "meetings": ("how often they have begun to touch", "1", "offset"),
    "spin_error": ("largest change of an angular velocity with half the step", "rad s-1", "offset"),
}


def measure(
    scene: Scene,
    *,
    offset: Sequence[float] = tuple(np.linspace(0.0, 1.2, 28)),
    friction: Sequence[float] = (0.0, 0.1, 0.2, 0.4, 0.7, 1.0),
    restitution: Sequence[float] = (1.0, 0.5),
    stiffness: float = 1e5,
    speed: float = 1.0,
    omega_h: float = 0.05,
) -> xr.Dataset:
    """Return how two cubes leave each other, dimensions pose, restitution, friction, offset.

    scene: gives the cube that both are. offset: of the centres across the motion, over the side, 0 to 1.2. friction:
    between the cubes. restitution: of two flush cubes; the damping follows from it. stiffness [kg/s²]: of the contact.
    speed [m/s]: of the first cube. omega_h: of flush cubes, of the step that is halved to tell its error.
    Raises InputError for a value out of range, and where a run does not pass.
    """
    offset, friction = numbers("offset", offset, "1", at_least=0), numbers("friction", friction, "1", at_least=0)
    if max(offset) > 1.2:
        raise InputError(f"offset = {validation.shown(list(offset))}: allowed are numbers from 0 to 1.2 [1]")
    restitution = numbers("restitution", restitution, "1", above=0)
    stiffness = validation.number("stiffness", stiffness, "kg/s²", above=0)
    speed, omega_h = (
        validation.number(*given, above=0) for given in (("speed", speed, "m/s"), ("omega_h", omega_h, "1"))
    )

    def found(pose: str, e: float, mu: float) -> list[Any]:
        ground = {"friction": mu, "stiffness": stiffness, "damping": _damping(scene, stiffness, e)}
        pair, launches = launched(scene, pose, offset, speed, **ground)
        omega = math.sqrt(8 * stiffness / scene.cube.mass)
        steps = math.ceil(omega * pair.duration / omega_h)
        ends = [_ends(pair, launches, steps * times) for times in (1, 2)]
        coarse, fine = (_spins(end[0]) for end in ends)
        states, meetings = ends[1]
        error = np.abs(fine - coarse).max(axis=1)
        energy = _energies(states, scene) / (scene.cube.mass * speed**2 / 2)
        velocity = np.stack([states[k]["velocity"] for k in "ab"], axis=1)
        return [fine, velocity, energy, meetings, error]

    variables = mapped(found, _LEFT, pose=POSES, restitution=restitution, friction=friction)
    variables |= coordinates(offset=offset, body=BODIES, axis="xyz")
    impulse = [
        [[_by_one_impulse(scene, pose, value, e, speed) for value in offset] for e in restitution] for pose in POSES
    ]
    meaning = "angular velocity about z by one impulse without friction"
    variables["impulse_spin"] = quantity(("pose", "restitution", "offset", "body"), impulse, meaning, "rad s-1")
    note = "two such cubes; launches and contact are the experiment's, not the scene's; no gravity"
    told = {"speed": speed, "stiffness": stiffness, "omega_h": omega_h / 2}
    return result(variables, "Two cubes after a meeting", scene, MODEL, SCHEME, __name__, scene_note=note, **told)


def _damping(scene: Scene, stiffness: float, restitution: float) -> float:
    """Return D [kg/s] at which flush cubes have a restitution: half of one's mass on four springs and dashpots."""
    return flat_landing.damping("gated", restitution, stiffness, scene.cube.mass / 2)


def launched(
    scene: Scene, pose: str, offset: Sequence[float], speed: float, drift: float = 0.0, **ground: float
) -> tuple[PairScene, Pairs]:
    """Return the scene and the launches of a moving cube and one at rest, shape (offset,).

    drift [m/s]: of an observer, against whose motion both move.
    """
    turn, ahead = POSES[pose]
    side = scene.cube.side
    lasting = dataclasses.replace(scene, duration=_WAY * side / speed)
    pair = pair_of(lasting, [still(), still(orientation=turn)], gravity=0.0, **ground)
    launches = np.repeat(pair_start_of(pair), len(offset))
    for name in "ab":
        launches[name]["position"] = 0.0, 0.0, IN_THE_AIR * side
        launches[name]["velocity"] = -drift, 0.0, 0.0
    launches["a"]["velocity"][:, 0] += speed
    launches["b"]["position"][:, 0] = (0.5 + ahead + _GAP) * side
    launches["b"]["position"][:, 1] = np.array(offset) * side
    return pair, launches


def _ends(pair: PairScene, launches: Pairs, steps: int) -> tuple[Pairs, npt.NDArray[np.int64]]:
    """Return the states at the end, shape (offset,), and how often the cubes met."""
    run = simulate_pair(pair, scheme=SCHEME, steps=steps, launches=launches)
    if not (run.verdict == Verdict.PASSED).all():
        ended = Verdict(int(run.verdict.max())).name.lower()
        raise InputError(
            f"stiffness, speed, omega_h: a run of {steps} steps ended as {ended}; allowed are such as pass"
        )
    return run.end, run.meetings


def _spins(states: Pairs) -> Array:
    """Return angular velocities about z [rad/s], shape (offset, body)."""
    return np.column_stack([states[name]["angular_velocity"][:, 2] for name in "ab"])


def _energies(states: Pairs, scene: Scene) -> Array:
    """Return kinetic energies [J], shape (offset, body)."""
    cube = scene.cube
    parts = [
        (np.sum(states[k]["velocity"] ** 2, axis=1), np.sum(states[k]["angular_momentum"] ** 2, axis=1)) for k in "ab"
    ]
    return np.column_stack([(cube.mass * v + p / cube.moment_of_inertia) / 2 for v, p in parts])


def _touch(pose: str, offset: float) -> tuple[Array, Array, Array]:
    """Return the direction of the force on the moving cube, and the arms about both centres in units of the side.

    In the plane of x and y, shape (2,) each; arms not-a-number where the cubes miss each other.
    """
    ahead = POSES[pose][1]
    if pose == "parallel":
        reach, normal, arms = 1.0, [-1.0, 0.0], ([0.5, offset / 2], [-ahead, -offset / 2])
    elif offset <= 0.5:
        reach, normal, arms = 0.5, [-1.0, 0.0], ([0.5, offset], [-ahead, 0.0])
    else:  # an edge of the moving cube on a face of the other
        across = 0.5 - offset
        reach, normal, arms = 0.5 + ahead, [-math.sqrt(0.5), -math.sqrt(0.5)], ([0.5, 0.5], [-ahead - across, across])
    missed = np.nan if offset > reach else 1.0
    return np.array(normal), missed * np.array(arms[0]), missed * np.array(arms[1])


def _by_one_impulse(scene: Scene, pose: str, offset: float, restitution: float, speed: float) -> list[float]:
    """Return the angular velocities about z [rad/s] of both; not-a-number where they miss each other."""
    normal, arm_a, arm_b = _touch(pose, offset)
    cube = scene.cube
    a, b = (cube.side * (x * normal[1] - y * normal[0]) for x, y in (arm_a, arm_b))
    inertia = cube.moment_of_inertia
    impulse = (1 + restitution) * -normal[0] * speed / (2 / cube.mass + (a * a + b * b) / inertia)
    return [impulse * a / inertia, -impulse * b / inertia]

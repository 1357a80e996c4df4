"""How other engines' contacts of two boxes failed, and what they and ours make of the same scenes now.

One dataset, of the scenes in `threads.py`. `energy_ratio`: of a cube thrown at another in steps of 1 ms, against ωh.
`exit_speed`: of a cube put deep in another. `force_change`, `torque_change`: of one box's push on another as it is
turned by next to nothing; `contacts`, `rest_height` and `switches` of a stack. `depth_ratio`: of boxes whose depth is
known otherwise. What one thread complains of, not every method can be asked: not-a-number there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from stiffdice.dynamics.box_contact import law
from stiffdice.dynamics.box_contact.overlap import CONTACT, MOST
from stiffdice.dynamics.box_contact.pair_state import PairPhysics, pair_physics_of, pair_start_of
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench
from stiffdice.dynamics.state import Array
from stiffdice.experiments.measuring import coordinates, mapped, numbers, quantity, result, span
from stiffdice.experiments.pair import threads
from stiffdice.experiments.pair.motion import Motion, Push, Rest, kinetic_of, launched, overlap_of
from stiffdice.scene import validation
from stiffdice.scene.pair import PairScene
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines import registry as engines
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.pair.run import simulate_pair

OURS = "symplectic_euler"
# By method, what it is asked as: with the springs of our law; with its own contact; with another collider.
WAYS = {
    OURS: (OURS,),
    "mujoco": ("mujoco", "mujoco_default", "mujoco_mesh"),
    "drake": ("drake", "drake_default", "drake_convex"),
}
STEP, FINE = 1e-3, 5e-4  # [s] of drake#18241, of mujoco#3476
_PARTED = 0.1  # [s] after which cubes that were deep in each other have parted
_ENERGY_SPEED = "speed at which the cubes would part with all the energy of our springs"

# Which ways are asked what.
_THROWN = (OURS, "mujoco", "mujoco_default", "drake", "drake_default")
_TURNED = (OURS, "mujoco", "mujoco_default")
_POSED = (OURS, "mujoco", "mujoco_mesh", "drake", "drake_convex")

# By name: what is stored of each method.
_VARIABLES = {
    "energy_ratio": ("kinetic energy at the end over that at the launch", "1", "omega_h", "phase"),
    "exit_speed": ("speed at which the cubes part", "m s-1", "depth"),
    "force_change": ("change of the force over the force without the turn", "1", "turn", "angle"),
    "torque_change": ("change of the torque over that force times half of the box's length", "1", "turn", "angle"),
    "contacts": ("contacts found between the boxes", "1", "turn", "angle"),
    "rest_height": ("mean height of the upper box's centre over the last tenth of the run", "m", "twist"),
    "switches": ("how often the boxes part or meet in the run, after its first tenth", "1", "twist"),
    "depth_ratio": ("depth by the deepest contact over the depth", "1", "pose"),
}


@dataclass(frozen=True)
class Ours:
    """Our own law, by the scheme that MuJoCo's Euler is, too."""

    def ended(self, scene: PairScene, h: float) -> Motion:
        """Return how the boxes move at the end; not-a-number where the verdict is `deep`."""
        run = simulate_pair(scene, scheme=OURS, steps=round(scene.duration / h))
        if run.verdict[0] == Verdict.DEEP:
            return Motion(np.full((2, 3), np.nan), np.full((2, 3), np.nan))
        (end,) = run.end
        pair = end["a"], end["b"]
        return Motion(np.array([b["velocity"] for b in pair]), np.array([b["angular_velocity"] for b in pair]))

    def rested(self, scene: PairScene, h: float, margin: float) -> Rest:
        """Return what becomes of a stack; margin: none, as boxes that are apart feel nothing."""
        found = simulate_pair(scene, scheme=OURS, steps=round(scene.duration / h), every=1).trajectory
        assert found is not None
        physics = pair_physics_of(scene)
        contacts = np.array([_contact(physics, pair)[1] for pair in found.state[1:]])
        return Rest(contacts, found.state["b"]["position"][1:, 2])

    def pushed(self, scene: PairScene) -> Push:
        """Return the force on the second box, its torque, and at how many contacts."""
        physics, (pair,) = pair_physics_of(scene), pair_start_of(scene)
        wrench, contacts = _contact(physics, pair)
        return Push(np.array(wrench[:3]), np.array(wrench[3:]), contacts)

    def depth(self, scene: PairScene) -> float:
        """Return how deep one box is in the other, by the deepest contact [m]."""
        (pair,) = pair_start_of(scene)
        _contact(pair_physics_of(scene), pair)
        return float(pair["depth"])


@njit(cache=True)
def _contact(physics: PairPhysics, pair: Any) -> tuple[Wrench, int]:
    """Return force and torque on the second box, and the number of vertices with springs; set how deep the boxes are.

    It is kept on disk, as what it calls is not.
    """
    _, on_b = law.contact_wrenches(physics, pair)
    _, least = law.overlap(physics, pair, np.empty(2 * MOST, CONTACT))
    return on_b, least.number


def _asked(way: str) -> Any:
    """Return the peer that a way names."""
    if way == OURS:
        return Ours()
    if way.startswith("mujoco"):
        from stiffdice.experiments.pair.in_mujoco import Mujoco

        return Mujoco(springs=way == "mujoco", mesh=way == "mujoco_mesh")
    from stiffdice.experiments.pair.in_drake import Drake

    return Drake(springs=way == "drake", convex=way == "drake_convex")


def measure(
    scene: Scene,
    *,
    methods: Sequence[str] = (OURS,),
    omega_h: Sequence[float] = (0.05, 16.0),
    count: int = 21,
    phases: int = 8,
    depth: Sequence[float] = (0.01, 0.03, 0.1, 0.2, 0.3, 0.4, 0.48, 0.52, 0.6, 0.7, 0.8, 0.9),
    angle: Sequence[float] = (1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3),
    duration: float = 1.0,
) -> xr.Dataset:
    """Return what methods make of the scenes of four threads, dimension method and those of each thread.

    scene: none of its numbers is taken, the scenes are those of `threads.py`. methods: symplectic_euler, mujoco, drake.
    omega_h: ends of the span; count: values in it, evenly in their logarithm. phases: of the step at touch-down,
    evenly. depth [1]: shares of a cube's side. angle [rad]: turns, either way. duration [s]: of a stack's rest.
    Raises InputError for a number out of range, an engine that is not installed, and a method that is not of WAYS.
    """
    ways = [way for name in engines.chosen_from(methods, tuple(WAYS)) for way in WAYS[name]]
    turns = numbers("angle", angle, "rad", above=0)
    axes = {
        "omega_h": np.geomspace(*span(omega_h), validation.count("count", count, at_least=2)).tolist(),
        "phase": (np.arange(validation.count("phases", phases)) / phases).tolist(),
        "depth": numbers("depth", depth, "1", above=0),
        "turn": list(threads.TURNS),
        "angle": sorted([*turns, 0.0, *(-part for part in turns)]),
        "twist": [0.0, *turns],
        "pose": list(threads.POSES),
    }
    duration = validation.number("duration", duration, "s", above=0)

    def found_by(way: str) -> tuple[Array, ...]:
        peer = _asked(way)
        thrown = _over(axes, "omega_h phase", _energy_ratio(peer) if way in _THROWN else None)
        speed = _over(axes, "depth", _exit_speed(peer) if way in _THROWN else None)
        pushes = _over(axes, "turn angle", _push(peer) if way in _TURNED else None, 3)
        rests = _over(axes, "twist", _rest(peer, duration) if way in _TURNED else None, 2)
        ratio = _over(axes, "pose", _depth_ratio(peer) if way in _POSED else None)
        return (*thrown, *speed, *pushes, *rests, *ratio)

    variables = mapped(found_by, _VARIABLES, method=ways) | coordinates(**axes)
    deep = [threads.inside(part, 1.0) for part in axes["depth"]]
    variables["energy_speed"] = quantity("depth", [_energy_speed(part) for part in deep], _ENERGY_SPEED, "m s-1")
    known = [overlap_of(threads.posed(pose)) for pose in axes["pose"]]
    variables["known_depth"] = quantity("pose", known, "least way by which the boxes have to be moved apart", "m")
    told = engines.attributes(methods) | {"step": STEP, "fine_step": FINE, "duration": duration}
    return result(variables, "Contacts of two boxes in other engines", scene, "pair", "method", __name__, **told)


def _over(axes: Mapping[str, Sequence[Any]], names: str, asked: Callable[..., Any] | None, width: int = 1) -> Array:
    """Return what is asked at each combination of coordinates, shape (width, ...); not-a-number if nothing is."""
    lists = [axes[name] for name in names.split()]
    shape = width, *map(len, lists)
    if asked is None:
        return np.full(shape, np.nan)
    found = [np.atleast_1d(asked(*place)) for place in itertools.product(*lists)]
    return np.array(found).T.reshape(shape)


def _energy_ratio(peer: Any) -> Callable[[float, float], float]:
    def ratio(omega_h: float, phase: float) -> float:
        scene = threads.thrown(omega_h, STEP, phase)
        return kinetic_of(scene, peer.ended(scene, STEP)) / kinetic_of(scene, launched(scene))

    return ratio


def _exit_speed(peer: Any) -> Callable[[float], float]:
    def speed(depth: float) -> float:
        a, b = peer.ended(threads.inside(depth, _PARTED), FINE).velocity
        return float(np.linalg.norm(b - a))

    return speed


def _energy_speed(scene: PairScene) -> float:
    """Return the speed that the energy of two cubes' springs is worth: √(2 U/m_r), m_r their reduced mass [m/s]."""
    (energy,), _ = law.evaluate(pair_physics_of(scene), pair_start_of(scene))
    reduced = 1.0 / sum(1.0 / cube.mass for cube in scene.cubes)
    return math.sqrt(2 * float(energy) / reduced)


def _push(peer: Any) -> Callable[[str, float], tuple[float, float, float]]:
    def change(turn: str, angle: float) -> tuple[float, float, float]:
        scene = threads.turned(turn, angle)
        flush, push = peer.pushed(threads.turned(turn, 0.0)), peer.pushed(scene)
        size = float(np.linalg.norm(flush.force))
        arm = max(scene.cubes[1].half_sides)
        force = float(np.linalg.norm(push.force - flush.force)) / size
        return force, float(np.linalg.norm(push.torque - flush.torque)) / (size * arm), push.contacts

    return change


def _rest(peer: Any, duration: float) -> Callable[[float], tuple[float, int]]:
    def rest(twist: float) -> tuple[float, int]:
        found = peer.rested(threads.stacked(twist, duration), STEP, threads.MARGIN)
        begun = len(found.height) // 10
        touching = found.contacts[begun:] > 0
        return float(found.height[-begun:].mean()), int((touching[1:] != touching[:-1]).sum())

    return rest


def _depth_ratio(peer: Any) -> Callable[[str], float]:
    def ratio(pose: str) -> float:
        scene = threads.posed(pose)
        return float(peer.depth(scene)) / overlap_of(scene)

    return ratio

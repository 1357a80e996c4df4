"""Which face of a thrown die is up, as soon as that is decided: by energy, not by a time-out.

Over level ground the least potential energy of a body that touches it with its lowest node is m g times the height of
its centre of mass over that node. As a function of the direction down this has a valley for each face and a saddle for
each edge. A body whose mechanical energy is below the lowest saddle around its valley can never leave it, as neither
contact law adds energy. On springs a body may sink in: none of its energies is more than (m g)²/(2S) below that of hard
ground, what one spring holds; the saddles are taken lower by it.

The velocity of a scheme may lag behind the place; the energy is taken with both at one time. For an oscillator that is
at least what symplectic Euler keeps, so that its swing within a contact decides nothing too early.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics import energy
from stiffdice.dynamics.compilation import bits, njit
from stiffdice.dynamics.contact import drags, height_of, lowest_of, speed_of
from stiffdice.dynamics.inertia import half_edge, spins_steadily
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import Array, States, physics_of
from stiffdice.errors import InputError
from stiffdice.integrators import batched_kernel, member_block
from stiffdice.integrators import registry as schemes
from stiffdice.integrators.batched_kernel import Numbers
from stiffdice.integrators.free_flight import landing
from stiffdice.integrators.member_block import ABREAST, WIDTHS
from stiffdice.scene import die
from stiffdice.scene.scene import Scene
from stiffdice.simulation.backend import OURS, setup_of
from stiffdice.simulation.task import System

MODEL, BATCHED = "tumbling", "symplectic_euler"

# Steps between two looks at a member's energy, and looks of a whole run at least.
_LOOK, _LOOKS = 64, 256
# Steps, about, after which compiled code returns, to see signals.
_WORK = 1_000_000
# Of a throw that has not been looked at.
_OPEN = -1
# A throw whose energy is so many times that of its launch has blown up.
_BLOWN = 10.0
# A body that is not decided at the end, but moves with less than this part of what it lacks to tip, leans on an edge.
STILL = 1e-3


class Rest(IntEnum):
    """How sure it is which face is up. The numbers are stored: a new meaning gets a new one."""

    SETTLED = 0
    COCKED = 1
    UNSETTLED = 2
    BLEW_UP = 3

    @property
    def sentence(self) -> str:
        """What it means, for people."""
        return _SENTENCES[self]


_SENTENCES = {
    Rest.SETTLED: "settled: it has not the energy to tip over any edge of the face it is on",
    Rest.COCKED: "cocked: it stands still on an edge or a corner",
    Rest.UNSETTLED: "unsettled: it still had the energy to tip over at the end",
    Rest.BLEW_UP: "blew up: its energy grew beyond ten times the launch's",
}


class Faces(NamedTuple):
    """Of each face, in the order of `die.NORMALS`: height [m] of the centre of mass over it; barrier [J] around it."""

    height: Array
    barrier: Array
    half_sides: Array


class Landing(NamedTuple):
    """How throws ended; first dimension: the throw.

    face: the one up, or nearest to up, 1 to 6, int8. rest: a `Rest`, int8. steps: until it was decided, int64. margin
    [1]: how far the energy was below the barrier then, of the barrier over the face's rest: from 0, hardly, to 1, at
    rest. ends: the last states.
    """

    face: npt.NDArray[np.int8]
    rest: npt.NDArray[np.int8]
    steps: npt.NDArray[np.int64]
    margin: Array
    ends: States


class _Throws(NamedTuple):
    """What the loops read and change; first dimension: the throw. start [J]: the energy of the launch."""

    states: States
    steps: npt.NDArray[np.int64]
    face: npt.NDArray[np.int8]
    rest: npt.NDArray[np.int8]
    margin: Array
    start: Array


class _Common(NamedTuple):
    """What is the same of all throws. every: steps between two looks. lag [steps]: of the velocity."""

    scheme: Any
    width: Any
    posture: Any
    system: System
    k: Numbers
    faces: Faces
    steps: int
    every: int
    lag: float
    tolerance: float
    early_stop: bool


def faces_of(scene: Scene) -> Faces:
    """Return the faces of a scene's body as a landing needs them.

    Raises InputError for ground that is not level, and without gravity: no face is ever decided there.
    """
    if scene.ground.normal != (0.0, 0.0, 1.0) or scene.gravity == 0:
        raise InputError(
            f"ground.normal = {list(scene.ground.normal)}, gravity = {scene.gravity:g}: a die comes to rest on level "
            "ground under gravity; allowed are [0, 0, 1] and a number > 0 [m/s²]"
        )
    half_sides, weight = np.array(scene.cube.half_sides), scene.cube.mass * scene.gravity
    centre = scene.cube.distribution.centre
    sunk = weight * weight / (2 * scene.ground.stiffness) if scene.ground.stiffness > 0 else math.inf
    barrier = weight * die.tipping_heights(half_sides, centre) - sunk
    return Faces(die.rest_heights(half_sides, centre), barrier, half_sides)


@njit
def _below(faces: Faces, state: Any) -> int:
    """Return the index of the face below, as of `die.face_below`."""
    nodes, best, found = state.node_offset, -math.inf, 0
    for face in range(len(faces.height)):
        down = 0.0
        for axis in range(3):
            down -= die.NORMALS[face, axis] * half_edge(nodes, axis).z / faces.half_sides[axis]
        if down / faces.height[face] > best:
            best, found = down / faces.height[face], face
    return found


@njit
def _decide(common: _Common, throws: _Throws, m: int, over: bool) -> bool:
    """Look at a throw after throws.steps[m] steps; return whether it has ended. over: whether no step is left."""
    state, system, faces = throws.states[m], common.system, common.faces
    behind = common.lag * common.k.h
    moving = energy.kinetic_at_place(system.model, system.physics, state, behind)
    high = energy.potential(system.physics, state) + energy.elastic(system.physics, state)
    total, below = moving + high, _below(faces, state)
    rest = system.physics.mass * system.physics.gravity * faces.height[below]
    gap = faces.barrier[below] - rest
    throws.face[m] = len(faces.height) - below
    throws.margin[m] = (faces.barrier[below] - total) / gap
    if gap > 0.0 and total < faces.barrier[below]:
        throws.rest[m] = 0
        return over or common.early_stop
    if not total < throws.start[m] + (_BLOWN - 1.0) * abs(throws.start[m]):
        throws.rest[m] = 3
        return True
    touches = height_of(system.physics, state) <= lowest_of(system.physics, state)
    throws.rest[m] = 1 if touches and moving < STILL * abs(gap) else 2
    return over


@njit
def _fly(common: _Common, throws: _Throws, m: int) -> bool:
    """Take at once the steps in which no node of a throw can touch the ground; return whether there were any."""
    state, system, h = throws.states[m], common.system, common.k.h
    physics = system.physics
    if drags(physics) or not spins_steadily(physics.body):
        return False
    speed, margin = speed_of(physics, state), 4 * h * (abs(speed_of(physics, state)) + h * physics.gravity)
    room = height_of(physics, state) - physics.reach - margin
    if not room > 0.0:
        return False
    most = float(common.steps - throws.steps[m])
    looks = int(min(most, landing(physics.gravity, room, speed - h * physics.gravity) / h)) // common.every
    if looks > 0:
        schemes.flight(common.scheme, system.model, physics, state, h, looks * common.every)
        throws.steps[m] += looks * common.every
    return looks > 0


@njit
def _end_or_go_on(common: _Common, throws: _Throws, m: int) -> bool:
    """Look at a throw, and let it fly; return whether it has ended."""
    while True:
        if _decide(common, throws, m, throws.steps[m] >= common.steps):
            return True
        if not _fly(common, throws, m):
            return False


@njit(cache=True, nogil=True)
def _march(common: _Common, axes: Array, throws: _Throws, block: Array, inside: Any, waiting: int) -> int:
    """Step throws side by side; return the first that waits for a lane, at least 1, or −1 if all have ended.

    All lanes take as many steps between two looks, so that no throw depends on its neighbours. inside: the throw in
    each lane, −1 for none. waiting: what it returned last; 0 to begin with.
    """
    work = 0
    while work < _WORK:
        for lane in range(block.shape[1]):
            m = inside[lane]
            if m >= 0:
                member_block.leave(common.system, axes, block, lane, throws.states[m])
                m = -1 if _end_or_go_on(common, throws, m) else m
            while m < 0 and waiting < len(throws.states):
                m = -1 if _end_or_go_on(common, throws, waiting) else waiting
                waiting += 1
            inside[lane] = m
            if m >= 0:
                member_block.enter(axes, throws.states[m], block, lane)
                throws.steps[m] += common.every
        if inside.max() < 0:
            return -1
        _step(common, block)
        work += common.every * block.shape[1]
    return max(waiting, 1)


@njit
def _step(common: _Common, block: Array) -> None:
    """Take the steps of a block up to the next look."""
    body = member_block.read(common.width, block)
    for _ in range(common.every):
        body = batched_kernel.step(common.system.model, common.posture, common.k, body)
        if bits(batched_kernel.unturned(common.k, body)) != 0:
            member_block.write(block, body)
            for lane in range(block.shape[1]):
                batched_kernel.turn(common.k, block, lane)
            body = member_block.read(common.width, block)
    member_block.write(block, body)


@njit(cache=True, nogil=True)
def _march_alone(common: _Common, throws: _Throws, first: int, most: int) -> int:
    """Step throws from the first on by any scheme, after about `most` work return the next; −1 if all have ended."""
    system, h, work = common.system, common.k.h, 0
    for m in range(first, len(throws.states)):
        while not _end_or_go_on(common, throws, m):
            for _ in range(common.every):
                work += schemes.step(common.scheme, system.model, system.physics, throws.states[m], h, common.tolerance)
            throws.steps[m] += common.every
        if work > most:
            return m + 1
    return -1


def land(
    scene: Scene,
    launches: States,
    *,
    steps: int = 10_000,
    scheme: str = BATCHED,
    tolerance: float = schemes.TOLERANCE,
    early_stop: bool = True,
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Landing:
    """Throw a die many times and return which faces are up.

    scene: the die, the ground, and for how long at most; its launch is not used. launches: STATE records, shape
    (throw,). steps: to the scene's duration, rounded up so that a look at the energy falls on the last. scheme:
    symplectic_euler steps throws side by side, any other one after another. tolerance [1]: of a scheme that controls
    its error. early_stop: end a throw as soon as its face is decided; otherwise at the scene's end. threads: that share
    the throws; no number depends on how many. progress: called with the fraction done.

    Raises InputError for a scheme or a number of steps that is not allowed, and for ground on which nothing comes to
    rest.
    """
    setup = setup_of(scene, MODEL, OURS, scheme, steps)
    system, faces = System(MODELS[MODEL], physics_of(scene)), faces_of(scene)
    every = max(1, min(_LOOK, setup.steps // _LOOKS))
    k = batched_kernel.numbers_of(system.physics, np.eye(3), setup.step_size)
    common = _Common(
        schemes.SCHEMES[setup.scheme],
        ABREAST[MODEL],
        batched_kernel.Tilted(),
        system,
        k,
        faces,
        math.ceil(setup.steps / every) * every,
        every,
        setup.lag,
        tolerance,
        early_stop,
    )
    parts = [_throws(common, part) for part in np.array_split(launches, max(1, min(threads, len(launches))))]
    with ThreadPoolExecutor(len(parts)) as pool:
        marches = [pool.submit(_advance, common, part) for part in parts]
        while any(not march.done() for march in marches):
            wait(marches, timeout=0.2)
            if progress is not None:
                progress(sum(int((part.rest != _OPEN).sum()) for part in parts) / max(1, len(launches)))
    for march in marches:
        march.result()
    whole = _Throws(*(np.concatenate(field) for field in zip(*parts, strict=True)))
    return Landing(whole.face, whole.rest, whole.steps, whole.margin, whole.states)


def _throws(common: _Common, launches: States) -> _Throws:
    """Return throws that stand at their launches."""
    count, late = len(launches), common.lag * common.k.h
    steps, face, rest = np.zeros(count, np.int64), np.zeros(count, np.int8), np.full(count, _OPEN, np.int8)
    return _Throws(
        launches.copy(),
        steps,
        face,
        rest,
        np.zeros(count),
        energy.energies_at_places(*common.system, launches, late)[3],
    )


def _advance(common: _Common, throws: _Throws) -> None:
    """Advance throws to their ends."""
    if common.scheme is not schemes.SCHEMES[BATCHED]:
        following = 0
        while following >= 0:
            following = _march_alone(common, throws, following, _WORK)
        return
    lanes, waiting = WIDTHS[type(common.width)], 0
    block, inside = np.zeros((member_block.ROWS, lanes)), np.full(lanes, -1)
    while waiting >= 0:
        waiting = _march(common, np.eye(3), throws, block, inside, waiting)

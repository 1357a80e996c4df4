"""Many members at once, each watched: `simulate` uses it where steps have to be taken one by one.

The members of a block are stepped side by side (`batched_kernel.py`), and what the criteria could care about is looked
at side by side, too: whether the lowest node is above the ground, and the energy in the air. A member to which
something happens in a step is shown to `monitor.py` and the criteria as it would be by itself: when it touches down or
leaves the ground, in the step after, when its energy passes a limit, when a number leaves the range of doubles, when it
comes to rest. What a flight can skip it skips there. Members need not be at the same step: whoever is done makes room
for the next.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import by_tag, njit
from stiffdice.dynamics.contact import LAWS, swing_square
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.models.sliding import Sliding
from stiffdice.dynamics.models.tumbling import Tumbling
from stiffdice.dynamics.simd import bits, store, where
from stiffdice.dynamics.state import Array, Physics, States
from stiffdice.integrators import batched_kernel
from stiffdice.integrators import registry as schemes
from stiffdice.integrators.batched_kernel import Moving, Numbers, Turning, Vector, dot, inlined, row_of
from stiffdice.scene.scene import Scene
from stiffdice.simulation import fast_forward, monitor
from stiffdice.simulation.criteria.registry import CRITERIA, open_of
from stiffdice.simulation.criteria.registry import observe as criteria_observe
from stiffdice.simulation.reference import none

SCHEME = "symplectic_euler"

# Fewer members than this are quicker one by one.
FEWEST = 4

# Rows of a block below those of `batched_kernel.py`. Of the last step: steps done, clearance [m], largest energy in the
# air so far [J]; of the one before: speed, height, clearance; and the speed of the one before that. What makes a member
# be shown: due, the step count after which it is, limit [J], rest [m²/s²], live: 1, or 0 for a lane nobody is in.
DONE, CLEARANCE, WORST, SPEED, HEIGHT, BEFORE, EARLIER, DUE, LIMIT, REST, LIVE = range(
    batched_kernel.ROWS, batched_kernel.ROWS + 11
)
ROWS = batched_kernel.ROWS + 11

_ENERGY = list(CRITERIA).index("energy")


class Balance(NamedTuple):
    """What energy, flights and rest are told by: m/2, 1/(2I), and along the ground's axes the weight [N].

    lagging [kg m/s] and offset [J]: what the kinetic energy lacks as the velocity lags behind the place. sag [m]:
    as in `monitor.py`; omega [1/s]: of a bounce on four nodes.
    """

    half_mass: float
    half_per_inertia: float
    weight: Vector
    lagging: Vector
    offset: float
    omega: float
    sag: float


@inlined
def _lowest_moving(body: Moving) -> Any:
    return abs(body.levels.x) + abs(body.levels.y) + abs(body.levels.z)


@inlined
def _lowest_turning(body: Turning) -> Any:
    return abs(body.a.z) + abs(body.b.z) + abs(body.c.z)


# (model, body) -> how far below the centre the lowest node is [m].
_lowest = by_tag({Sliding: _lowest_moving, Tumbling: _lowest_turning}, inlined=True)


@inlined
def _motion_moving(e: Balance, body: Moving) -> Any:
    return e.half_mass * dot(body.velocity, body.velocity)


@inlined
def _motion_turning(e: Balance, body: Turning) -> Any:
    turning = e.half_per_inertia * dot(body.momentum, body.momentum)
    return e.half_mass * dot(body.velocity, body.velocity) + turning


# (model, balance, body) -> the kinetic energy [J].
_kinetic = by_tag({Sliding: _motion_moving, Tumbling: _motion_turning}, inlined=True)


@inlined
def _total(a: Vector) -> Any:
    return abs(a.x) + abs(a.y) + abs(a.z)


@inlined
def _size_moving(body: Moving) -> Any:
    return _total(body.place) + _total(body.velocity)


@inlined
def _size_turning(body: Turning) -> Any:
    return _total(body.place) + _total(body.velocity) + _total(body.momentum) + _total(body.a)


# (model, body) -> what is no number below infinity if a part of the state is none.
_size = by_tag({Sliding: _size_moving, Tumbling: _size_turning}, inlined=True)


@inlined
def _settles_moving(e: Balance, h: float, body: Moving, clearance: Any, rest: Any) -> Any:
    rubs = (body.velocity.x != 0.0) | (body.velocity.y != 0.0)
    swing = swing_square(e.omega, h, clearance + e.sag, body.velocity.z)
    return ((clearance < 0.0) & (swing < rest)) | ~rubs


@inlined
def _settles_turning(e: Balance, h: float, body: Turning, clearance: Any, rest: Any) -> Any:
    return clearance > math.inf


# (model, balance, h, body, clearance, rest) -> who is to be shown because it may rest, or no longer slides.
_settles = by_tag({Sliding: _settles_moving, Tumbling: _settles_turning}, inlined=True)


@njit
def _moving_in_steps(state: Any) -> bool:
    """Return whether a cube slides against friction; `pays` has seen to the rest."""
    return state.velocity[0] != 0.0 or state.velocity[1] != 0.0


@njit
def _turning_in_steps(state: Any) -> bool:
    return True


# (model, state) -> whether `fast_forward.py` knows nothing of the motion, so that every step is taken.
_in_steps = by_tag({Sliding: _moving_in_steps, Tumbling: _turning_in_steps}, inlined=True)


@inlined
def _run_on(model: Any, posture: Any, law: Any, k: Numbers, e: Balance, block: Array) -> int:
    """Step a block until something happens to a member; return to whom, lane j as bit j."""
    body = batched_kernel.read(model, block)
    done, clearance = row_of(model, block, DONE), row_of(model, block, CLEARANCE)
    worst, earlier = row_of(model, block, WORST), row_of(model, block, SPEED)
    due, limit, rest = row_of(model, block, DUE), row_of(model, block, LIMIT), row_of(model, block, REST)
    live = row_of(model, block, LIVE) > 0.0
    while True:
        new = batched_kernel.step(model, posture, law, k, body)
        now = new.place.z - _lowest(model, new)
        moving = _kinetic(model, e, new) - dot(e.lagging, new.velocity)
        energy = (moving + dot(e.weight, new.place)) + e.offset
        up = now > 0.0
        happens = (up ^ (clearance > 0.0)) | (done >= due) | (up & (energy > limit)) | ~(_size(model, new) < math.inf)
        happens = live & (happens | _settles(model, e, k.h, new, now, rest))
        happening = bits(happens) | (bits(live) & batched_kernel.unturned(model, k, new))
        done = done + 1.0
        flying = where(up, max(worst, energy), worst)
        if happening != 0:
            batched_kernel.write(model, block, new)
            store(block, DONE, done)
            store(block, CLEARANCE, now)
            store(block, WORST, where(happens, worst, flying))
            store(block, EARLIER, earlier)
            store(block, SPEED, body.velocity.z)
            store(block, HEIGHT, body.place.z)
            store(block, BEFORE, clearance)
            return happening
        body, clearance, worst, earlier = new, now, flying, body.velocity.z


@njit
def _enter(
    scheme: Any,
    model: Any,
    law: Any,
    physics: Physics,
    axes: Array,
    block: Array,
    lane: int,
    state: Any,
    seen: Any,
    remembered: Any,
    done: int,
) -> None:
    """Let a member go on in a lane."""
    batched_kernel.enter(axes, state, block, lane)
    soon = seen.flight == 1.0
    block[REST, lane] = -1.0
    if not models.turns(model) and seen.room > 0.0:
        held = seen.held
        fast_forward.skip(scheme, model, law, physics, state, seen, 0)
        soon = soon or seen.held > held
        swing = fast_forward.resting_swing(law, physics, seen)
        if seen.held == 0.0 and swing > 0.0:
            block[REST, lane] = swing * swing
    block[LIMIT, lane] = math.inf
    if remembered.decided[_ENERGY] == 0 and remembered.limits[_ENERGY] < math.inf:
        above = (remembered.limits[_ENERGY] - 1.0) * remembered.energy[2]
        block[LIMIT, lane] = remembered.energy[1] + above
    block[DONE, lane], block[DUE, lane] = done, done if soon else seen.steps - 1.0
    block[CLEARANCE, lane], block[SPEED, lane] = seen.clearance, seen.speed_before
    block[WORST, lane], block[LIVE, lane] = -math.inf, 1.0


@njit
def _show(
    model: Any,
    law: Any,
    physics: Physics,
    state: Any,
    seen: Any,
    remembered: Any,
    reference: Any,
    step: int,
    flown: int,
) -> bool:
    """Show a step to all who watch; return whether every number is in range."""
    monitor.observe(seen, physics, state, step, flown)
    criteria_observe(remembered, step, seen, model, law, physics, state, reference)
    return remembered.finite[0] == 0.0


@njit
def _come_out(
    model: Any,
    law: Any,
    physics: Physics,
    axes: Array,
    block: Array,
    lane: int,
    state: Any,
    seen: Any,
    remembered: Any,
    reference: Any,
) -> bool:
    """Show the step that a member has just taken in a lane; return whether every number is in range."""
    batched_kernel.leave(model, axes, block, lane, state)
    seen.speed, seen.height, seen.clearance = block[SPEED, lane], block[HEIGHT, lane], block[BEFORE, lane]
    seen.speed_before = block[EARLIER, lane]
    ratio = 1.0 + (block[WORST, lane] - remembered.energy[1]) / remembered.energy[2]
    remembered.energy[0] = max(remembered.energy[0], ratio)
    return _show(model, law, physics, state, seen, remembered, reference, int(block[DONE, lane]), 0)


@njit(cache=True, nogil=True)
def _march(
    scheme: Any,
    model: Any,
    posture: Any,
    law: Any,
    k: Numbers,
    e: Balance,
    axes: Array,
    physics: Physics,
    ensemble: States,
    memory: npt.NDArray[np.void],
    sight: npt.NDArray[np.void],
    steps_done: npt.NDArray[np.int64],
    steps_computed: npt.NDArray[np.int64],
    evaluations: npt.NDArray[np.int64],
    references: npt.NDArray[np.void],
    steps: int,
    block: Array,
) -> int:
    """Advance members in lanes, as long as they have to take steps; return how many are not at their end then."""
    inside = np.full(block.shape[1], -1)  # the member in each lane
    waiting, happening = 0, -1
    while True:
        for lane in range(block.shape[1]):
            if not happening >> lane & 1:
                continue
            m, goes_on = inside[lane], False
            if m >= 0:
                if models.turns(model):
                    batched_kernel.turn(block, lane, k.h)
                taken = int(block[DONE, lane]) - steps_done[m]
                steps_computed[m] += taken
                evaluations[m] += taken
                state, seen, remembered = ensemble[m], sight[m], memory[m]
                in_range = _come_out(model, law, physics, axes, block, lane, state, seen, remembered, references[0])
                steps_done[m] += taken if in_range else taken - 1
                goes_on = in_range and _flies_on(
                    scheme, model, law, physics, state, seen, remembered, references[0], steps_done[m:], steps
                )
            while not goes_on and waiting < ensemble.shape[0]:
                m = waiting
                waiting += 1
                goes_on = _flies_on(
                    scheme, model, law, physics, ensemble[m], sight[m], memory[m], references[0], steps_done[m:], steps
                )
            inside[lane], block[LIVE, lane] = -1, 0.0
            if goes_on:
                inside[lane] = m
                _enter(
                    *(scheme, model, law, physics, axes, block, lane),
                    *(ensemble[m], sight[m], memory[m], steps_done[m]),
                )
        if inside.max() < 0:
            break
        happening = _run_on(model, posture, law, k, e, block)
    left = 0
    for m in range(ensemble.shape[0]):
        if steps_done[m] < steps and open_of(memory[m]) > 0 and memory[m].finite[0] == 0.0:
            left += 1
    return left


@njit
def _flies_on(
    scheme: Any,
    model: Any,
    law: Any,
    physics: Physics,
    state: Any,
    seen: Any,
    remembered: Any,
    reference: Any,
    done: npt.NDArray[np.int64],
    steps: int,
) -> bool:
    """Skip flights; return whether the member then has steps to take; done[0]: of its steps."""
    while done[0] < steps and open_of(remembered) > 0 and _in_steps(model, state):
        flown = fast_forward.free_steps(model, law, physics, state, seen, steps - done[0])
        if flown == 0:
            return True
        schemes.flight(scheme, model, physics, state, seen.step_size, flown)
        if not _show(model, law, physics, state, seen, remembered, reference, done[0] + flown, flown):
            return False
        done[0] += flown
    return False


def march(scene: Scene, model: str, physics: Physics, ensemble: States, watched: Any, steps: int) -> int:
    """Advance all members of a model in `MODELS` as far as they have to be stepped; return how many are to go on.

    watched: what `simulate` keeps of them, begun. `simulate` goes on with those that are left.
    """
    h = scene.duration / steps
    axes = batched_kernel.axes_of(scene)
    k, e = batched_kernel.numbers_of(scene, h), _balance(physics, axes, h, watched.sight)
    if not np.isfinite([*k[:-1], *k.gain, *e[:2], *e.weight, *e.lagging, *e[4:]]).all():
        return len(ensemble)
    left: int = _march(
        schemes.SCHEMES[SCHEME],
        MODELS[model],
        batched_kernel.posture_of(scene, model, ensemble),
        LAWS[scene.ground.contact],
        k,
        e,
        axes,
        physics,
        ensemble,
        *watched,
        none(),
        steps,
        np.zeros((ROWS, batched_kernel.WIDTHS[model])),
    )
    return left


def pays(scene: Scene, model: str, scheme: str, launches: States) -> bool:
    """Return whether members of this scene are stepped side by side: enough of them, whose steps nothing can skip."""
    ground = scene.ground
    if scheme != SCHEME or len(launches) < FEWEST or ground.contact != "ungated":
        return False
    return model == "tumbling" or (model == "sliding" and ground.friction > 0 and ground.normal == (0.0, 0.0, 1.0))


def _balance(physics: Physics, axes: Array, h: float, sight: npt.NDArray[np.void]) -> Balance:
    up = axes[:, 2]
    behind = schemes.LAGS[SCHEME] * h * physics.gravity
    weight, lagging = physics.mass * physics.gravity * up, physics.mass * behind * up
    with np.errstate(all="ignore"):
        per_inertia, omega = (
            np.float64(0.5) / physics.inertia,
            np.sqrt(4 * physics.stiffness / np.float64(physics.mass)),
        )
    return Balance(
        0.5 * physics.mass,
        float(per_inertia),
        Vector(*weight.tolist()),
        Vector(*lagging.tolist()),
        0.5 * physics.mass * behind * behind,
        float(omega),
        float(sight["sag"][0]),
    )

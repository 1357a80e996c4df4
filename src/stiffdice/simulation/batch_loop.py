"""The loop of every run by the paper's scheme whose states are not kept step by step: members side by side.

The members of a block are stepped together (`batched_kernel.py`), and what the criteria could care about is looked at
together, too: whether the lowest node is above the ground, and the energy in the air. A member to which something
happens in a step is shown to `monitor.py` and the criteria: when it touches down or leaves the ground, in the step
after, when its energy passes a limit, when a number leaves the range of doubles, when it comes to rest, and at each
step that is compared with a reference. What `fast_forward.py` can take at once it takes there. Members need not be at
the same step: whoever is done makes room for the next.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import bits, njit, separate, store, where
from stiffdice.dynamics.contact import swing_square
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import TOUCHING, Array, States
from stiffdice.dynamics.vector import Vector, dot, inlined
from stiffdice.integrators import batched_kernel, member_block
from stiffdice.integrators import registry as schemes
from stiffdice.integrators.batched_kernel import Numbers
from stiffdice.integrators.member_block import Alone, row_of
from stiffdice.simulation import fast_forward
from stiffdice.simulation.criteria import energy
from stiffdice.simulation.criteria.registry import CRITERIA, observe, open_of
from stiffdice.simulation.criteria.trajectory import distance
from stiffdice.simulation.task import Limits, Member, Members, System, Task, keep, until_kept

SCHEME = "symplectic_euler"

# Fewer members than this are stepped one by one.
FEWEST = 4

# Longest run of steps in the air until fast-forwarding is tried again, and of any steps until signals are.
LONGEST, _UNSEEN = 64, 50_000

# Steps, about, after which compiled code returns, to see signals and tell progress; and what a member's event counts.
_WORK, _EVENT = 400_000, 10

# Rows of a block below those of `member_block.py`. Since the member's last event: steps, largest energy in the air
# [J]. Of the last step: clearance [m], still: 1 if it changed nothing. Of the one before: speed, height, clearance;
# and the speed of the one before that. What makes an event: due, after so many steps less one, limit [J], rest [m²/s²],
# live: 1, or 0 for a lane nobody is in. seen: 1 if something else than due made one; most: steps until a whole look.
DONE, WORST, CLEARANCE, STILL, SPEED, HEIGHT, BEFORE, EARLIER, DUE, LIMIT, REST, LIVE, SEEN, MOST = range(
    member_block.ROWS, member_block.ROWS + 14
)
ROWS = member_block.ROWS + 14

_ENERGY, _TRAJECTORY = list(CRITERIA).index("energy"), list(CRITERIA).index("trajectory")


class Common(NamedTuple):
    """What is the same of all members; scheme, width and posture are tags.

    Energy, flights and rest are told by m/2, and along the ground's axes the weight [N]. lagging [kg m/s] and
    offset [J]: what the kinetic energy lacks as the velocity lags behind the place. omega [1/s]: of a bounce on four
    nodes; sag [m]: as in `monitor.py`.
    """

    scheme: Any
    width: Any
    posture: Any
    system: System
    k: Numbers
    limits: Limits
    half_mass: float
    weight: Vector
    lagging: Vector
    offset: float
    omega: float
    sag: float


@inlined
def _total(a: Vector) -> Any:
    return abs(a.x) + abs(a.y) + abs(a.z)


@inlined
def _same(a: Vector, b: Vector) -> Any:
    return (a.x == b.x) & (a.y == b.y) & (a.z == b.z)


@inlined
def _run_on(common: Common, block: Array) -> int:
    """Step a block until something happens to a member; return to whom, lane j as bit j."""
    width = common.width
    body = member_block.read(width, block)
    done, worst, clearance = row_of(width, block, DONE), row_of(width, block, WORST), row_of(width, block, CLEARANCE)
    earlier, due, limit = row_of(width, block, SPEED), row_of(width, block, DUE), row_of(width, block, LIMIT)
    rest, live = row_of(width, block, REST), row_of(width, block, LIVE) > 0.0
    while True:
        new = batched_kernel.step(common.system.model, common.posture, common.k, body)
        now = batched_kernel.height_of(common.k.body, common.k, new) - (abs(new.a.z) + abs(new.b.z) + abs(new.c.z))
        # Kinetic energy + m g z, the velocity at the time of the place.
        turning = batched_kernel.turning_energy(common.k.body, common.k, new)
        moving = common.half_mass * dot(new.velocity, new.velocity) + turning
        total = ((moving - dot(common.lagging, new.velocity)) + dot(common.weight, new.place)) + common.offset
        up = now > 0.0
        swing = swing_square(common.omega, common.k.h, now + common.sag, new.velocity.z)
        settles = (swing < rest) | (_same(new.velocity, body.velocity) & (new.momentum.x == body.momentum.x))
        size = _total(new.place) + _total(new.velocity) + _total(new.momentum) + _total(new.a)
        unturned = batched_kernel.unturned(common.k, new)
        happens = (up ^ (clearance > 0.0)) | (up & (total > limit)) | (~up & settles)
        happens = happens | ~(size < math.inf) | unturned
        happening = bits(live & (happens | (done >= due)))
        done = done + 1.0
        flying = where(up, max(worst, total), worst)
        if happening != 0:
            member_block.write(block, new)
            still = _same(new.velocity, body.velocity) & _same(new.place, body.place) & _same(new.a, body.a)
            still = still & _same(new.b, body.b) & _same(new.momentum, body.momentum) & ~unturned
            store(block, DONE, done)
            store(block, CLEARANCE, now)
            store(block, STILL, where(still, 1.0, 0.0))
            store(block, SEEN, where(happens, 1.0, 0.0))
            store(block, WORST, where(happens, worst, flying))
            store(block, EARLIER, earlier)
            store(block, SPEED, body.velocity.z)
            store(block, HEIGHT, body.place.z)
            store(block, BEFORE, clearance)
            return happening
        body, clearance, worst, earlier = new, now, flying, body.velocity.z


@njit
def _only_compared(common: Common, axes: Array, block: Array, lane: int, member: Member, done: int) -> bool:
    """Compare the step that a member has just taken in a lane; return whether that is all there is to see in it."""
    state, sight, memory, reference = member
    taken = block[DONE, lane]
    time = sight.late + (done + int(taken)) * sight.step_size
    if block[SEEN, lane] > 0.0 or taken >= block[MOST, lane] or not time < reference.horizon:
        return False
    state.position[0], state.position[1], state.position[2] = member_block.place_of(axes, block, lane)
    off = distance(reference, time, state) / common.system.physics.radius
    if off > memory.limits[_TRAJECTORY] and memory.decided[_TRAJECTORY] == 0:
        return False
    memory.trajectory[0] = max(memory.trajectory[0], off)
    block[DUE, lane] = taken
    return True


@njit
def _come_out(common: Common, axes: Array, block: Array, lane: int, member: Member, samples: States, done: int) -> int:
    """Show the step that a member has just taken in a lane; return after how many steps in all it now is."""
    state, sight, memory, _ = member
    member_block.leave(common.system, axes, block, lane, state)
    sight.speed, sight.height, sight.clearance = block[SPEED, lane], block[HEIGHT, lane], block[BEFORE, lane]
    sight.speed_before = block[EARLIER, lane]
    energy.count(memory.energy, block[WORST, lane])
    step = done + int(block[DONE, lane])
    lies = memory.energy[3] > 0.0 and sight.still == 0.0  # has never left the ground, and goes on moving
    if block[STILL, lane] > 0.0 and sight.flight == 0.0 and not (member.reference.horizon >= sight.time or lies):
        step = until_kept(common.limits, done)  # the others would not change anything, either
    observe(common.system, member, step, 0)
    if memory.finite[0] > 0.0:
        return step - 1
    keep(common.limits, samples, state, step)
    return step


@separate("Tuple((int64, int64, boolean))")
def _fast_forward(common: Common, member: Member, samples: States, done: int, left: int) -> tuple[int, int, bool]:
    """Take at once what can be; return the steps done, those to take in a lane, 0 at the end, and if any were taken."""
    scheme, system, limits, moved = common.scheme, common.system, common.limits, False
    sight, memory = member.sight, member.memory
    while done < limits.steps and open_of(memory) > 0 and memory.finite[0] == 0.0:
        most = fast_forward.compared(member, until_kept(limits, done) - done)
        flown = fast_forward.fly(scheme, system, member, most)
        if flown > 0:
            moved = True
            observe(system, member, done + flown, flown)
            if memory.finite[0] == 0.0:
                done += flown
                keep(limits, samples, member.state, done)
            continue
        if left <= 0:
            break
        held = sight.held
        skipped = fast_forward.skip(scheme, system, member, most)
        most = min(until_kept(limits, done) - done - skipped, left)
        # Every step counts where the motion is known by phases, has just come to rest or left the ground, or goes on
        # without ever having left it.
        known = sight.held > held or fast_forward.follows(scheme, system, member)
        if known or sight.flight == 1.0 or (memory.energy[3] > 0.0 and sight.still == 0.0):
            most = 1
        elif sight.flight > 0.0 and fast_forward.undisturbed(system, sight) > 0.0:
            most = min(most, LONGEST)
        return done + skipped, min(most, _UNSEEN), moved or skipped > 0
    return done, 0, moved


@njit
def _wait(common: Common, block: Array, lane: int, member: Member, most: int) -> None:
    """Let a member go on in a lane for so many steps, or until something happens."""
    sight, memory = member.sight, member.memory
    block[REST, lane] = fast_forward.rest_of(common.system, sight) if most > 1 else -1.0
    block[LIMIT, lane] = math.inf
    if memory.decided[_ENERGY] == 0 and memory.limits[_ENERGY] < math.inf:
        block[LIMIT, lane] = memory.energy[1] + (memory.limits[_ENERGY] - 1.0) * memory.energy[2]
    block[DONE, lane], block[MOST, lane], block[WORST, lane] = 0.0, most, -math.inf
    block[DUE, lane] = 0.0 if member.reference.horizon >= sight.time else most - 1.0
    block[CLEARANCE, lane], block[SPEED, lane] = sight.clearance, sight.speed_before


@njit(cache=True, nogil=True)
def _march(
    common: Common, axes: Array, members: Members, block: Array, inside: npt.NDArray[np.int64], waiting: int
) -> int:
    """Advance members in lanes; return the first that waits for one, at least 1, or −1 if all are at their end.

    It returns after _WORK, so that Python can see a signal; where it does changes nothing. inside: the member in each
    lane, −1 for none. waiting: what it returned last; 0 to begin with.
    """
    ensemble, sight, memory, references, samples, steps_done, steps_computed, _ = members
    work, happening, budget = 0, -1 if waiting == 0 else 0, common.limits.budget
    while True:
        for lane in range(block.shape[1]):
            if not happening >> lane & 1:
                continue
            m, most, moved = inside[lane], 0, False
            if m >= 0:
                if models.turns(common.system.model):
                    batched_kernel.turn(common.k, block, lane)
                member = Member(ensemble[m], sight[m], memory[m], references[m % len(references)])
                work += _EVENT
                if _only_compared(common, axes, block, lane, member, steps_done[m]):
                    continue
                taken = int(block[DONE, lane])
                steps_computed[m] += taken
                work += taken
                done = _come_out(common, axes, block, lane, member, samples, steps_done[m])
                left = budget - steps_computed[m]
                steps_done[m], most, moved = _fast_forward(common, member, samples, done, left)
            while most == 0 and waiting < len(ensemble):
                m, moved = waiting, True
                waiting += 1
                member = Member(ensemble[m], sight[m], memory[m], references[m % len(references)])
                steps_done[m], most, _ = _fast_forward(common, member, samples, steps_done[m], budget)
            inside[lane] = m if most > 0 else -1
            block[LIVE, lane] = 1.0 if most > 0 else 0.0
            if most > 0:
                if moved:
                    member_block.enter(axes, ensemble[m], block, lane)
                _wait(common, block, lane, member, most)
        if inside.max() < 0:
            return -1
        if work > _WORK:
            return max(waiting, 1)
        happening = _run_on(common, block)


def start(task: Task) -> Callable[[], bool] | None:
    """Return what advances all members for some time and tells whether there is more to do; None as of `march_of`."""
    march = march_of(task)
    if march is None:
        return None
    waiting = 0

    def advance() -> bool:
        nonlocal waiting
        waiting = _march(*march[1][:-1], waiting)
        task.members.evaluations[:] = task.members.steps_computed
        return waiting > 0

    return advance


def march_of(task: Task) -> tuple[Any, tuple[Any, ...]] | None:
    """Return the compiled loop and what it is called with first.

    None for another scheme, a model in which the ground does not act, and where numbers leave the range of doubles
    before the first step.
    """
    setup, system, members = task.setup, task.system, task.members
    scene, model = setup.scene, setup.model
    if setup.scheme != SCHEME or model not in TOUCHING:
        return None
    axes, h, physics, sag = member_block.axes_of(scene), setup.step_size, system.physics, members.sight["sag"][0]
    up, behind = axes[:, 2], schemes.LAGS[SCHEME] * h * physics.gravity
    with np.errstate(all="ignore"):
        weight, lagging = physics.mass * physics.gravity * up, physics.mass * behind * up
        omega = float(np.sqrt(4 * physics.stiffness / np.float64(physics.mass)))
    k, half_mass = batched_kernel.numbers_of(physics, axes, h), 0.5 * physics.mass
    offset = half_mass * behind * behind
    numbers = [*k._replace(onset=0.0)[:-2], *k.gain, half_mass, *weight, *lagging, offset, omega, sag]
    if not np.isfinite(numbers).all():
        return None
    width = Alone() if len(members.ensemble) < FEWEST else member_block.ABREAST[model]
    posture = batched_kernel.posture_of(scene, model, members.ensemble)
    along = Vector(*weight.tolist()), Vector(*lagging.tolist())
    energies = half_mass, *along, offset, omega, float(sag)
    common = Common(schemes.SCHEMES[SCHEME], width, posture, system, k, task.limits, *energies)
    lanes = member_block.WIDTHS[type(width)]
    block, inside = np.zeros((ROWS, lanes)), np.full(lanes, -1)
    return _march, (common, axes, members, block, inside, 0)

"""The ensemble kernel: many members at once by the paper's scheme, a vector register holding a number of several.

The motion is written in the ground's axes, the third along its normal. A cube is three half-edges a, b, c, and its
nodes are at ±a±b±c: their heights, their velocities u + ω × r and the torque of their forces follow from sums and
differences, two by two. The rotation of a step (equation 9) is E + s A + v A², A the matrix of the angle turned, and s
and v are polynomials in its square. So a step branches nowhere and calls nothing that a vector unit cannot do; a member
that turns by more than a radian in a step is turned by itself.

What comes out agrees with `fixed_step.py` to round-off, not to the last bit: sums are made in another order.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import by_tag, njit
from stiffdice.dynamics.contact import LAWS, push
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.models.sliding import Sliding
from stiffdice.dynamics.models.tumbling import Tumbling
from stiffdice.dynamics.models.vertical import Vertical
from stiffdice.dynamics.rotation import along
from stiffdice.dynamics.simd import bits, load, store, where
from stiffdice.dynamics.state import TOUCHING, TURNING, Array, States
from stiffdice.errors import InputError
from stiffdice.scene import validation
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.scene import Scene

# Members side by side: enough for the vector units to have always something to do that does not wait for the step
# before, and not more than registers and the stores behind them hold.
WIDTHS = {"vertical": 64, "sliding": 32, "tumbling": 16}
_VERTICAL, _SLIDING, _TUMBLING = WIDTHS.values()

# Floating-point operations of one step of one member by model and contact law, a flat cube where the model does not
# turn it: each sum, difference, product, quotient, square root and maximum is one, and so two where they are fused;
# signs, comparisons, choices and moves are none (what Intel's counters FP_ARITH_INST_RETIRED count). They are those of
# the compiled loop, counted in it by its test; nothing is skipped, so that every step has as many.
FLOPS = {
    ("vertical", "ungated"): 17,
    ("vertical", "gated"): 13,
    ("sliding", "ungated"): 36,
    ("sliding", "gated"): 32,
    ("tumbling", "ungated"): 421,
    ("tumbling", "gated"): 405,
}


class Vector(NamedTuple):
    """Three numbers along the ground's axes, of one member or of lanes of them."""

    x: Any
    y: Any
    z: Any


class Rising(NamedTuple):
    """The state of `vertical`; levels [m]: of the half-edges."""

    height: Any
    speed: Any
    levels: Vector


class Moving(NamedTuple):
    """The state of `sliding`; levels [m]: of the half-edges."""

    place: Vector
    velocity: Vector
    levels: Vector


class Turning(NamedTuple):
    """The state of `tumbling`; spin [rad/s]: as the nodes' velocities use it; a, b, c [m]: the half-edges."""

    place: Vector
    velocity: Vector
    momentum: Vector
    spin: Vector
    a: Vector
    b: Vector
    c: Vector


class Numbers(NamedTuple):
    """What a step needs to know, SI units; slip: −mu; per_mass: h/m; per_inertia: 1/I; gain: h·gravity."""

    h: float
    stiffness: float
    damping: float
    slip: float
    cutoff: float
    per_mass: float
    per_inertia: float
    gain: Vector


class Flat(NamedTuple):
    """The tag of cubes that do not turn and stand on a face: two of their half-edges are level."""


class Tilted(NamedTuple):
    """The tag of all others."""


# Rows of a block, shape (row, lane): place, velocity, angular momentum, spin and the half-edges a, b, c.
PLACE, VELOCITY, MOMENTUM, SPIN, EDGES = 0, 3, 6, 9, 12
ROWS = 21


def inlined(function: Any) -> Any:
    """Compile a part of a step: put into its caller whatever its size, so that lanes stay in registers."""
    return njit(function, forceinline=True)


@inlined
def plus(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return Vector(a.x + b.x, a.y + b.y, a.z + b.z)


@inlined
def minus(a: Vector, b: Vector) -> Vector:
    """Return a − b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


@inlined
def dot(a: Vector, b: Vector) -> Any:
    """Return a·b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@inlined
def _cross(a: Vector, b: Vector) -> Vector:
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@inlined
def _times(factor: Any, a: Vector) -> Vector:
    return Vector(factor * a.x, factor * a.y, factor * a.z)


@inlined
def _along(start: Vector, factor: Any, a: Vector) -> Vector:
    return Vector(start.x + factor * a.x, start.y + factor * a.y, start.z + factor * a.z)


@inlined
def _flat_push(law: Any, k: Numbers, height: Any, speed: Any, levels: Vector) -> Any:
    half = max(abs(levels.x), abs(levels.y))
    half = max(half, abs(levels.z))
    stiffness, drag = 4.0 * k.stiffness, (4.0 * k.damping) * speed  # of the four nodes of a face
    return push(law, half - height, drag, stiffness) + push(law, -half - height, drag, stiffness)


@inlined
def _edge_push(law: Any, k: Numbers, height: Any, drag: Any, level: Any, c: Any) -> Any:
    return push(law, (level - c) - height, drag, k.stiffness) + push(law, (level + c) - height, drag, k.stiffness)


@inlined
def _face_push(law: Any, k: Numbers, height: Any, drag: Any, level: Any, b: Any, c: Any) -> Any:
    return _edge_push(law, k, height, drag, level - b, c) + _edge_push(law, k, height, drag, level + b, c)


@inlined
def _tilted_push(law: Any, k: Numbers, height: Any, speed: Any, levels: Vector) -> Any:
    drag, a, b, c = k.damping * speed, levels.x, levels.y, levels.z
    return _face_push(law, k, height, drag, -a, b, c) + _face_push(law, k, height, drag, a, b, c)


# (posture, law, k, height, speed, levels) -> the normal force on all nodes of a cube that does not turn [N].
_whole_push = by_tag({Flat: _flat_push, Tilted: _tilted_push}, inlined=True)


@inlined
def _grip(k: Numbers, push: Any, velocity: Vector) -> Any:
    """Return the factor of the tangential velocity that gives the friction, regularised as in `contact.node_force`."""
    return k.slip * push / (math.sqrt(velocity.x * velocity.x + velocity.y * velocity.y) + k.cutoff)


@inlined
def _rise(posture: Any, law: Any, k: Numbers, body: Rising) -> Rising:
    push = _whole_push(posture, law, k, body.height, body.speed, body.levels)
    speed = body.speed + (k.per_mass * push + k.gain.z)
    return Rising(body.height + k.h * speed, speed, body.levels)


@inlined
def _kicked(k: Numbers, velocity: Vector, force: Vector) -> Vector:
    return plus(velocity, _along(k.gain, k.per_mass, force))


@inlined
def _slide(posture: Any, law: Any, k: Numbers, body: Moving) -> Moving:
    push = _whole_push(posture, law, k, body.place.z, body.velocity.z, body.levels)
    grip = _grip(k, push, body.velocity)
    velocity = _kicked(k, body.velocity, Vector(grip * body.velocity.x, grip * body.velocity.y, push))
    return Moving(_along(body.place, k.h, velocity), velocity, body.levels)


@inlined
def _node(law: Any, k: Numbers, height: Any, velocity: Vector) -> Vector:
    """Return the force on one node [N], without its weight."""
    pressed = push(law, -height, k.damping * velocity.z, k.stiffness)
    grip = _grip(k, pressed, velocity)
    return Vector(grip * velocity.x, grip * velocity.y, pressed)


@inlined
def _two(law: Any, k: Numbers, height: Any, velocity: Vector, c: Any, by_c: Vector) -> tuple[Vector, Vector]:
    """Return the sum of the forces on the two nodes at ±c from a point that moves so, and their difference."""
    here = _node(law, k, height + c, plus(velocity, by_c))
    there = _node(law, k, height - c, minus(velocity, by_c))
    return plus(here, there), minus(here, there)


@inlined
def _four(
    law: Any, k: Numbers, height: Any, velocity: Vector, b: Any, by_b: Vector, c: Any, by_c: Vector
) -> tuple[Vector, Vector, Vector]:
    """Return the sum of the forces on the four nodes at ±b±c, and their differences along b and along c."""
    here, here_c = _two(law, k, height + b, plus(velocity, by_b), c, by_c)
    there, there_c = _two(law, k, height - b, minus(velocity, by_b), c, by_c)
    return plus(here, there), minus(here, there), plus(here_c, there_c)


@inlined
def _forces(law: Any, k: Numbers, body: Turning) -> tuple[Vector, Vector]:
    """Return the force on all nodes [N], without their weight, and its torque [N m]: Σ r × f = a × Σ ±f + …"""
    by_a, by_b, by_c = _cross(body.spin, body.a), _cross(body.spin, body.b), _cross(body.spin, body.c)
    height, u = body.place.z, body.velocity
    here, here_b, here_c = _four(law, k, height + body.a.z, plus(u, by_a), body.b.z, by_b, body.c.z, by_c)
    there, there_b, there_c = _four(law, k, height - body.a.z, minus(u, by_a), body.b.z, by_b, body.c.z, by_c)
    about_b, about_c = _cross(body.b, plus(here_b, there_b)), _cross(body.c, plus(here_c, there_c))
    return plus(here, there), plus(_cross(body.a, minus(here, there)), plus(about_b, about_c))


# sin(θ)/θ and (1 − cos(θ))/θ² in powers of θ²: what is left out is below round-off up to 1 rad.
_S = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(9))
_V = tuple((-1.0) ** k / math.factorial(2 * k + 2) for k in range(9))
_S0, _S1, _S2, _S3, _S4, _S5, _S6, _S7, _S8 = _S
_V0, _V1, _V2, _V3, _V4, _V5, _V6, _V7, _V8 = _V


@inlined
def _rotation(q: Any) -> tuple[Any, Any]:
    """Return sin(θ)/θ and (1 − cos(θ))/θ² for θ² = q."""
    sine = _S0 + q * (_S1 + q * (_S2 + q * (_S3 + q * (_S4 + q * (_S5 + q * (_S6 + q * (_S7 + q * _S8)))))))
    versine = _V0 + q * (_V1 + q * (_V2 + q * (_V3 + q * (_V4 + q * (_V5 + q * (_V6 + q * (_V7 + q * _V8)))))))
    return sine, versine


@inlined
def _turned(body: Turning, angle: Vector, sine: Any, versine: Any) -> tuple[Vector, Vector, Vector]:
    """Return the half-edges after a rotation by E + sine A + versine A²: what it adds is small, and so is its error."""
    s, v = _times(sine, angle), _times(versine, angle)
    xx, yy, zz = v.x * angle.x, v.y * angle.y, v.z * angle.z
    xy, yz, zx = v.x * angle.y, v.y * angle.z, v.z * angle.x
    to_x = Vector(-yy - zz, xy - s.z, zx + s.y)
    to_y = Vector(xy + s.z, -xx - zz, yz - s.x)
    to_z = Vector(zx - s.y, yz + s.x, -xx - yy)
    return _added(to_x, to_y, to_z, body.a), _added(to_x, to_y, to_z, body.b), _added(to_x, to_y, to_z, body.c)


@inlined
def _added(to_x: Vector, to_y: Vector, to_z: Vector, edge: Vector) -> Vector:
    return Vector(edge.x + dot(to_x, edge), edge.y + dot(to_y, edge), edge.z + dot(to_z, edge))


@inlined
def _beyond(angle: Vector) -> Any:
    """Return which members turn by more than a radian, so that the polynomials are no good; no number does not."""
    square = dot(angle, angle)
    return (square > 1.0) & (square < math.inf)


@inlined
def _tumble(posture: Any, law: Any, k: Numbers, body: Turning) -> Turning:
    force, torque = _forces(law, k, body)
    velocity = _kicked(k, body.velocity, force)
    momentum = _along(body.momentum, k.h, torque)
    spin = _times(k.per_inertia, momentum)
    angle = _times(k.h, spin)
    sine, versine = _rotation(dot(angle, angle))
    beyond = _beyond(angle)
    edges = _turned(body, angle, where(beyond, 0.0, sine), where(beyond, 0.0, versine))
    return Turning(_along(body.place, k.h, velocity), velocity, momentum, spin, *edges)


# (model, posture, law, k, body) -> the state one step later, but for the turn of members of which `unturned` tells.
step = by_tag({Vertical: _rise, Sliding: _slide, Tumbling: _tumble}, inlined=True)


@inlined
def _none_unturned(k: Numbers, body: Any) -> int:
    return 0


@inlined
def _unturned(k: Numbers, body: Turning) -> int:
    return bits(_beyond(_times(k.h, body.spin)))


# (model, k, body) -> which members the last step has not turned, as they turn by more than a radian; lane j is bit j.
unturned = by_tag({Vertical: _none_unturned, Sliding: _none_unturned, Tumbling: _unturned}, inlined=True)


@njit
def turn(block: Array, lane: int, h: float) -> None:
    """Turn one member by what it turns in a step of h [s], if the step has not."""
    angle = Vector(h * block[SPIN, lane], h * block[SPIN + 1, lane], h * block[SPIN + 2, lane])
    if not _beyond(angle):
        return
    size = math.sqrt(dot(angle, angle))
    sine, versine = math.sin(size) / size, (1.0 - math.cos(size)) / (size * size)
    for edge in range(EDGES, ROWS, 3):
        now = Vector(block[edge, lane], block[edge + 1, lane], block[edge + 2, lane])
        across = _cross(angle, now)
        new = _along(_along(now, sine, across), versine, _cross(angle, across))
        block[edge, lane], block[edge + 1, lane], block[edge + 2, lane] = new


@inlined
def _vertical_row(block: Array, row: int) -> Any:
    return load(block, row, _VERTICAL)


@inlined
def _sliding_row(block: Array, row: int) -> Any:
    return load(block, row, _SLIDING)


@inlined
def _tumbling_row(block: Array, row: int) -> Any:
    return load(block, row, _TUMBLING)


# (model, block, row) -> a row of a block, as wide as the model has it.
row_of = by_tag({Vertical: _vertical_row, Sliding: _sliding_row, Tumbling: _tumbling_row}, inlined=True)


@inlined
def _load(model: Any, block: Array, row: int) -> Vector:
    return Vector(row_of(model, block, row), row_of(model, block, row + 1), row_of(model, block, row + 2))


@inlined
def _store(block: Array, row: int, value: Vector) -> None:
    store(block, row, value.x)
    store(block, row + 1, value.y)
    store(block, row + 2, value.z)


@inlined
def _levels(model: Any, block: Array) -> Vector:
    return Vector(row_of(model, block, EDGES + 2), row_of(model, block, EDGES + 5), row_of(model, block, EDGES + 8))


@inlined
def _read_rising(block: Array) -> Rising:
    model = Vertical()
    return Rising(row_of(model, block, PLACE + 2), row_of(model, block, VELOCITY + 2), _levels(model, block))


@inlined
def _read_moving(block: Array) -> Moving:
    model = Sliding()
    return Moving(_load(model, block, PLACE), _load(model, block, VELOCITY), _levels(model, block))


@inlined
def _read_turning(block: Array) -> Turning:
    model = Tumbling()
    return Turning(
        _load(model, block, PLACE),
        _load(model, block, VELOCITY),
        _load(model, block, MOMENTUM),
        _load(model, block, SPIN),
        _load(model, block, EDGES),
        _load(model, block, EDGES + 3),
        _load(model, block, EDGES + 6),
    )


# (model, block) -> the state of a block's members.
read = by_tag({Vertical: _read_rising, Sliding: _read_moving, Tumbling: _read_turning}, inlined=True)


@inlined
def _write_rising(block: Array, body: Rising) -> None:
    store(block, PLACE + 2, body.height)
    store(block, VELOCITY + 2, body.speed)


@inlined
def _write_moving(block: Array, body: Moving) -> None:
    _store(block, PLACE, body.place)
    _store(block, VELOCITY, body.velocity)


@inlined
def _write_turning(block: Array, body: Turning) -> None:
    _store(block, PLACE, body.place)
    _store(block, VELOCITY, body.velocity)
    _store(block, MOMENTUM, body.momentum)
    _store(block, SPIN, body.spin)
    _store(block, EDGES, body.a)
    _store(block, EDGES + 3, body.b)
    _store(block, EDGES + 6, body.c)


# (model, block, body): put the state of a block's members back.
write = by_tag({Vertical: _write_rising, Sliding: _write_moving, Tumbling: _write_turning}, inlined=True)


@njit
def _to_ground(axes: Array, vector: Any, block: Array, row: int, lane: int) -> None:
    for k in range(3):
        along = axes[k, 0] * vector[0] + axes[k, 1] * vector[1] + axes[k, 2] * vector[2]
        # Where the ground is level nothing changes, and no infinity becomes not-a-number.
        block[row + k, lane] = vector[k] if axes[2, 2] == 1.0 else along


@njit
def _to_world(axes: Array, block: Array, row: int, lane: int, vector: Any) -> None:
    x, y, z = block[row, lane], block[row + 1, lane], block[row + 2, lane]
    for k in range(3):
        along = axes[0, k] * x + axes[1, k] * y + axes[2, k] * z
        vector[k] = block[row + k, lane] if axes[2, 2] == 1.0 else along


@njit
def enter(axes: Array, state: Any, block: Array, lane: int) -> None:
    """Put a STATE record into a lane of a block; axes: the ground's, shape (axis, 3)."""
    _to_ground(axes, state.position, block, PLACE, lane)
    _to_ground(axes, state.velocity, block, VELOCITY, lane)
    _to_ground(axes, state.angular_momentum, block, MOMENTUM, lane)
    _to_ground(axes, state.angular_velocity, block, SPIN, lane)
    nodes = state.node_offset
    for edge in range(3):
        x = y = z = 0.0
        for k in range(nodes.shape[0]):
            x += SIGNS[k, edge] * nodes[k, 0]
            y += SIGNS[k, edge] * nodes[k, 1]
            z += SIGNS[k, edge] * nodes[k, 2]
        _to_ground(axes, (x / 8, y / 8, z / 8), block, EDGES + 3 * edge, lane)


@njit
def _leave_rising(axes: Array, block: Array, lane: int, state: Any) -> None:
    state.position[2], state.velocity[2] = block[PLACE + 2, lane], block[VELOCITY + 2, lane]


@njit
def _leave_moving(axes: Array, block: Array, lane: int, state: Any) -> None:
    _to_world(axes, block, PLACE, lane, state.position)
    _to_world(axes, block, VELOCITY, lane, state.velocity)


@njit
def _leave_turning(axes: Array, block: Array, lane: int, state: Any) -> None:
    _leave_moving(axes, block, lane, state)
    _to_world(axes, block, MOMENTUM, lane, state.angular_momentum)
    _to_world(axes, block, SPIN, lane, state.angular_velocity)
    edges = np.empty((3, 3))
    for edge in range(3):
        _to_world(axes, block, EDGES + 3 * edge, lane, edges[edge])
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        for axis in range(3):
            nodes[k, axis] = SIGNS[k, 0] * edges[0, axis] + SIGNS[k, 1] * edges[1, axis] + SIGNS[k, 2] * edges[2, axis]


# (model, axes, block, lane, state): put what a step changes of a member into its STATE record.
leave = by_tag({Vertical: _leave_rising, Sliding: _leave_moving, Tumbling: _leave_turning}, inlined=True)


@njit(cache=True, nogil=True)
def _advance(
    model: Any, posture: Any, law: Any, k: Numbers, axes: Array, members: States, width: int, steps: int
) -> None:
    """Take so many steps of all members, `width` at a time; the last ones share a block with copies of themselves."""
    block = np.empty((ROWS, width))
    for first in range(0, members.shape[0], width):
        present = min(width, members.shape[0] - first)
        for lane in range(width):
            enter(axes, members[first + lane % present], block, lane)
        body = read(model, block)
        for _ in range(steps):
            body = step(model, posture, law, k, body)
            late = unturned(model, k, body)
            if late != 0:
                write(model, block, body)
                for lane in range(width):
                    if late >> lane & 1:
                        turn(block, lane, k.h)
                body = read(model, block)
        write(model, block, body)
        for lane in range(present):
            leave(model, axes, block, lane, members[first + lane])


def axes_of(scene: Scene) -> Array:
    """Return the ground's axes in the world's, shape (axis, 3), the third its normal; those of the world if level.

    Duff et al. 2017, "Building an orthonormal basis, revisited".
    """
    x, y, z = scene.ground.normal
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    return np.array([[1 + sign * x * x * a, sign * x * y * a, -sign * x], [x * y * a, sign + y * y * a, -y], [x, y, z]])


def numbers_of(scene: Scene, h: float) -> Numbers:
    """Return what a step of h [s] in a scene needs to know."""
    mass, inertia = np.float64(scene.cube.mass), np.float64(scene.cube.moment_of_inertia)
    ground = scene.ground
    with np.errstate(all="ignore"):  # at the extremes these leave the range of doubles, as the steps will
        gain = (-h * scene.gravity * axes_of(scene)[:, 2]).tolist()
        per_mass, per_inertia = float(h / mass), float(1.0 / inertia)
    cutoff = 1e-6 * scene.cube.radius
    return Numbers(h, ground.stiffness, ground.damping, -ground.friction, cutoff, per_mass, per_inertia, Vector(*gain))


def flat(scene: Scene, launches: States) -> bool:
    """Return whether all members stand on a face, to round-off."""
    edges = np.einsum("ke,mkx->mex", SIGNS, launches["node_offset"]) / len(SIGNS)
    levels = np.sort(np.abs(along(edges, scene.ground.normal)), axis=1)
    return bool((levels[:, :2] <= 4 * np.finfo(float).eps * scene.cube.side).all())


def posture_of(scene: Scene, model: str, launches: States) -> Any:
    """Return the tag of how the members stand."""
    return Flat() if model not in TURNING and flat(scene, launches) else Tilted()


def prepare(scene: Scene, model: str, launches: States, steps: int, threads: int = 1) -> Callable[[], States]:
    """Return a function that takes so many steps of all members, from their launches, every time it is called.

    launches: STATE records, shape (member,); the states returned have the same shape. Nothing is watched and nothing
    skipped. threads: among which the members are spread; that changes no bit. Raises InputError for a model that the
    ground does not act on, and for counts out of range.
    """
    if model not in TOUCHING:
        raise InputError(f"model = {model}: allowed is {' or '.join(sorted(TOUCHING))}")
    steps, threads = validation.count("steps", steps), validation.count("threads", threads)
    k, axes, width = numbers_of(scene, scene.duration / steps), axes_of(scene), WIDTHS[model]
    tags = MODELS[model], posture_of(scene, model, launches), LAWS[scene.ground.contact]
    share = -(-len(launches) // threads // width) * width

    def run() -> States:
        members = launches.copy()
        parts = [members[first : first + share] for first in range(0, len(members), share)]
        if len(parts) == 1:
            _advance(*tags, k, axes, members, width, steps)
            return members
        with ThreadPoolExecutor(len(parts)) as pool:
            list(pool.map(lambda part: _advance(*tags, k, axes, part, width, steps), parts))
        return members

    return run

"""The fast kernel of the paper's scheme: members side by side, a vector register holding a number of several.

The motion is written in the ground's axes, the third along its normal. A cube is three half-edges a, b, c, and its
nodes are at ±a±b±c: their heights, their velocities u + ω × r and the torque of their forces follow from sums and
differences, two by two. The rotation of a step (equation 9) is E + s A + v A², A the matrix of the angle turned, and s
and v are polynomials in its square. So a step branches nowhere and calls nothing that a vector unit cannot do; a member
that turns by more than a radian in a step is turned by itself. A member's numbers are the same to the last bit whoever
is beside it.

They agree with the listings' order (`symplectic_euler.py`) to round-off, not to the last bit: sums are in another
order.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import by_tag, njit
from stiffdice.dynamics.contact import push
from stiffdice.dynamics.models.registry import turns
from stiffdice.dynamics.models.sliding import Sliding
from stiffdice.dynamics.models.tumbling import Tumbling
from stiffdice.dynamics.models.vertical import Vertical
from stiffdice.dynamics.rotation import along
from stiffdice.dynamics.simd import load, store, where
from stiffdice.dynamics.state import TURNING, Array, Physics, States
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.scene import Scene


class Vector(NamedTuple):
    """Three numbers along the ground's axes, of one member or of lanes of them."""

    x: Any
    y: Any
    z: Any


class Body(NamedTuple):
    """The state; spin [rad/s]: as the nodes' velocities use it; a, b, c [m]: the half-edges."""

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


class Alone(NamedTuple):
    """The tag of blocks of one member."""


class Sixteen(NamedTuple):
    """The tag of blocks of 16 members."""


class ThirtyTwo(NamedTuple):
    """The tag of blocks of 32 members."""


WIDTHS: dict[type, int] = {Alone: 1, Sixteen: 16, ThirtyTwo: 32}

# Members side by side: enough for the vector units to have always something to do that does not wait for the step
# before, and not more than registers and the stores behind them hold.
ABREAST: dict[str, Any] = {"vertical": ThirtyTwo(), "sliding": ThirtyTwo(), "tumbling": Sixteen()}


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
def _flat_push(law: Any, k: Numbers, body: Body) -> Any:
    half = max(abs(body.a.z), abs(body.b.z))
    half, height = max(half, abs(body.c.z)), body.place.z
    stiffness, drag = 4.0 * k.stiffness, (4.0 * k.damping) * body.velocity.z  # of the four nodes of a face
    return push(law, half - height, drag, stiffness) + push(law, -half - height, drag, stiffness)


@inlined
def _edge_push(law: Any, k: Numbers, height: Any, drag: Any, c: Any) -> Any:
    return push(law, -c - height, drag, k.stiffness) + push(law, c - height, drag, k.stiffness)


@inlined
def _face_push(law: Any, k: Numbers, height: Any, drag: Any, b: Any, c: Any) -> Any:
    return _edge_push(law, k, height + b, drag, c) + _edge_push(law, k, height - b, drag, c)


@inlined
def _tilted_push(law: Any, k: Numbers, body: Body) -> Any:
    height, drag, a, b, c = body.place.z, k.damping * body.velocity.z, body.a.z, body.b.z, body.c.z
    return _face_push(law, k, height + a, drag, b, c) + _face_push(law, k, height - a, drag, b, c)


# (posture, law, k, body) -> the normal force on all nodes of a cube that does not turn [N].
_whole_push = by_tag({Flat: _flat_push, Tilted: _tilted_push}, inlined=True)


@inlined
def _grip(k: Numbers, push: Any, velocity: Vector) -> Any:
    """Return the factor of the tangential velocity that gives the friction, regularised as in `contact.node_force`."""
    return k.slip * push / (math.sqrt(velocity.x * velocity.x + velocity.y * velocity.y) + k.cutoff)


@inlined
def _moved(k: Numbers, body: Body, velocity: Vector) -> Body:
    return Body(_along(body.place, k.h, velocity), velocity, *body[2:])


@inlined
def _kicked(k: Numbers, velocity: Vector, force: Vector) -> Vector:
    return plus(velocity, _along(k.gain, k.per_mass, force))


@inlined
def _rise(posture: Any, law: Any, k: Numbers, body: Body) -> Body:
    u = body.velocity
    return _moved(k, body, Vector(u.x, u.y, u.z + (k.per_mass * _whole_push(posture, law, k, body) + k.gain.z)))


@inlined
def _slide(posture: Any, law: Any, k: Numbers, body: Body) -> Body:
    push = _whole_push(posture, law, k, body)
    grip = _grip(k, push, body.velocity)
    return _moved(k, body, _kicked(k, body.velocity, Vector(grip * body.velocity.x, grip * body.velocity.y, push)))


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
def _forces(law: Any, k: Numbers, body: Body) -> tuple[Vector, Vector]:
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
def _turned(body: Body, angle: Vector, sine: Any, versine: Any) -> tuple[Vector, Vector, Vector]:
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
def _tumble(posture: Any, law: Any, k: Numbers, body: Body) -> Body:
    force, torque = _forces(law, k, body)
    velocity = _kicked(k, body.velocity, force)
    momentum = _along(body.momentum, k.h, torque)
    spin = _times(k.per_inertia, momentum)
    angle = _times(k.h, spin)
    sine, versine = _rotation(dot(angle, angle))
    beyond = _beyond(angle)
    edges = _turned(body, angle, where(beyond, 0.0, sine), where(beyond, 0.0, versine))
    return Body(_along(body.place, k.h, velocity), velocity, momentum, spin, *edges)


# (model, posture, law, k, body) -> the state one step later, but for the turn of members that are `unturned`.
step = by_tag({Vertical: _rise, Sliding: _slide, Tumbling: _tumble}, inlined=True)


@inlined
def unturned(k: Numbers, body: Body) -> Any:
    """Return the mask of members that the last step has not turned, as they turn by more than a radian."""
    return _beyond(_times(k.h, body.spin))


@njit
def _put(block: Array, row: int, lane: int, v: Vector) -> None:
    block[row, lane], block[row + 1, lane], block[row + 2, lane] = v.x, v.y, v.z


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
        _put(block, edge, lane, _along(_along(now, sine, across), versine, _cross(angle, across)))


def _row_of(width: int) -> Any:
    @inlined
    def row_of(block: Array, row: int) -> Any:
        return load(block, row, width)

    return row_of


# (width, block, row) -> a row of a block.
row_of = by_tag({width: _row_of(count) for width, count in WIDTHS.items()}, inlined=True)


@inlined
def _load(width: Any, block: Array, row: int) -> Vector:
    return Vector(row_of(width, block, row), row_of(width, block, row + 1), row_of(width, block, row + 2))


@inlined
def _store(block: Array, row: int, value: Vector) -> None:
    store(block, row, value.x)
    store(block, row + 1, value.y)
    store(block, row + 2, value.z)


@inlined
def read(width: Any, block: Array) -> Body:
    """Return the state of a block's members."""
    return Body(
        _load(width, block, PLACE),
        _load(width, block, VELOCITY),
        _load(width, block, MOMENTUM),
        _load(width, block, SPIN),
        _load(width, block, EDGES),
        _load(width, block, EDGES + 3),
        _load(width, block, EDGES + 6),
    )


@inlined
def write(block: Array, body: Body) -> None:
    """Put the state of a block's members back."""
    _store(block, PLACE, body.place)
    _store(block, VELOCITY, body.velocity)
    _store(block, MOMENTUM, body.momentum)
    _store(block, SPIN, body.spin)
    _store(block, EDGES, body.a)
    _store(block, EDGES + 3, body.b)
    _store(block, EDGES + 6, body.c)


@njit
def _to_ground(axes: Array, v: Any) -> Vector:
    # Where the ground is level nothing changes, and no infinity becomes not-a-number.
    if axes[2, 2] == 1.0:
        return Vector(v[0], v[1], v[2])
    return Vector(
        axes[0, 0] * v[0] + axes[0, 1] * v[1] + axes[0, 2] * v[2],
        axes[1, 0] * v[0] + axes[1, 1] * v[1] + axes[1, 2] * v[2],
        axes[2, 0] * v[0] + axes[2, 1] * v[1] + axes[2, 2] * v[2],
    )


@njit
def _to_world(axes: Array, block: Array, row: int, lane: int) -> Vector:
    v = Vector(block[row, lane], block[row + 1, lane], block[row + 2, lane])
    if axes[2, 2] == 1.0:
        return v
    return Vector(
        axes[0, 0] * v.x + axes[1, 0] * v.y + axes[2, 0] * v.z,
        axes[0, 1] * v.x + axes[1, 1] * v.y + axes[2, 1] * v.z,
        axes[0, 2] * v.x + axes[1, 2] * v.y + axes[2, 2] * v.z,
    )


@njit
def enter(axes: Array, state: Any, block: Array, lane: int) -> None:
    """Put a STATE record into a lane of a block; axes: the ground's, shape (axis, 3)."""
    _put(block, PLACE, lane, _to_ground(axes, state.position))
    _put(block, VELOCITY, lane, _to_ground(axes, state.velocity))
    _put(block, MOMENTUM, lane, _to_ground(axes, state.angular_momentum))
    _put(block, SPIN, lane, _to_ground(axes, state.angular_velocity))
    nodes = state.node_offset
    for edge in range(3):
        x = y = z = 0.0
        for k in range(nodes.shape[0]):
            x += SIGNS[k, edge] * nodes[k, 0]
            y += SIGNS[k, edge] * nodes[k, 1]
            z += SIGNS[k, edge] * nodes[k, 2]
        _put(block, EDGES + 3 * edge, lane, _to_ground(axes, (x / 8, y / 8, z / 8)))


@njit
def place_of(axes: Array, block: Array, lane: int) -> Vector:
    """Return the place of a member in a lane along the world's axes [m]."""
    return _to_world(axes, block, PLACE, lane)


@njit
def leave(model: Any, axes: Array, block: Array, lane: int, state: Any) -> None:
    """Put what a step changes of a member into its STATE record."""
    state.position[0], state.position[1], state.position[2] = place_of(axes, block, lane)
    state.velocity[0], state.velocity[1], state.velocity[2] = _to_world(axes, block, VELOCITY, lane)
    if not turns(model):
        return
    momentum, spin = state.angular_momentum, state.angular_velocity
    momentum[0], momentum[1], momentum[2] = _to_world(axes, block, MOMENTUM, lane)
    spin[0], spin[1], spin[2] = _to_world(axes, block, SPIN, lane)
    a = _to_world(axes, block, EDGES, lane)
    b = _to_world(axes, block, EDGES + 3, lane)
    c = _to_world(axes, block, EDGES + 6, lane)
    nodes = state.node_offset
    for k in range(nodes.shape[0]):
        for axis in range(3):
            nodes[k, axis] = SIGNS[k, 0] * a[axis] + SIGNS[k, 1] * b[axis] + SIGNS[k, 2] * c[axis]


def axes_of(scene: Scene) -> Array:
    """Return the ground's axes in the world's, shape (axis, 3), the third its normal; those of the world if level.

    Duff et al. 2017, "Building an orthonormal basis, revisited".
    """
    x, y, z = scene.ground.normal
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    return np.array([[1 + sign * x * x * a, sign * x * y * a, -sign * x], [x * y * a, sign + y * y * a, -y], [x, y, z]])


def numbers_of(physics: Physics, axes: Array, h: float) -> Numbers:
    """Return what a step of h [s] needs to know; axes: the ground's, shape (axis, 3)."""
    mass, inertia = np.float64(physics.mass), np.float64(physics.inertia)
    with np.errstate(all="ignore"):  # at the extremes these leave the range of doubles, as the steps will
        gain = Vector(*(-h * physics.gravity * axes[:, 2]).tolist())
        per_mass, per_inertia = float(h / mass), float(1.0 / inertia)
    slip, cutoff = -physics.friction, physics.cutoff
    return Numbers(h, physics.stiffness, physics.damping, slip, cutoff, per_mass, per_inertia, gain)


def flat(scene: Scene, launches: States) -> bool:
    """Return whether all members stand on a face, to round-off."""
    edges = np.einsum("ke,mkx->mex", SIGNS, launches["node_offset"]) / len(SIGNS)
    levels = np.sort(np.abs(along(edges, scene.ground.normal)), axis=1)
    return bool((levels[:, :2] <= 4 * np.finfo(float).eps * scene.cube.side).all())


def posture_of(scene: Scene, model: str, launches: States) -> Any:
    """Return the tag of how the members stand."""
    return Flat() if model not in TURNING and flat(scene, launches) else Tilted()

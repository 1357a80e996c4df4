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
from collections import namedtuple
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import by_tag, njit, where
from stiffdice.dynamics.contact import push
from stiffdice.dynamics.inertia import (
    AnyAngle,
    Box,
    Isotropic,
    SmallAngle,
    combined,
    freely_turned,
    small_rotation,
    spin_about,
)
from stiffdice.dynamics.models.sliding import Sliding
from stiffdice.dynamics.models.tumbling import Tumbling
from stiffdice.dynamics.models.vertical import Vertical
from stiffdice.dynamics.state import TURNING, Array, Physics, States
from stiffdice.dynamics.vector import Vector, cross, dot, inlined, minus, norm, plus, plus_times, times
from stiffdice.integrators.member_block import EDGES, MOMENTUM, ROWS, SPIN, Body, member, put
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.rotation import along
from stiffdice.scene.scene import Scene


class Numbers(NamedTuple):
    """What a step needs to know, SI units.

    onset: of the law; slip: −mu; per_mass: h/m; per_inertia: 1/I; gain: h g.

    body: of `inertia.py`.
    """

    h: float
    stiffness: float
    damping: float
    onset: float
    slip: float
    cutoff: float
    per_mass: float
    per_inertia: float
    gain: Vector
    body: Any


@inlined
def _centre(k: Numbers, body: Body) -> Vector:
    """Return the centre of a box from its centre of mass [m]."""
    return combined(k.body.centre, body.a, body.b, body.c)


# Of the centre of a box, whose half-edges lead to its nodes: (body of `inertia.py`, k, body) -> its height [m], its
# velocity [m/s]; and the torque about the centre of mass of a force with a torque about that of the box.
height_of = by_tag(
    {
        Isotropic: inlined(lambda k, body: body.place.z),
        Box: inlined(lambda k, body: body.place.z + _centre(k, body).z),
    },
    inlined=True,
)
_velocity_of = by_tag(
    {
        Isotropic: inlined(lambda k, body: body.velocity),
        Box: inlined(lambda k, body: plus(body.velocity, cross(body.spin, _centre(k, body)))),
    },
    inlined=True,
)
_about_mass = by_tag(
    {
        Isotropic: inlined(lambda k, body, force, torque: torque),
        Box: inlined(lambda k, body, force, torque: plus(torque, cross(_centre(k, body), force))),
    },
    inlined=True,
)


# How cubes that do not turn stand: on a face, so that two of their half-edges are level, or otherwise.
Flat = namedtuple("Flat", ())
Tilted = namedtuple("Tilted", ())


@inlined
def _flat_push(k: Numbers, body: Body) -> Any:
    half = max(abs(body.a.z), abs(body.b.z))
    half, height = max(half, abs(body.c.z)), height_of(k.body, k, body)
    stiffness, drag = 4.0 * k.stiffness, (4.0 * k.damping) * body.velocity.z  # of the four nodes of a face
    return push(k.onset, half - height, drag, stiffness) + push(k.onset, -half - height, drag, stiffness)


@inlined
def _edge_push(k: Numbers, height: Any, drag: Any, c: Any) -> Any:
    return push(k.onset, -c - height, drag, k.stiffness) + push(k.onset, c - height, drag, k.stiffness)


@inlined
def _face_push(k: Numbers, height: Any, drag: Any, b: Any, c: Any) -> Any:
    return _edge_push(k, height + b, drag, c) + _edge_push(k, height - b, drag, c)


@inlined
def _tilted_push(k: Numbers, body: Body) -> Any:
    height, drag = height_of(k.body, k, body), k.damping * body.velocity.z
    a, b, c = body.a.z, body.b.z, body.c.z
    return _face_push(k, height + a, drag, b, c) + _face_push(k, height - a, drag, b, c)


# (posture, k, body) -> the normal force on all nodes of a cube that does not turn [N].
_whole_push = by_tag({Flat: _flat_push, Tilted: _tilted_push}, inlined=True)


@inlined
def _grip(k: Numbers, push: Any, velocity: Vector) -> Any:
    """Return the factor of the tangential velocity that gives the friction, regularised as in `contact.node_force`."""
    return k.slip * push / (math.sqrt(velocity.x * velocity.x + velocity.y * velocity.y) + k.cutoff)


@inlined
def _moved(k: Numbers, body: Body, velocity: Vector) -> Body:
    return Body(plus_times(body.place, k.h, velocity), velocity, *body[2:])


@inlined
def _kicked(k: Numbers, velocity: Vector, force: Vector) -> Vector:
    return plus(velocity, plus_times(k.gain, k.per_mass, force))


@inlined
def _rise(posture: Any, k: Numbers, body: Body) -> Body:
    u = body.velocity
    return _moved(k, body, Vector(u.x, u.y, u.z + (k.per_mass * _whole_push(posture, k, body) + k.gain.z)))


@inlined
def _slide(posture: Any, k: Numbers, body: Body) -> Body:
    push = _whole_push(posture, k, body)
    grip = _grip(k, push, body.velocity)
    return _moved(k, body, _kicked(k, body.velocity, Vector(grip * body.velocity.x, grip * body.velocity.y, push)))


@inlined
def _node(k: Numbers, height: Any, velocity: Vector) -> Vector:
    """Return the force on one node [N], without its weight."""
    pressed = push(k.onset, -height, k.damping * velocity.z, k.stiffness)
    grip = _grip(k, pressed, velocity)
    return Vector(grip * velocity.x, grip * velocity.y, pressed)


@inlined
def _two(k: Numbers, height: Any, velocity: Vector, c: Any, by_c: Vector) -> tuple[Vector, Vector]:
    """Return the sum of the forces on the two nodes at ±c from a point that moves so, and their difference."""
    here = _node(k, height + c, plus(velocity, by_c))
    there = _node(k, height - c, minus(velocity, by_c))
    return plus(here, there), minus(here, there)


@inlined
def _four(
    k: Numbers, height: Any, velocity: Vector, b: Any, by_b: Vector, c: Any, by_c: Vector
) -> tuple[Vector, Vector, Vector]:
    """Return the sum of the forces on the four nodes at ±b±c, and their differences along b and along c."""
    here, here_c = _two(k, height + b, plus(velocity, by_b), c, by_c)
    there, there_c = _two(k, height - b, minus(velocity, by_b), c, by_c)
    return plus(here, there), minus(here, there), plus(here_c, there_c)


@inlined
def _forces(k: Numbers, body: Body) -> tuple[Vector, Vector]:
    """Return the force on all nodes [N], without their weight, and its torque [N m]: Σ r × f = a × Σ ±f + …"""
    by_a, by_b, by_c = cross(body.spin, body.a), cross(body.spin, body.b), cross(body.spin, body.c)
    height, u = height_of(k.body, k, body), _velocity_of(k.body, k, body)
    here, here_b, here_c = _four(k, height + body.a.z, plus(u, by_a), body.b.z, by_b, body.c.z, by_c)
    there, there_b, there_c = _four(k, height - body.a.z, minus(u, by_a), body.b.z, by_b, body.c.z, by_c)
    about_b, about_c = cross(body.b, plus(here_b, there_b)), cross(body.c, plus(here_c, there_c))
    force = plus(here, there)
    torque = plus(cross(body.a, minus(here, there)), plus(about_b, about_c))
    return force, _about_mass(k.body, k, body, force, torque)


@inlined
def _turned(body: Body, angle: Vector, sine: Any, versine: Any) -> tuple[Vector, Vector, Vector]:
    """Return the half-edges after a rotation by E + sine A + versine A²: what it adds is small, and so is its error."""
    s, v = times(sine, angle), times(versine, angle)
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
def _tumble(posture: Any, k: Numbers, body: Body) -> Body:
    force, torque = _forces(k, body)
    velocity = _kicked(k, body.velocity, force)
    momentum = plus_times(body.momentum, k.h, torque)
    return _spun(k.body, k, body, velocity, momentum)


@inlined
def _spun_steadily(k: Numbers, body: Body, velocity: Vector, momentum: Vector) -> Body:
    spin = times(k.per_inertia, momentum)
    angle = times(k.h, spin)
    sine, versine = small_rotation(dot(angle, angle))
    beyond = _beyond(angle)
    edges = _turned(body, angle, where(beyond, 0.0, sine), where(beyond, 0.0, versine))
    return Body(plus_times(body.place, k.h, velocity), velocity, momentum, spin, *edges)


@inlined
def _spun_freely(k: Numbers, body: Body, velocity: Vector, momentum: Vector) -> Body:
    angle = times(k.h, spin_about(k.body, momentum, body.a, body.b, body.c))
    h = where(_beyond(angle), 0.0, k.h)
    edges = freely_turned(SmallAngle(), k.body, momentum, h, body.a, body.b, body.c)
    spin = spin_about(k.body, momentum, *edges)
    return Body(plus_times(body.place, k.h, velocity), velocity, momentum, spin, *edges)


# (body of `inertia.py`, k, body, velocity, momentum) -> the state with these, moved and turned for a step.
_spun = by_tag({Isotropic: _spun_steadily, Box: _spun_freely}, inlined=True)


# (model, posture, k, body) -> the state one step later, but for the turn of members that are `unturned`.
step = by_tag({Vertical: _rise, Sliding: _slide, Tumbling: _tumble}, inlined=True)


@inlined
def unturned(k: Numbers, body: Body) -> Any:
    """Return the mask of members that the last step has not turned, as they turn by more than a radian."""
    return _beyond(times(k.h, body.spin))


@njit
def turn(k: Numbers, block: Array, lane: int) -> None:
    """Turn one member by what it turns in a step, if the step has not."""
    angle = times(k.h, member(block, SPIN, lane))
    if _beyond(angle):
        _turn_far(k.body, k, block, lane, angle)


@njit
def _turn_steadily(k: Numbers, block: Array, lane: int, angle: Vector) -> None:
    size = norm(angle)
    sine, versine = math.sin(size) / size, (1.0 - math.cos(size)) / (size * size)
    for edge in range(EDGES, ROWS, 3):
        now = member(block, edge, lane)
        across = cross(angle, now)
        put(block, edge, lane, plus_times(plus_times(now, sine, across), versine, cross(angle, across)))


@njit
def _turn_freely(k: Numbers, block: Array, lane: int, angle: Vector) -> None:
    a, b, c = member(block, EDGES, lane), member(block, EDGES + 3, lane), member(block, EDGES + 6, lane)
    momentum = member(block, MOMENTUM, lane)
    a, b, c = freely_turned(AnyAngle(), k.body, momentum, k.h, a, b, c)
    put(block, EDGES, lane, a)
    put(block, EDGES + 3, lane, b)
    put(block, EDGES + 6, lane, c)
    put(block, SPIN, lane, spin_about(k.body, momentum, a, b, c))


# (body of `inertia.py`, k, block, lane, angle): turn a member that turns by more than a radian.
_turn_far = by_tag({Isotropic: _turn_steadily, Box: _turn_freely})

# (body of `inertia.py`, k, body) -> the energy of rotation [J].
turning_energy = by_tag(
    {
        Isotropic: inlined(lambda k, body: (0.5 * k.per_inertia) * dot(body.momentum, body.momentum)),
        Box: inlined(lambda k, body: 0.5 * dot(body.momentum, body.spin)),
    },
    inlined=True,
)


def numbers_of(physics: Physics, axes: Array, h: float) -> Numbers:
    """Return what a step of h [s] needs to know; axes: the ground's, shape (axis, 3)."""
    mass, inertia = np.float64(physics.mass), np.float64(physics.inertia)
    with np.errstate(all="ignore"):  # at the extremes these leave the range of doubles, as the steps will
        gain = Vector(*(-h * physics.gravity * axes[:, 2]).tolist())
        per_mass, per_inertia = float(h / mass), float(1.0 / inertia)
    slip, cutoff = -physics.friction, physics.cutoff
    forces = physics.stiffness, physics.damping, physics.onset, slip, cutoff
    return Numbers(h, *forces, per_mass, per_inertia, gain, physics.body)


def posture_of(scene: Scene, model: str, launches: States) -> Any:
    """Return the tag of how the members stand: flat if none turns and all are on a face, to round-off."""
    edges = np.einsum("ke,mkx->mex", SIGNS, launches["node_offset"]) / len(SIGNS)
    levels = np.sort(np.abs(along(edges, scene.ground.normal)), axis=1)
    flat = (levels[:, :2] <= 8 * np.finfo(float).eps * min(scene.cube.half_sides)).all()
    return Flat() if model not in TURNING and flat else Tilted()

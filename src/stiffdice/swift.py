"""Symplectic Euler, fast: the same motion as `schemes/symplectic_euler.py` steps, to round-off.

That kernel adds in the listings' order, node by node, and turns all eight. This one keeps three half edges a, b, c
instead (the nodes are ±a ±b ±c) and the rotation of one step, which changes only where a torque does; asks first
whether any node can feel the ground; and where one does treats all eight alike, so that they share a vector register.
Until the first touch-down the two agree to round-off, and after it as long as anything does that differs in the last
place: `docs/speed.md`. Nothing here is fused, nor summed in an order that the processor chooses, and nothing but the
rotation by more than a quarter of a radian calls a library: the same numbers on every machine.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from stiffdice import checks, compiled, models
from stiffdice.contact import LAWS, acts, normal_force, swing_square
from stiffdice.cube import SIGNS
from stiffdice.models import MODELS
from stiffdice.scene import Scene
from stiffdice.state import Physics, States, physics_of, start_of

Vector = tuple[float, float, float]
Matrix = tuple[Vector, Vector, Vector]  # its rows

# Of the nodes, in the order of the listings.
_A, _B, _C = (np.ascontiguousarray(SIGNS[:, axis]) for axis in range(3))
_NODES = len(SIGNS)

# Steps in a row that nobody looks at: what might take many at once is asked in between.
LONGEST = 64

# What every node feels: force [N] and torque [N m]. In a record, because an array would cost a reference count.
ROOM = np.dtype([("felt", np.float64, (6, _NODES))])

# Up to the first of these angles, squared, three terms of a rotation's series are exact; up to the second, six are.
_TINY, _SMALL = 1e-5, 0.0625


def njit(function: Any) -> Any:
    """Compile with sums reordered and fused with products; infinities and not-a-number are kept."""
    return compiled.njit(function, forceinline=True)


@compiled.njit(forceinline=True)
def _moved(model: Any, p: Vector, q: Vector, factor: Any) -> Vector:
    """Return p + factor·q, not fused: each step waits for the sum, which alone is done in half the time."""
    if models.rises_only(model):
        return p[0], p[1], p[2] + factor * q[2]
    return p[0] + factor * q[0], p[1] + factor * q[1], p[2] + factor * q[2]


class Body(NamedTuple):
    """A state as this kernel keeps it, in registers.

    place [m], velocity [m/s], momentum: the angular one [kg m²/s]; spin [rad/s], as the nodes' velocities use it; half
    edges a, b, c [m]; turned: the rotation of one step at the spin of the momentum.
    """

    place: Vector
    velocity: Vector
    momentum: Vector
    spin: Vector
    a: Vector
    b: Vector
    c: Vector
    turned: Matrix


@njit
def _dot(p: Vector, q: Vector) -> float:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


@njit
def _up(model: Any, normal: Vector, p: Vector) -> float:
    """Return the part of a vector along the ground's normal."""
    return p[2] if models.rises_only(model) else _dot(normal, p)


@njit
def _cross(p: Vector, q: Vector) -> Vector:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


@njit
def _corner(a: Vector, b: Vector, c: Vector, i: Any, j: Any, k: Any) -> Vector:
    """Return i·a + j·b + k·c, with signs i, j, k."""
    return i * a[0] + j * b[0] + k * c[0], i * a[1] + j * b[1] + k * c[1], i * a[2] + j * b[2] + k * c[2]


@njit
def _sum(p: Vector, q: Vector) -> Vector:
    return p[0] + q[0], p[1] + q[1], p[2] + q[2]


@njit
def _scaled(p: Vector, factor: Any) -> Vector:
    return p[0] * factor, p[1] * factor, p[2] * factor


@njit
def _times(rows: Matrix, p: Vector) -> Vector:
    return _dot(rows[0], p), _dot(rows[1], p), _dot(rows[2], p)


@njit
def _rotation(v: Vector) -> Matrix:
    """Return the rotation by a vector [rad], E + (sin θ/θ) V + ((1 − cos θ)/θ²) V² (Rodrigues; equation 9)."""
    q = _dot(v, v)
    if q < _TINY:
        s = 1 - q * (1 / 6 - q * (1 / 120))
        w = 1 / 2 - q * (1 / 24 - q * (1 / 720))
    elif q < _SMALL:
        s = 1 - q * (1 / 6 - q * (1 / 120 - q * (1 / 5040 - q * (1 / 362880 - q * (1 / 39916800)))))
        w = 1 / 2 - q * (1 / 24 - q * (1 / 720 - q * (1 / 40320 - q * (1 / 3628800 - q * (1 / 479001600)))))
    else:
        angle = math.sqrt(q)
        s, w = math.sin(angle) / angle, 2 * (math.sin(angle / 2) / angle) ** 2
    x, y, z = v
    sx, sy, sz = s * x, s * y, s * z
    wx, wy, wz = w * x, w * y, w * z
    return (
        (1 - (wy * y + wz * z), wx * y - sz, wx * z + sy),
        (wx * y + sz, 1 - (wx * x + wz * z), wy * z - sx),
        (wx * z - sy, wy * z + sx, 1 - (wx * x + wy * y)),
    )


@njit
def _taken(model: Any, physics: Physics, state: Any, h: float) -> Body:
    """Return the body of a state."""
    n, p, u, w = state.node_offset, state.position, state.velocity, state.angular_velocity
    momentum = (state.angular_momentum[0], state.angular_momentum[1], state.angular_momentum[2])
    return Body(
        (p[0], p[1], p[2]),
        (u[0], u[1], u[2]),
        momentum,
        (w[0], w[1], w[2]),
        ((n[0, 0] - n[3, 0]) / 2, (n[0, 1] - n[3, 1]) / 2, (n[0, 2] - n[3, 2]) / 2),
        ((n[0, 0] - n[1, 0]) / 2, (n[0, 1] - n[1, 1]) / 2, (n[0, 2] - n[1, 2]) / 2),
        ((n[0, 0] - n[4, 0]) / 2, (n[0, 1] - n[4, 1]) / 2, (n[0, 2] - n[4, 2]) / 2),
        _rotation(_scaled(momentum, h / physics.inertia)),
    )


@njit
def _give(model: Any, physics: Physics, body: Body, state: Any) -> None:
    """Write a body into a state."""
    for axis in range(3):
        state.position[axis] = body.place[axis]
        state.velocity[axis] = body.velocity[axis]
    if models.turns(model):
        for axis in range(3):
            state.angular_momentum[axis] = body.momentum[axis]
            state.angular_velocity[axis] = body.spin[axis]
        for k in range(_NODES):
            for axis in range(3):
                state.node_offset[k, axis] = _A[k] * body.a[axis] + _B[k] * body.b[axis] + _C[k] * body.c[axis]


@njit
def _clearance(model: Any, normal: Vector, body: Body) -> float:
    """Return the height of the lowest node above the ground [m]."""
    below = abs(_up(model, normal, body.a)) + abs(_up(model, normal, body.b)) + abs(_up(model, normal, body.c))
    return _up(model, normal, body.place) - below


@njit
def _slowest(model: Any, normal: Vector, body: Body) -> float:
    """Return the speed away from the ground of the node where it is lowest [m/s]."""
    if not models.turns(model):
        return _up(model, normal, body.velocity)
    rolling = _cross(normal, body.spin)
    below = abs(_dot(rolling, body.a)) + abs(_dot(rolling, body.b)) + abs(_dot(rolling, body.c))
    return _dot(normal, body.velocity) - below


@njit
def _push(model: Any, law: Any, physics: Physics, normal: Vector, body: Body, room: Any) -> tuple[Vector, Vector]:
    """Return the ground's force [N] and torque [N m], normal forces and friction of all nodes as in `contact.py`."""
    height, speed = _up(model, normal, body.place), _up(model, normal, body.velocity)
    ha, hb, hc = _up(model, normal, body.a), _up(model, normal, body.b), _up(model, normal, body.c)
    va, vb, vc = _cross(body.spin, body.a), _cross(body.spin, body.b), _cross(body.spin, body.c)
    u = body.velocity
    for node in range(_NODES):
        i, j, k = _A[node], _B[node], _C[node]
        depth = -(height + (i * ha + j * hb + k * hc))
        if models.rises_only(model):
            room.felt[2, node] = normal_force(law, depth, speed, physics.stiffness, physics.damping)
            continue
        if models.turns(model):
            u = _sum(body.velocity, _corner(va, vb, vc, i, j, k))
        up = _dot(normal, u)
        fn = normal_force(law, depth, up, physics.stiffness, physics.damping)
        along = _moved(model, u, normal, -up)
        grip = physics.friction * fn / (math.sqrt(_dot(along, along)) + physics.cutoff)
        force = _moved(model, _scaled(normal, fn), along, -grip)
        room.felt[0, node], room.felt[1, node], room.felt[2, node] = force
        if models.turns(model):
            torque = _cross(_corner(body.a, body.b, body.c, i, j, k), force)
            room.felt[3, node], room.felt[4, node], room.felt[5, node] = torque
    if models.rises_only(model):
        return (0.0, 0.0, _total(room, 2)), (0.0, 0.0, 0.0)
    force = _total(room, 0), _total(room, 1), _total(room, 2)
    if not models.turns(model):
        return force, (0.0, 0.0, 0.0)
    return force, (_total(room, 3), _total(room, 4), _total(room, 5))


@njit
def _total(room: Any, part: int) -> float:
    """Return the sum over all nodes."""
    n = room.felt[part]
    return ((n[0] + n[1]) + (n[2] + n[3])) + ((n[4] + n[5]) + (n[6] + n[7]))


@njit
def _stepped(model: Any, law: Any, physics: Physics, normal: Vector, body: Body, room: Any, h: float) -> Body:
    """Return the body after a step of h [s] (equations 6 to 9)."""
    velocity, momentum, turned = body.velocity, body.momentum, body.turned
    if models.touches(model) and acts(law, _clearance(model, normal, body), _slowest(model, normal, body)):
        force, torque = _push(model, law, physics, normal, body, room)
        velocity = _moved(model, velocity, force, h / physics.mass)
        if models.turns(model):
            momentum = _moved(model, momentum, torque, h)
            turned = _rotation(_scaled(momentum, h / physics.inertia))
    velocity = (velocity[0], velocity[1], velocity[2] - h * physics.gravity)
    place = _moved(model, body.place, velocity, h)
    if not models.turns(model):
        return Body(place, velocity, momentum, body.spin, body.a, body.b, body.c, turned)
    return Body(
        place,
        velocity,
        momentum,
        _scaled(momentum, 1 / physics.inertia),
        _times(turned, body.a),
        _times(turned, body.b),
        _times(turned, body.c),
        turned,
    )


@njit
def _energy(model: Any, physics: Physics, body: Body, behind: float) -> float:
    """Return kinetic energy + m g z [J] in the air, with the velocity so much gravity [m/s] after that of the step."""
    up = body.velocity[2] - behind
    square = body.velocity[0] * body.velocity[0] + body.velocity[1] * body.velocity[1] + up * up
    energy = 0.5 * physics.mass * square + physics.mass * physics.gravity * body.place[2]
    return energy + 0.5 * _dot(body.momentum, body.momentum) / physics.inertia if models.turns(model) else energy


@njit
def _swing(model: Any, omega: Any, h: Any, above_rest: Any, speed: Any) -> float:
    """Return `phases.swing_square` [m²/s²], and infinity of a cube that turns, of which it tells nothing."""
    return math.inf if models.turns(model) else swing_square(omega, h, above_rest, speed)


@njit
def _same(body: Body, other: Body) -> bool:
    """Return whether two bodies are the same in every bit, and so will be all that come of them."""
    return (
        body.velocity == other.velocity
        and body.place == other.place
        and body.momentum == other.momentum
        and body.spin == other.spin
        and body.a == other.a
        and body.b == other.b
    )


@compiled.njit
def stretch(
    model: Any,
    law: Any,
    physics: Physics,
    state: Any,
    sight: Any,
    high: float,
    low: float,
    most: int,
    tolerance: float,
) -> tuple[int, int, int]:
    """Take steps until there is something to see, at most `most`; return how many, computed, force evaluations.

    Something is a touch-down or a lift-off, the step after it, a number out of range, in the air an energy above `high`
    [J], and on the ground a swing below `low` [m²/s²] (`phases.rest_of`). The last step is left to be seen; `sight` has
    what it would have of those before. Where a step changes nothing at all, all that are left are the same.
    """
    rooms = np.empty(1, ROOM)
    room = rooms[0]
    normal = (physics.nx, physics.ny, physics.nz)
    h = sight.step_size
    behind = sight.lag * h * physics.gravity
    omega = math.sqrt(4 * physics.stiffness / physics.mass)
    body = _taken(model, physics, state, h)
    flown, steps = sight.flight, 0
    while True:
        before = body
        body = _stepped(model, law, physics, normal, before, room, h)
        clearance = _clearance(model, normal, body)
        steps += 1
        airborne = clearance > 0.0
        if steps >= min(most, LONGEST) or flown == 1.0 or airborne != (flown > 0.0) or not abs(clearance) < math.inf:
            break
        if airborne:
            if not _energy(model, physics, body, behind) <= high:
                break
            flown += 1.0
        elif _same(body, before):
            return most, steps, steps
        elif _swing(model, omega, h, clearance + sight.sag, _up(model, normal, body.velocity)) < low:
            break
        sight.speed_before = sight.speed
        sight.speed = _up(model, normal, body.velocity)
        sight.height = _up(model, normal, body.place)
        sight.clearance = clearance
    sight.flight = flown
    _give(model, physics, body, state)
    return steps, steps, steps


@compiled.njit(cache=True, nogil=True)
def advance(model: Any, law: Any, physics: Physics, states: States, h: float, steps: int) -> None:
    """Take so many steps of h [s] with every state, one by one, nothing watched, nothing skipped."""
    rooms = np.empty(1, ROOM)
    room = rooms[0]
    normal = (physics.nx, physics.ny, physics.nz)
    for m in range(states.shape[0]):
        body = _taken(model, physics, states[m], h)
        for _ in range(steps):
            body = _stepped(model, law, physics, normal, body, room, h)
        _give(model, physics, body, states[m])


def prepare(scene: Scene, model: str, steps: int) -> Callable[[], States]:
    """Return a function that steps from the launch to the end every time it is called, and returns the last state.

    Raises InputError for an unknown name and steps out of range.
    """
    checks.choice("model", model, MODELS)
    steps = checks.count("steps", steps)
    tags = MODELS[model], LAWS[scene.ground.contact]
    physics, launch = physics_of(scene), start_of(scene, model)

    def run() -> States:
        states = launch.copy()
        advance(*tags, physics, states, scene.duration / steps, steps)
        return states

    return run

"""Symplectic Euler, fast: the same motion as `symplectic_euler.py` steps, to round-off.

That kernel adds in the listings' order, node by node, and turns all eight. This one keeps three half edges a, b, c
instead (the nodes are ±a ±b ±c) and the rotation of one step, which changes only where a torque does; asks first
whether any node can feel the ground; and where one does treats all eight alike, in the lanes of a vector register
(`simd.py`), as it does the three half edges. Until the first touch-down the two agree to round-off, and after it as
long as anything does that differs in the last place: `docs/speed.md`. Nothing but the rotation by more than a quarter
of a radian in a step calls a library: the same numbers on every processor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics import compilation
from stiffdice.dynamics.contact import LAWS, acts, push, swing_square
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.simd import bits, lane, load, of_three, total
from stiffdice.dynamics.state import Physics, States, physics_of, start_of
from stiffdice.scene import validation
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.scene import Scene

# Three numbers, each of one thing or of lanes of them.
Vector = tuple[Any, Any, Any]
Matrix = tuple[Vector, Vector, Vector]  # its rows

# The signs of a, b and c in each of the nodes, in the order of the listings.
_SIGNS = np.ascontiguousarray(SIGNS.T)
_NODES = len(SIGNS)

# Steps in a row that nobody looks at: what might take many at once is asked in between.
LONGEST = 64

# Up to the first of these angles, squared, three terms of a rotation's series are exact; up to the second, six are.
_TINY, _SMALL = 1e-5, 0.0625


def njit(function: Any) -> Any:
    """Compile a function into those that call it: a body is kept in registers, not handed over in memory."""
    return compilation.njit(function, forceinline=True)


class Body(NamedTuple):
    """A state as this kernel keeps it, in registers.

    place [m], velocity [m/s], momentum: the angular one [kg m²/s]; spin [rad/s], as the nodes' velocities use it, and
    after the first step that of the momentum; edges [m]: along each axis lanes of the half edges a, b, c and a zero;
    turned: the rotation of one step.
    """

    place: Vector
    velocity: Vector
    momentum: Vector
    spin: Vector
    edges: Vector
    turned: Matrix


@njit
def _moved(model: Any, p: Vector, q: Vector, factor: Any) -> Vector:
    """Return p + factor·q."""
    if models.rises_only(model):
        return p[0], p[1], p[2] + factor * q[2]
    return p[0] + factor * q[0], p[1] + factor * q[1], p[2] + factor * q[2]


@njit
def _dot(p: Vector, q: Vector) -> Any:
    return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]


@njit
def _up(model: Any, normal: Vector, p: Vector) -> Any:
    """Return the part of a vector along the ground's normal."""
    if models.rises_only(model) or normal[2] == 1.0:
        return p[2]
    return _dot(normal, p)


@njit
def _cross(p: Vector, q: Vector) -> Vector:
    return p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]


@njit
def _scaled(p: Vector, factor: Any) -> Vector:
    return p[0] * factor, p[1] * factor, p[2] * factor


@njit
def _at_nodes(p: Any) -> Any:
    """Return ±a ±b ±c of lanes a, b, c: a lane for each node."""
    return load(_SIGNS, 0, 8) * lane(p, 0) + load(_SIGNS, 1, 8) * lane(p, 1) + load(_SIGNS, 2, 8) * lane(p, 2)


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
def _edges(nodes: Any, axis: int) -> Any:
    """Return the half edges' part along an axis, from nodes that differ in one sign each."""
    first = nodes[0, axis]
    return of_three((first - nodes[3, axis]) / 2, (first - nodes[1, axis]) / 2, (first - nodes[4, axis]) / 2)


@njit
def _taken(physics: Physics, state: Any, h: float) -> Body:
    """Return the body of a state."""
    n, p, u, w = state.node_offset, state.position, state.velocity, state.angular_velocity
    momentum = (state.angular_momentum[0], state.angular_momentum[1], state.angular_momentum[2])
    return Body(
        (p[0], p[1], p[2]),
        (u[0], u[1], u[2]),
        momentum,
        (w[0], w[1], w[2]),
        (_edges(n, 0), _edges(n, 1), _edges(n, 2)),
        _rotation(_scaled(momentum, h / physics.inertia)),
    )


@njit
def _rigid(physics: Physics, state: Any) -> bool:
    """Return whether the nodes move with the spin of the momentum, as they do but for the first step of a throw."""
    w, momentum = state.angular_velocity, state.angular_momentum
    x, y, z = momentum[0] / physics.inertia, momentum[1] / physics.inertia, momentum[2] / physics.inertia
    return w[0] == x and w[1] == y and w[2] == z


@njit
def _give(model: Any, physics: Physics, body: Body, state: Any) -> None:
    """Write a body into a state, after a step: its nodes move with the spin of its momentum then."""
    for axis in range(3):
        state.position[axis] = body.place[axis]
        state.velocity[axis] = body.velocity[axis]
    if models.turns(model):
        for axis in range(3):
            state.angular_momentum[axis] = body.momentum[axis]
            state.angular_velocity[axis] = body.momentum[axis] / physics.inertia
            edges = body.edges[axis]
            a, b, c = lane(edges, 0), lane(edges, 1), lane(edges, 2)
            for k in range(_NODES):
                state.node_offset[k, axis] = _SIGNS[0, k] * a + _SIGNS[1, k] * b + _SIGNS[2, k] * c


@njit
def _touching(model: Any, normal: Vector, body: Body) -> bool:
    """Return whether a node is on the ground or below it: `_clearance`, with a sum less for a step to wait for."""
    return bool(_up(model, normal, body.place) <= total(abs(_up(model, normal, body.edges))))


@njit
def _clearance(model: Any, normal: Vector, body: Body) -> float:
    """Return the height of the lowest node above the ground [m]."""
    return _up(model, normal, body.place) - total(abs(_up(model, normal, body.edges)))


@njit
def _slowest(model: Any, normal: Vector, body: Body) -> float:
    """Return the speed away from the ground of the node where it is lowest [m/s]."""
    speed = _up(model, normal, body.velocity)
    return speed - total(abs(_dot(_cross(normal, body.spin), body.edges))) if models.turns(model) else speed


@njit
def _felt(model: Any, law: Any, physics: Physics, normal: Vector, body: Body) -> tuple[Vector, Vector]:
    """Return the ground's force [N] and torque [N m], normal forces and friction of all nodes as in `contact.py`."""
    depth = -(_up(model, normal, body.place) + _at_nodes(_up(model, normal, body.edges)))
    if models.rises_only(model):
        pressed = push(law, depth, physics.damping * body.velocity[2], physics.stiffness)
        return (0.0, 0.0, total(pressed)), (0.0, 0.0, 0.0)
    if models.turns(model):
        r = _at_nodes(body.edges[0]), _at_nodes(body.edges[1]), _at_nodes(body.edges[2])
        force = _on_nodes(model, law, physics, normal, depth, _sum(body.velocity, _cross(body.spin, r)))
        torque = _cross(r, force)
        return _totals(force), _totals(torque)
    up = _up(model, normal, body.velocity)
    pressed = total(push(law, depth, physics.damping * up, physics.stiffness))
    return _rubbed(model, physics, normal, pressed, up, body.velocity), (0.0, 0.0, 0.0)


@njit
def _on_nodes(model: Any, law: Any, physics: Physics, normal: Vector, depth: Any, u: Vector) -> Vector:
    """Return the force on nodes [N] that are so deep [m] and move at u [m/s]."""
    up = _dot(normal, u)
    return _rubbed(model, physics, normal, push(law, depth, physics.damping * up, physics.stiffness), up, u)


@njit
def _rubbed(model: Any, physics: Physics, normal: Vector, pressed: Any, up: Any, u: Vector) -> Vector:
    """Return a normal force [N] and its friction at a velocity u [m/s], of which `up` is along the normal."""
    along = _moved(model, u, normal, -up)
    grip = physics.friction * pressed / (math.sqrt(_dot(along, along)) + physics.cutoff)
    return (
        pressed * normal[0] - grip * along[0],
        pressed * normal[1] - grip * along[1],
        pressed * normal[2] - grip * along[2],
    )


@njit
def _sum(p: Vector, q: Vector) -> Vector:
    return p[0] + q[0], p[1] + q[1], p[2] + q[2]


@njit
def _totals(p: Vector) -> Vector:
    return total(p[0]), total(p[1]), total(p[2])


@njit
def _acts(model: Any, law: Any, normal: Vector, body: Body) -> bool:
    """Return whether the ground can act on the body."""
    if not models.touches(model):
        return False
    return bool(acts(law, _touching(model, normal, body), _slowest(model, normal, body)))


@njit
def _kicked(model: Any, law: Any, physics: Physics, normal: Vector, body: Body, h: float) -> Body:
    """Return the body with what the ground does to its momenta in a step of h [s] (equations 6 and 8)."""
    force, torque = _felt(model, law, physics, normal, body)
    velocity = _moved(model, body.velocity, force, h / physics.mass)
    if not models.turns(model):
        return Body(body.place, velocity, body.momentum, body.spin, body.edges, body.turned)
    momentum = _moved(model, body.momentum, torque, h)
    spin = _scaled(momentum, 1 / physics.inertia)
    return Body(body.place, velocity, momentum, spin, body.edges, _rotation(_scaled(spin, h)))


@njit
def _flown(model: Any, physics: Physics, body: Body, h: float) -> Body:
    """Return the body after a step of h [s] with its weight alone (equations 6, 7 and 9)."""
    u = body.velocity
    velocity = (u[0], u[1], u[2] - h * physics.gravity)
    place, turned = _moved(model, body.place, velocity, h), body.turned
    if not models.turns(model):
        return Body(place, velocity, body.momentum, body.spin, body.edges, turned)
    edges = _dot(turned[0], body.edges), _dot(turned[1], body.edges), _dot(turned[2], body.edges)
    return Body(place, velocity, body.momentum, body.spin, edges, turned)


@njit
def _stepped(model: Any, law: Any, physics: Physics, normal: Vector, body: Body, h: float) -> Body:
    """Return the body after a step of h [s]."""
    if _acts(model, law, normal, body):
        body = _kicked(model, law, physics, normal, body, h)
    return _flown(model, physics, body, h)


@njit
def _energy(model: Any, physics: Physics, body: Body, behind: float) -> float:
    """Return kinetic energy + m g z [J] in the air, with the velocity so much gravity [m/s] after that of the step."""
    up = body.velocity[2] - behind
    square = body.velocity[0] * body.velocity[0] + body.velocity[1] * body.velocity[1] + up * up
    energy = 0.5 * physics.mass * square + physics.mass * physics.gravity * body.place[2]
    return energy + 0.5 * _dot(body.momentum, body.momentum) / physics.inertia if models.turns(model) else energy


@njit
def _swing(model: Any, omega: Any, h: Any, above_rest: Any, speed: Any) -> float:
    """Return `fast_forward.swing_square` [m²/s²], and infinity of a cube that turns, of which it tells nothing."""
    return math.inf if models.turns(model) else swing_square(omega, h, above_rest, speed)


@njit
def _unturned(body: Body, other: Body) -> bool:
    edges, others = body.edges, other.edges
    return bits((edges[0] != others[0]) | (edges[1] != others[1]) | (edges[2] != others[2])) == 0


@njit
def _same(body: Body, other: Body) -> bool:
    """Return whether two bodies are the same in every bit, and so will be all that come of them."""
    return (
        body.velocity == other.velocity
        and body.place == other.place
        and body.momentum == other.momentum
        and _unturned(body, other)
    )


@compilation.njit
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
    [J], and on the ground a swing below `low` [m²/s²] (`fast_forward.rest_of`). The last step is left to be seen;
    `sight` has what it would have of those before. Where a step changes nothing at all, all that are left are the same.
    """
    normal = (physics.nx, physics.ny, physics.nz)
    h = sight.step_size
    behind = sight.lag * h * physics.gravity
    omega = math.sqrt(4 * physics.stiffness / physics.mass)
    body = _taken(physics, state, h)
    most = 1 if models.turns(model) and not _rigid(physics, state) else most
    flown, steps, taken = sight.flight, 0, 0
    while True:
        before = body
        body = _stepped(model, law, physics, normal, before, h)
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
            taken = most
            break
        elif _swing(model, omega, h, clearance + sight.sag, _up(model, normal, body.velocity)) < low:
            break
        sight.speed_before = sight.speed
        sight.speed = _up(model, normal, body.velocity)
        sight.height = _up(model, normal, body.place)
        sight.clearance = clearance
    sight.flight = flown
    _give(model, physics, body, state)
    return max(taken, steps), steps, steps


@compilation.njit(cache=True, nogil=True)
def advance(model: Any, law: Any, physics: Physics, states: States, h: float, steps: int) -> None:
    """Take so many steps of h [s] with every state, one by one, nothing watched, nothing skipped."""
    normal = (physics.nx, physics.ny, physics.nz)
    for m in range(states.shape[0]):
        first = 0 if _rigid(physics, states[m]) else 1
        for count in (first, steps - first):
            body, left = _taken(physics, states[m], h), count
            while left > 0:
                # The loop in the air by itself has registers for all it needs.
                while left > 0 and not _acts(model, law, normal, body):
                    body = _flown(model, physics, body, h)
                    left -= 1
                if left > 0:
                    body = _flown(model, physics, _kicked(model, law, physics, normal, body, h), h)
                    left -= 1
            if count > 0:
                _give(model, physics, body, states[m])


def prepare(scene: Scene, model: str, steps: int) -> Callable[[], States]:
    """Return a function that steps from the launch to the end every time it is called, and returns the last state.

    Raises InputError for an unknown name and steps out of range.
    """
    validation.choice("model", model, MODELS)
    steps = validation.count("steps", steps)
    tags = MODELS[model], LAWS[scene.ground.contact]
    physics, launch = physics_of(scene), start_of(scene, model)

    def run() -> States:
        states = launch.copy()
        advance(*tags, physics, states, scene.duration / steps, steps)
        return states

    return run

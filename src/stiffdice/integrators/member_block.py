"""The block of memory in which the batched kernel has its members, one in each lane, along the ground's axes."""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import by_tag, load, njit, store
from stiffdice.dynamics.inertia import centre_of, half_edge, put_nodes
from stiffdice.dynamics.models.registry import turns
from stiffdice.dynamics.state import Array
from stiffdice.dynamics.vector import Vector, dot, inlined, row, vector
from stiffdice.scene.scene import Scene


class Body(NamedTuple):
    """The state; spin [rad/s]: as the nodes' velocities use it; a, b, c [m]: the half-edges."""

    place: Vector
    velocity: Vector
    momentum: Vector
    spin: Vector
    a: Vector
    b: Vector
    c: Vector


# Rows of a block, shape (row, lane): those of a body, three for each vector.
PLACE, VELOCITY, MOMENTUM, SPIN, EDGES = 0, 3, 6, 9, 12
ROWS = 21

# How many members a block has.
Alone = namedtuple("Alone", ())
Sixteen = namedtuple("Sixteen", ())
ThirtyTwo = namedtuple("ThirtyTwo", ())
WIDTHS: dict[type, int] = {Alone: 1, Sixteen: 16, ThirtyTwo: 32}

# Members side by side: enough for the vector units to have always something to do that does not wait for the step
# before, and not more than registers and the stores behind them hold.
ABREAST: dict[str, Any] = {"vertical": ThirtyTwo(), "sliding": ThirtyTwo(), "tumbling": Sixteen()}


def _row_of(width: int) -> Any:
    return inlined(lambda block, row: load(block, row, width))


# (width, block, row) -> a row of a block.
row_of = by_tag({width: _row_of(count) for width, count in WIDTHS.items()}, inlined=True)


@inlined
def _load(width: Any, block: Array, first: int) -> Vector:
    return Vector(row_of(width, block, first), row_of(width, block, first + 1), row_of(width, block, first + 2))


@inlined
def read(width: Any, block: Array) -> Body:
    """Return the state of a block's members."""
    place, velocity = _load(width, block, PLACE), _load(width, block, VELOCITY)
    momentum, spin = _load(width, block, MOMENTUM), _load(width, block, SPIN)
    a, b, c = _load(width, block, EDGES), _load(width, block, EDGES + 3), _load(width, block, EDGES + 6)
    return Body(place, velocity, momentum, spin, a, b, c)


@inlined
def _store(block: Array, first: int, value: Vector) -> None:
    store(block, first, value.x)
    store(block, first + 1, value.y)
    store(block, first + 2, value.z)


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
def member(block: Array, first: int, lane: int) -> Vector:
    """Return the vector of one member in three rows of a block, from the first on."""
    return Vector(block[first, lane], block[first + 1, lane], block[first + 2, lane])


@njit
def put(block: Array, first: int, lane: int, v: Vector) -> None:
    """Set the vector of one member in three rows of a block, from the first on."""
    block[first, lane], block[first + 1, lane], block[first + 2, lane] = v.x, v.y, v.z


@njit
def _seen_along(axes: Array, v: Vector) -> Vector:
    """Return a vector's parts along axes, shape (axis, 3)."""
    # Where the ground is level nothing changes, and no infinity becomes not-a-number.
    if axes[2, 2] == 1.0:
        return v
    return Vector(dot(row(axes, 0), v), dot(row(axes, 1), v), dot(row(axes, 2), v))


@njit
def enter(axes: Array, state: Any, block: Array, lane: int) -> None:
    """Put a STATE record into a lane of a block; axes: the ground's, shape (axis, 3)."""
    put(block, PLACE, lane, _seen_along(axes, vector(state.position)))
    put(block, VELOCITY, lane, _seen_along(axes, vector(state.velocity)))
    put(block, MOMENTUM, lane, _seen_along(axes, vector(state.angular_momentum)))
    put(block, SPIN, lane, _seen_along(axes, vector(state.angular_velocity)))
    for edge in range(3):
        put(block, EDGES + 3 * edge, lane, _seen_along(axes, half_edge(state.node_offset, edge)))


@njit
def place_of(axes: Array, block: Array, lane: int) -> Vector:
    """Return the place of a member in a lane along the world's axes [m]."""
    return _seen_along(axes.T, member(block, PLACE, lane))


@njit
def leave(system: Any, axes: Array, block: Array, lane: int, state: Any) -> None:
    """Put what a step changes of a member into its STATE record; system: model and physics."""
    world, position, velocity = axes.T, state.position, state.velocity
    position[0], position[1], position[2] = place_of(axes, block, lane)
    velocity[0], velocity[1], velocity[2] = _seen_along(world, member(block, VELOCITY, lane))
    if not turns(system.model):
        return
    momentum, spin = state.angular_momentum, state.angular_velocity
    momentum[0], momentum[1], momentum[2] = _seen_along(world, member(block, MOMENTUM, lane))
    spin[0], spin[1], spin[2] = _seen_along(world, member(block, SPIN, lane))
    a = _seen_along(world, member(block, EDGES, lane))
    b = _seen_along(world, member(block, EDGES + 3, lane))
    c = _seen_along(world, member(block, EDGES + 6, lane))
    put_nodes(state.node_offset, centre_of(system.physics.body, system.physics, a, b, c), a, b, c)


def axes_of(scene: Scene) -> Array:
    """Return the ground's axes in the world's, shape (axis, 3), the third its normal; those of the world if level.

    Duff et al. 2017, "Building an orthonormal basis, revisited".
    """
    x, y, z = scene.ground.normal
    sign = math.copysign(1.0, z)
    a = -1.0 / (sign + z)
    return np.array([[1 + sign * x * x * a, sign * x * y * a, -sign * x], [x * y * a, sign + y * y * a, -y], [x, y, z]])

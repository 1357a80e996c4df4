"""How a body turns: its spin, and its rotation where no torque acts; of a cube, and of a box with any tensor.

A cube has one moment of inertia: its spin is L/I and stays as it is in a flight. The tensor of a box turns with it, and
so does its spin. Its energy of rotation is the sum of three, (L·p)²/(2 I_p) for each principal axis p, and the flow of
each alone is a turn about that axis at a constant rate, L staying as it is. Those flows after each other, half of the
first two before and after the third, are of second order and symplectic: the error of the energy stays bounded
(McLachlan 1993, doi:10.1103/PhysRevLett.71.3043; Reich 1994; Hairer, Lubich and Wanner, Geometric Numerical
Integration, VII.5).
"""

from __future__ import annotations

import math
from collections import namedtuple
from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.compilation import by_tag, constant, njit
from stiffdice.dynamics.vector import Vector, dot, inlined, norm, plus, plus_times, row, times, unit, vector
from stiffdice.scene.cube import SIGNS, Cube

# A body with one moment of inertia about every axis through its centre.
Isotropic = namedtuple("Isotropic", ())


class Box(NamedTuple):
    """A body whose moments of inertia differ, or whose centre of mass is not that of its box.

    per_moments [1/(kg m²)]: of the inverse tensor about the principal axes. axes [1/m]: each principal axis by the
    half-edges. edges [m]: each half-edge by the principal axes. centre [1]: of the box, from the centre of mass, by the
    half-edges.
    """

    per_moments: Vector
    axes: tuple[Vector, Vector, Vector]
    edges: tuple[Vector, Vector, Vector]
    centre: Vector


# How angles become sine and 1 − cosine: of any, and of such as are below one radian (members side by side).
AnyAngle = namedtuple("AnyAngle", ())
SmallAngle = namedtuple("SmallAngle", ())

Edges = tuple[Vector, Vector, Vector]


def body_of(cube: Cube) -> Any:
    """Return what compiled code takes for the inertia of a cube."""
    mass = cube.distribution
    if mass.is_isotropic:
        return Isotropic()
    moments, axes = np.linalg.eigh(mass.tensor)
    axes[:, 2] *= np.linalg.det(axes)  # right-handed
    half_sides = np.array(cube.half_sides)
    rows = [Vector(*part.tolist()) for part in (axes / half_sides[:, None]).T]
    back = [Vector(*part.tolist()) for part in axes * half_sides[:, None]]
    centre = Vector(*(-mass.centre / half_sides).tolist())
    return Box(Vector(*(1.0 / moments).tolist()), tuple(rows), tuple(back), centre)  # type: ignore[arg-type]


@inlined
def combined(parts: Vector, a: Any, b: Any, c: Any) -> Any:
    """Return parts.x·a + parts.y·b + parts.z·c, of vectors."""
    return plus_times(plus_times(times(parts.x, a), parts.y, b), parts.z, c)


@inlined
def axes_of(body: Any, a: Vector, b: Vector, c: Vector) -> Edges:
    """Return the principal axes of a box with these half-edges."""
    first, second, third = body.axes
    return combined(first, a, b, c), combined(second, a, b, c), combined(third, a, b, c)


@inlined
def spin_about(body: Any, momentum: Vector, a: Vector, b: Vector, c: Vector) -> Vector:
    """Return the spin [rad/s] of a box with these half-edges that has this angular momentum."""
    p, q, r = axes_of(body, a, b, c)
    x, y, z = body.per_moments.x * dot(p, momentum), body.per_moments.y * dot(q, momentum), dot(r, momentum)
    return combined(Vector(x, y, body.per_moments.z * z), p, q, r)


# sin(θ)/θ and (1 − cos(θ))/θ² in powers of θ²: what is left out is below round-off up to 1 rad.
_S = tuple((-1.0) ** k / math.factorial(2 * k + 1) for k in range(9))
_V = tuple((-1.0) ** k / math.factorial(2 * k + 2) for k in range(9))
_S0, _S1, _S2, _S3, _S4, _S5, _S6, _S7, _S8 = _S
_V0, _V1, _V2, _V3, _V4, _V5, _V6, _V7, _V8 = _V


@inlined
def small_rotation(q: Any) -> tuple[Any, Any]:
    """Return sin(θ)/θ and (1 − cos(θ))/θ² for θ² = q up to 1."""
    sine = _S0 + q * (_S1 + q * (_S2 + q * (_S3 + q * (_S4 + q * (_S5 + q * (_S6 + q * (_S7 + q * _S8)))))))
    versine = _V0 + q * (_V1 + q * (_V2 + q * (_V3 + q * (_V4 + q * (_V5 + q * (_V6 + q * (_V7 + q * _V8)))))))
    return sine, versine


@inlined
def _of_any(angle: float) -> tuple[float, float]:
    half = math.sin(0.5 * angle)
    return math.sin(angle), 2.0 * half * half


@inlined
def _of_small(angle: Any) -> tuple[Any, Any]:
    square = angle * angle
    sine, versine = small_rotation(square)
    return angle * sine, square * versine


# (kind of angle, angle [rad]) -> sine, 1 − cosine.
_parts_of = by_tag({AnyAngle: _of_any, SmallAngle: _of_small}, inlined=True)


@inlined
def _about(kind: Any, angle: Any, q: Vector, r: Vector) -> tuple[Vector, Vector]:
    """Return two axes after a turn by an angle [rad] about the third, p = q × r."""
    sine, versine = _parts_of(kind, angle)
    return (
        plus(q, plus_times(times(sine, r), -versine, q)),
        plus(r, plus_times(times(-sine, q), -versine, r)),
    )


@inlined
def freely_turned(kind: Any, body: Any, momentum: Vector, h: Any, a: Vector, b: Vector, c: Vector) -> Edges:
    """Return the half-edges of a box after h [s] without torque, by the symmetric splitting."""
    p, q, r = axes_of(body, a, b, c)
    x, y, z = 0.5 * h * body.per_moments.x, 0.5 * h * body.per_moments.y, h * body.per_moments.z
    q, r = _about(kind, x * dot(p, momentum), q, r)
    r, p = _about(kind, y * dot(q, momentum), r, p)
    p, q = _about(kind, z * dot(r, momentum), p, q)
    r, p = _about(kind, y * dot(q, momentum), r, p)
    q, r = _about(kind, x * dot(p, momentum), q, r)
    by_a, by_b, by_c = body.edges
    return combined(by_a, p, q, r), combined(by_b, p, q, r), combined(by_c, p, q, r)


@inlined
def half_edge(nodes: Any, edge: int) -> Vector:
    """Return a half-edge of the box with these nodes, shape (8, 3)."""
    total = Vector(0.0, 0.0, 0.0)
    for k in range(len(SIGNS)):
        total = plus_times(total, SIGNS[k, edge], row(nodes, k))
    return times(1 / 8, total)


# (body, physics, a, b, c) -> the centre [m] of a box with these half-edges, from its centre of mass.
centre_of = by_tag(
    {
        Isotropic: njit(lambda physics, a, b, c: Vector(0.0, 0.0, 0.0)),
        Box: njit(lambda physics, a, b, c: combined(physics.body.centre, a, b, c)),
    }
)


@njit
def put_nodes(nodes: Any, centre: Vector, a: Vector, b: Vector, c: Vector) -> None:
    """Set the nodes, shape (8, 3), of a box with these half-edges; centre: of the box, from the centre of mass."""
    for k in range(len(SIGNS)):
        node = plus_times(plus_times(plus_times(centre, SIGNS[k, 0], a), SIGNS[k, 1], b), SIGNS[k, 2], c)
        nodes[k, 0], nodes[k, 1], nodes[k, 2] = node


@njit
def _spin_of_isotropic(physics: Any, state: Any, momentum: Vector) -> Vector:
    return Vector(momentum.x / physics.inertia, momentum.y / physics.inertia, momentum.z / physics.inertia)


@njit
def _spin_of_box(physics: Any, state: Any, momentum: Vector) -> Vector:
    nodes = state.node_offset
    return spin_about(physics.body, momentum, half_edge(nodes, 0), half_edge(nodes, 1), half_edge(nodes, 2))


# (body, physics, state, momentum) -> the spin [rad/s] of a body that is turned as in a state and has this angular
# momentum.
spin_of = by_tag({Isotropic: _spin_of_isotropic, Box: _spin_of_box})


@njit
def _energy_of_isotropic(physics: Any, state: Any, momentum: Vector) -> float:
    return 0.5 * dot(momentum, momentum) / physics.inertia


@njit
def _energy_of_box(physics: Any, state: Any, momentum: Vector) -> float:
    return 0.5 * dot(momentum, _spin_of_box(physics, state, momentum))


# (body, physics, state, momentum) -> the energy of rotation [J] likewise.
turning_energy = by_tag({Isotropic: _energy_of_isotropic, Box: _energy_of_box})


@njit
def rotate(nodes: Any, ax: float, ay: float, az: float, angle: float) -> None:
    """Turn nodes, shape (K, 3), about a unit axis: R = P + cos(angle)·(E − P) + sin(angle)·A, after equation 9."""
    c, s = math.cos(angle), math.sin(angle)
    rxx, rxy, rxz = ax * ax + c * (1 - ax * ax), ax * ay - c * (ax * ay) - s * az, ax * az - c * (ax * az) + s * ay
    ryx, ryy, ryz = ay * ax - c * (ay * ax) + s * az, ay * ay + c * (1 - ay * ay), ay * az - c * (ay * az) - s * ax
    rzx, rzy, rzz = az * ax - c * (az * ax) - s * ay, az * ay - c * (az * ay) + s * ax, az * az + c * (1 - az * az)
    for k in range(nodes.shape[0]):
        x, y, z = nodes[k, 0], nodes[k, 1], nodes[k, 2]
        nodes[k, 0] = rxx * x + rxy * y + rxz * z
        nodes[k, 1] = ryx * x + ryy * y + ryz * z
        nodes[k, 2] = rzx * x + rzy * y + rzz * z


@njit
def _turn_isotropic(physics: Any, state: Any, duration: float) -> None:
    spin = vector(state.angular_velocity)
    rate = norm(spin)
    if rate > 0.0:
        rotate(state.node_offset, spin.x / rate, spin.y / rate, spin.z / rate, rate * duration)


@njit
def _turn_box(physics: Any, state: Any, duration: float) -> None:
    nodes, body, momentum = state.node_offset, physics.body, vector(state.angular_momentum)
    a, b, c = half_edge(nodes, 0), half_edge(nodes, 1), half_edge(nodes, 2)
    a, b, c = freely_turned(AnyAngle(), body, momentum, duration, a, b, c)
    put_nodes(nodes, combined(body.centre, a, b, c), a, b, c)
    spin = state.angular_velocity
    spin[0], spin[1], spin[2] = spin_about(body, momentum, a, b, c)


# (body, physics, state, duration): turn the nodes for so long [s] without torque; the spin is that of the momentum.
turn = by_tag({Isotropic: _turn_isotropic, Box: _turn_box})


@njit
def _tensor_of_isotropic(physics: Any, state: Any) -> tuple[Vector, Vector, Vector]:
    i = physics.inertia
    return Vector(i, 0.0, 0.0), Vector(0.0, i, 0.0), Vector(0.0, 0.0, i)


@njit
def _tensor_of_box(physics: Any, state: Any) -> tuple[Vector, Vector, Vector]:
    nodes, inverse = state.node_offset, physics.body.per_moments
    p, q, r = axes_of(physics.body, half_edge(nodes, 0), half_edge(nodes, 1), half_edge(nodes, 2))
    p_x, q_x, r_x = p.x / inverse.x, q.x / inverse.y, r.x / inverse.z
    p_y, q_y, r_y = p.y / inverse.x, q.y / inverse.y, r.y / inverse.z
    p_z, q_z, r_z = p.z / inverse.x, q.z / inverse.y, r.z / inverse.z
    rows = Vector(p_x, q_x, r_x), Vector(p_y, q_y, r_y), Vector(p_z, q_z, r_z)
    return combined(rows[0], p, q, r), combined(rows[1], p, q, r), combined(rows[2], p, q, r)


# (body, physics, state) -> the rows of the tensor of inertia [kg m²] of a body that is turned as in a state.
tensor_of = by_tag({Isotropic: _tensor_of_isotropic, Box: _tensor_of_box})


@njit
def _put_inverse_of_box(physics: Any, state: Any, inverse: Any) -> None:
    nodes = state.node_offset
    a, b, c = half_edge(nodes, 0), half_edge(nodes, 1), half_edge(nodes, 2)
    for axis in range(3):
        inverse[axis, 0], inverse[axis, 1], inverse[axis, 2] = spin_about(physics.body, unit(axis), a, b, c)


# (body, physics, state, inverse): set the inverse tensor [1/(kg m²)], shape (3, 3), of a box turned as in a state.
put_inverse = by_tag({Isotropic: constant(None), Box: _put_inverse_of_box})

# (body) -> whether its spin stays as it is where no torque acts.
spins_steadily = by_tag({Isotropic: constant(True), Box: constant(False)})

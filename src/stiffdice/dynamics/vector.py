"""Vectors in compiled code, of one body, or with `lanes.py` of several side by side; and small systems of equations.

The latter are solved by elimination without pivots: for matrices that are all but positive definite. The routines of
NumPy do the same through BLAS, which has other digits on other processors.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.dynamics.compilation import njit


class Vector(NamedTuple):
    """Three numbers along three axes, each of one body or of lanes of them."""

    x: Any
    y: Any
    z: Any


def inlined(function: Any) -> Any:
    """Compile a part of a step: put into its caller whatever its size, so that lanes stay in registers."""
    return njit(function, forceinline=True)


@inlined
def vector(array: Any) -> Vector:
    """Return three numbers of an array or a tuple."""
    return Vector(array[0], array[1], array[2])


@inlined
def row(array: Any, k: int) -> Vector:
    """Return three numbers of row k of an array."""
    return Vector(array[k, 0], array[k, 1], array[k, 2])


@njit
def assign(array: Any, values: Any) -> None:
    """Copy numbers into an array of as many; a slice takes a second to compile, for the error that it might raise."""
    for k in range(len(values)):
        array[k] = values[k]


@inlined
def unit(axis: int) -> Vector:
    """Return the unit vector along an axis."""
    return Vector(1.0 if axis == 0 else 0.0, 1.0 if axis == 1 else 0.0, 1.0 if axis == 2 else 0.0)


@inlined
def plus(a: Vector, b: Vector) -> Vector:
    """Return a + b."""
    return Vector(a.x + b.x, a.y + b.y, a.z + b.z)


@inlined
def minus(a: Vector, b: Vector) -> Vector:
    """Return a − b."""
    return Vector(a.x - b.x, a.y - b.y, a.z - b.z)


@inlined
def times(factor: Any, a: Vector) -> Vector:
    """Return factor·a."""
    return Vector(factor * a.x, factor * a.y, factor * a.z)


@inlined
def plus_times(start: Vector, factor: Any, a: Vector) -> Vector:
    """Return start + factor·a."""
    return Vector(start.x + factor * a.x, start.y + factor * a.y, start.z + factor * a.z)


@inlined
def dot(a: Vector, b: Vector) -> Any:
    """Return a·b."""
    return a.x * b.x + a.y * b.y + a.z * b.z


@inlined
def cross(a: Vector, b: Vector) -> Vector:
    """Return a × b."""
    return Vector(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x)


@inlined
def norm(a: Vector) -> Any:
    """Return |a|."""
    return math.sqrt(dot(a, a))


@njit
def factorise(matrix: Any) -> None:
    """Set a matrix, shape (n, n) or with more columns, which are left alone, to its triangles L − 1 and U."""
    size = matrix.shape[0]
    for i in range(size):
        for row in range(i + 1, size):
            matrix[row, i] /= matrix[i, i]
            factor = matrix[row, i]
            for j in range(i + 1, size):
                matrix[row, j] -= factor * matrix[i, j]


@njit
def solve(factors: Any, right: Any) -> None:
    """Turn the first n of a right side into the solution of the equations that were factorised."""
    size = factors.shape[0]
    for i in range(size):
        for j in range(i):
            right[i] -= factors[i, j] * right[j]
    for i in range(size - 1, -1, -1):
        for j in range(i + 1, size):
            right[i] -= factors[i, j] * right[j]
        right[i] /= factors[i, i]

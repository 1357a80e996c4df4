"""Small systems of linear equations by elimination without pivots: for matrices that are all but positive definite.

The routines of NumPy do the same through BLAS, which has other digits on other processors.
"""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics.compilation import njit


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

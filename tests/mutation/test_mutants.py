from __future__ import annotations

import ast

import pytest

from tests.mutation.mutants import chosen, count, mutant

SOURCE = '''
def clamped(x: float, low: float = -2.5) -> float:
    """Return x, or low."""
    if not x < low:
        return max(x, low) / 2
    return low + 1.0
'''


def test_every_mutant_differs_from_the_module_and_from_every_other():
    texts = [ast.unparse(mutant(SOURCE, index).tree) for index in range(count(SOURCE))]
    assert len({ast.unparse(ast.parse(SOURCE)), *texts}) == len(texts) + 1


@pytest.mark.parametrize(
    "changed",
    [
        "if x < low:",
        "if not x <= low:",
        "min(x, low)",
        "max(x, low) * 2",
        "low - 1.0",
        "low + 1.001",
        "low + 0.0",
        "2.5",
    ],
)
def test_a_change_of_each_kind_is_made(changed):
    assert any(changed in ast.unparse(mutant(SOURCE, index).tree) for index in range(count(SOURCE)))


def test_a_choice_is_the_same_for_the_same_seed():
    assert chosen(SOURCE, 5, 1) == chosen(SOURCE, 5, 1) != chosen(SOURCE, 5, 2)
    assert chosen(SOURCE, 10**6, 1) == list(range(count(SOURCE)))

"""What is remembered of calls is what numba finds; what it compiles for a call is found anew."""

from __future__ import annotations

import itertools
import math
import operator

import numpy as np
import pytest
from numba.core import registry, types

from stiffdice.dynamics.compiling import call_types, compiler  # noqa: F401 (which has numba remember)

CONTEXT = registry.cpu_target.typing_context
NUMBERS = types.float64, types.int64, types.boolean, types.literal(2), types.uint8
BINARY = operator.add, operator.truediv, operator.lt, operator.pow, max, math.atan2, np.hypot


def function_of(called):
    return CONTEXT.resolve_value_type(called)


@pytest.mark.parametrize("called", BINARY)
def test_types_are_those_that_numba_finds_the_first_time_and_the_second(called):
    CONTEXT.refresh()
    for arguments in itertools.product(NUMBERS, repeat=2):
        try:
            expected = call_types._find(function_of(called), CONTEXT, arguments, {})
        except Exception as error:
            with pytest.raises(type(error)):
                function_of(called).get_call_type(CONTEXT, arguments, {})
            continue
        for _ in range(2):
            assert function_of(called).get_call_type(CONTEXT, arguments, {}) == expected
            assert function_of(called).get_impl_key(expected) is not None


def test_a_call_that_numba_compiles_code_for_is_found_anew():
    """The options of who calls change that code."""
    CONTEXT.refresh()
    clip, arguments = function_of(np.clip), (types.Array(types.float64, 1, "C"), types.float64, types.float64)
    signature = clip.get_call_type(CONTEXT, arguments, {})
    assert clip.get_impl_key(signature) != clip.typing_key, "numba compiles Python code for it"
    assert (clip, CONTEXT, arguments) not in call_types._FOUND

"""What types a call of numba's own functions has, found once for each kind of arguments.

Numba tries dozens of implementations at every `+` of a kernel, those of arrays, strings and dates among them, and finds
the same one each time. That is a tenth of all time to compile.
"""

from __future__ import annotations

from typing import Any

from numba.core import types

_Function: Any = types.functions.BaseFunction
_find = _Function.get_call_type
_FOUND: dict[tuple[Any, ...], Any] = {}


def _get_call_type(function: Any, context: Any, arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """Return the signature of a call; found anew where numba has to compile what is called, as options change that."""
    call = function, context, tuple(arguments)
    if not named and call in _FOUND:
        return _FOUND[call]
    signature = _find(function, context, arguments, named)
    if not named and function.get_impl_key(signature) == function.typing_key:
        _FOUND[call] = signature
    return signature


def remember() -> None:
    """Have numba remember them in this process."""
    _Function.get_call_type = _get_call_type

"""LLVM code of kernels and their parts.

Numba would begin to optimise what a module only declares, too: many more functions than it has.
"""

from __future__ import annotations

from typing import Any

from numba.core import codegen

# Numba has no types of it.
_Library: Any = codegen.JITCodeLibrary


class Library(_Library):  # type: ignore[misc]
    """LLVM code in which functions are optimised one by one before it is put together, those that it has."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout
        for function in ll_module.functions:
            if not function.is_declaration:
                passes, builder = self._codegen._function_pass_manager()
                passes.run(function, builder)

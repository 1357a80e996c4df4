"""Kernels that other kernels call by their addresses (`compilation.separate`).

Numba would put a copy of what is called into each kernel that calls it, and would have to compile it before. Here each
is compiled for itself, at the same time as the others, in another process.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import inspect
import os
from typing import Any, cast

from llvmlite import binding
from numba.core import funcdesc

from stiffdice.dynamics.compiling import parallel_compilation
from stiffdice.dynamics.compiling.kernel_cache import NotStoredError, only_stored
from stiffdice.dynamics.compiling.llvm_library import Library

# Numba has no types of it.
_Descriptor: Any = funcdesc.FunctionDescriptor


class Call:
    """A call of a separate kernel, by a symbol of LLVM: its name is that of the kernel in the cache on disk.

    kernel: what is called. arguments: their types. entry: by which numba finds the call. name: by which another process
    finds it: module, name in there, and arguments.
    """

    def __init__(self, kernel: Any, arguments: tuple[Any, ...], symbol: str) -> None:
        self.kernel, self.arguments, self.entry = kernel, arguments, object()
        self.name = kernel.py_func.__module__, kernel.py_func.__name__, arguments
        self._symbol, self._is_linked, self._child, self._parent = symbol, False, 0, 0
        described = _Descriptor(
            *(True, *self.name[:2], symbol, "", None, kernel.returns, None),
            *(inspect.signature(kernel.py_func).parameters, ()),
            mangler=lambda *_, **__: symbol,
            argtypes=arguments,
        )
        kernel.targetctx.insert_user_function(self.entry, described)
        binding.add_symbol(symbol, cast(int, ctypes.cast(_not_linked, ctypes.c_void_p).value))
        _CALLS[symbol] = self

    @classmethod
    def of(cls, kernel: Any, arguments: tuple[Any, ...], symbol: str) -> Call:
        """Return the call of a symbol, made if it was not."""
        return _CALLS.get(symbol) or cls(kernel, arguments, symbol)

    @staticmethod
    def named(module: str, name: str, arguments: tuple[Any, ...]) -> Call:
        """Return a call by its name."""
        kernel: Any = getattr(importlib.import_module(module), name).dispatcher
        return cast(Call, kernel.call(arguments))

    def begin(self) -> None:
        """Let another process compile the kernel if it is not stored, and one can be had."""
        if self.arguments not in self.kernel.overloads and not self._child:
            with contextlib.suppress(NotStoredError), only_stored():
                self.kernel.compile(self.arguments)
                return
            self._child = parallel_compilation.begin(lambda: self.kernel.compile_unless_begun(self.arguments))
            self._parent = os.getpid()

    def link(self) -> None:
        """Have the symbol be the kernel's address, once that is compiled; raises TypeError for another type than told.

        In a process that only stores what it compiles, and calls nothing, it may be any address.
        """
        if not self._is_linked and not parallel_compilation.STORING.get():
            self.kernel.compile(self.arguments)
            made = self.kernel.overloads[self.arguments]
            if made.signature.return_type != self.kernel.returns:
                raise TypeError(f"{self.name[1]} returns {made.signature.return_type}, not {self.kernel.returns}")
            binding.add_symbol(self._symbol, made.library.get_pointer_to_function(made.fndesc.llvm_func_name))
            self._is_linked = True
        if self._child and self._parent == os.getpid():  # a process forked since has no such child
            os.waitpid(self._child, 0)
            self._child = 0


_CALLS: dict[str, Call] = {}


@ctypes.CFUNCTYPE(None)
def _not_linked() -> None:
    """End the process with a sentence, where it would jump to nowhere."""
    told = "a separate kernel was called by code that numba compiled for itself; compile that with `compilation.njit`"
    os.write(2, f"{told}\n".encode())
    os.abort()


class KernelLibrary(Library):
    """LLVM code of a kernel."""

    def calls(self) -> list[Call]:
        """Return the separate kernels that it calls."""
        return [_CALLS[part.name] for part in self._final_module.functions if part.name in _CALLS]

    def _finalize_final_module(self) -> None:
        for call in self.calls():
            call.link()
        super()._finalize_final_module()

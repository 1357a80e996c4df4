"""Numba, with a cache on disk of our own (`kernel_files.py`), and parts that are compiled with what calls them."""

from __future__ import annotations

import contextlib
import gc
import importlib
import inspect
import os
import uuid
from collections.abc import Callable
from functools import cache
from typing import Any, cast

import numba
from numba.core import (
    bytecode,
    compiler,
    compiler_machinery,
    dispatcher,
    registry,
    sigutils,
    typed_passes,
    types,
    typing,
    untyped_passes,
)
from numba.np import linalg

# Before numba compiles anything: in a function that it has begun with, `abs` would not know of lanes.
from stiffdice.dynamics import lanes
from stiffdice.dynamics.compiling import call_types
from stiffdice.dynamics.compiling.kernel_cache import LOADING, TELLING, NotStoredError, cache_folder, only_stored
from stiffdice.dynamics.compiling.kernel_files import KernelCache
from stiffdice.dynamics.compiling.llvm_library import Library
from stiffdice.dynamics.compiling.separate_kernels import Call, KernelLibrary

# Numba imports SciPy to see whether it can multiply matrices, which our kernels do not; it looks again when one does.
_ensure_blas, vars(linalg)["ensure_blas"] = vars(linalg)["ensure_blas"], lambda: None
_arraymath = importlib.import_module("numba.np.arraymath")
vars(linalg)["ensure_blas"] = vars(_arraymath)["ensure_blas"] = _ensure_blas

# In the environment for child processes and for numba to find when it reads it again.
os.environ["NUMBA_CACHE_DIR"] = str(cache_folder())
setattr(numba.config, "CACHE_DIR", os.environ["NUMBA_CACHE_DIR"])  # noqa: B010 (mypy knows no such attribute)


class _UniqueNumbers:
    """Numbers by which numba tells functions of one name apart, different in every process.

    Numba counts from one in each. Two closures that two processes compiled may then have one symbol. Where kernels with
    both are loaded from disk, calls of one reach the other: a criterion takes another's place.
    """

    def __next__(self) -> int:
        return uuid.uuid4().int


vars(bytecode)["FunctionIdentity"]._unique_ids = _UniqueNumbers()
call_types.remember()

# Of these numba has no types.
_Lowering: Any = typed_passes.NativeLowering
_Compiler: Any = compiler.Compiler
_Dispatcher: Any = registry.CPUDispatcher
_typing: Any = typing
_signature: Any = sigutils.normalize_signature
_FunctionCompiler: Any = vars(dispatcher)["_FunctionCompiler"]
_register_pass: Any = compiler_machinery.register_pass


class _Kernel(_Dispatcher):  # type: ignore[misc]
    """A compiled function that Python calls."""

    _cache: KernelCache

    def compile(self, sig: Any) -> Any:
        """Compile for a signature, or load what is stored, by another process that has begun, too."""
        with contextlib.suppress(NotStoredError), only_stored():
            return super().compile(sig)
        if LOADING.get():
            raise NotStoredError
        if (compiles := TELLING.get()) is not None:
            compiles()
        with self._cache.alone(sig, self.targetctx, wait=True):
            return self._compiled(sig)

    def compile_unless_begun(self, sig: Any) -> None:
        """Compile for a signature unless another process does."""
        with self._cache.alone(sig, self.targetctx, wait=False) as is_alone:
            if is_alone:
                self._compiled(sig)

    def _compiled(self, sig: Any) -> Any:
        """Compile, or load; what that makes is not looked through for garbage, as most of it stays."""
        enabled = gc.isenabled()
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            gc.freeze()
            gc.unfreeze()  # all that there is counts as old now
            if enabled:
                gc.enable()


class _Part(_Dispatcher):  # type: ignore[misc]
    """A compiled function that is meant for compiled code, without machine code and wrappers for calls from Python.

    Those are a third of all time to compile, and more. Who does call it from Python, a test, say, has a kernel made for
    the call; numba's own would jump to nowhere.
    """

    def compile(self, sig: Any) -> Any:
        """Compile for a signature; what calls for it holds numba's lock, and is what numba times."""
        arguments = tuple(sig)
        if arguments not in self.overloads:
            with self._compiling_counter:
                self.add_overload(self._compiler.compile(arguments, None))
        return self.overloads[arguments].entry_point

    def add_overload(self, cres: Any) -> None:
        """Keep what was compiled for compiled code to find, and for nobody else."""
        self.overloads[tuple(cres.signature.args)] = cres

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        bound = inspect.signature(self.py_func).bind(*arguments, **named)
        return _callable(self)(*bound.args)


class _Separate(_Kernel):
    """A kernel that other kernels call by its address, of which they know nothing but the type that it returns."""

    returns: Any

    def get_call_template(self, args: Any, kws: Any) -> tuple[Any, Any, Any, Any]:
        """Return for numba what types a call has; what is called is being compiled from here on, elsewhere."""
        signature, given = self._compiler.fold_argument_types(args, kws)
        folded = tuple(map(types.unliteral, given))
        self.call(folded).begin()
        name, kind = self.py_func.__name__, _typing.signature(self.returns, *folded)
        return _typing.make_concrete_template(name, key=name, signatures=[kind]), signature, given, {}

    def get_overload(self, args: Any) -> object:
        """Return for numba by what it finds the code of a call."""
        return self.call(tuple(args)).entry

    def call(self, arguments: tuple[Any, ...]) -> Call:
        """Return the call with arguments of these types."""
        symbol = f"stiffdice.{self._cache.stem(arguments, self.targetctx)}"
        return Call.of(self, arguments, symbol)


# Passes of numba that do nothing for code like ours: without array expressions, closures, comprehensions and `with`.
_IDLE = {
    typed_passes.NopythonRewrites,
    typed_passes.NoPythonSupportedFeatureValidation,
    untyped_passes.InlineClosureLikes,
    untyped_passes.WithLifting,
}

# Functions of a part, at most, that is optimised: one that holds more is far from any inner loop.
_MANY = 40


class _PartLibrary(Library):
    """LLVM code of a part: turned into machine code with the kernel that takes it in, not before.

    It is optimised before, too: without that kernels compile in a tenth less time, and are slower by as much.
    """

    def _optimize_final_module(self) -> None:
        if sum(not function.is_declaration for function in self._final_module.functions) <= _MANY:
            super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


@_register_pass(mutates_CFG=True, analysis_only=False)
class _KernelLowering(_Lowering):  # type: ignore[misc]
    def run_pass(self, state: Any) -> bool:
        state.library = KernelLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.library.enable_object_caching()
        return cast(bool, super().run_pass(state))


@_register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(_Lowering):  # type: ignore[misc]
    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        entry = object()  # by which what calls the part finds it
        state.targetctx.insert_user_function(entry, state["cr"].fndesc, [state.library])
        state["cr"] = state["cr"]._replace(cfunc=entry)
        return True


class _KernelCompiler(_Compiler):  # type: ignore[misc]
    lowering: Any = _KernelLowering

    def define_pipelines(self) -> list[Any]:
        (pipeline,) = super().define_pipelines()
        pipeline.passes = [
            (self.lowering if made is _Lowering else made, description)
            for made, description in pipeline.passes
            if made not in _IDLE
        ]
        pipeline.finalize()
        return [pipeline]


class _PartCompiler(_KernelCompiler):
    lowering = _PartLowering


@cache
def _callable(part: _Part) -> Any:
    def call(*arguments: Any) -> Any:
        return part(*arguments)

    return _Dispatcher(call, targetoptions={"nopython": True}, pipeline_class=_KernelCompiler)


class _ChoiceCompiler(_FunctionCompiler):  # type: ignore[misc]
    """Compiles, for a tag, a call of the body that it stands for."""

    bodies: dict[type, Any]

    def _get_implementation(self, args: Any, kws: Any) -> Any:
        body = self.bodies[args[0].instance_class]
        return lambda tag, *arguments: body(*arguments)


def dispatcher_of(function: Callable[..., Any], bodies: dict[type, Any] | None, options: dict[str, Any]) -> Any:
    """Return numba's dispatcher of a function: a kernel that Python calls if it is cached on disk, else a part of one.

    bodies, options: see `compilation.Compiled`.
    """
    if options.get("cache"):
        named = {name: value for name, value in options.items() if name not in ("cache", "returns")}
        kind = _Separate if "returns" in options else _Kernel
        kernel = kind(function, targetoptions=named | {"no_cfunc_wrapper": True}, pipeline_class=_KernelCompiler)
        kernel._cache = KernelCache(function)
        if isinstance(kernel, _Separate):
            kernel.returns = _signature(f"{options['returns']}()")[1]
        return kernel
    bare = options | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    part = _Part(function, targetoptions=bare, pipeline_class=_PartCompiler)
    if bodies is not None:
        part._compiler.__class__ = _ChoiceCompiler
        part._compiler.bodies = bodies
    return part


def type_of(intrinsic: str) -> Any:
    """Return numba's type of a function of `lanes.py`."""
    target: Any = registry.cpu_target
    return target.typing_context.resolve_value_type(getattr(lanes, intrinsic))

"""Numba, with a cache on disk that never serves stale code, and parts that are compiled with what calls them.

Each file of the cache begins with its own digest, and is known by the processor that it is for; what does not match is
compiled again.
"""

from __future__ import annotations

import contextlib
import fcntl
import gc
import hashlib
import importlib
import inspect
import os
import pickle
import shutil
import uuid
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, cast

import numba
from numba.core import codegen, compiler, compiler_machinery, dispatcher, registry, serialize, typed_passes
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator
from numba.np import linalg

from stiffdice.dynamics.code_digest import code_digest
from stiffdice.dynamics.kernel_cache import LOADING, TELLING, NotStoredError, cache_folder, only_stored

# Numba imports SciPy to see whether it can multiply matrices, which our kernels do not; it looks again when one does.
_ensure_blas, vars(linalg)["ensure_blas"] = vars(linalg)["ensure_blas"], lambda: None
_arraymath = importlib.import_module("numba.np.arraymath")
vars(linalg)["ensure_blas"] = vars(_arraymath)["ensure_blas"] = _ensure_blas

# In the environment for child processes and for numba to find when it reads it again.
os.environ["NUMBA_CACHE_DIR"] = str(cache_folder())
setattr(numba.config, "CACHE_DIR", os.environ["NUMBA_CACHE_DIR"])  # noqa: B010 (mypy knows no such attribute)

_DIGEST = hashlib.sha256().digest_size


class KernelFiles:
    """The kernels of one function, a file for each signature and processor: SHA-256, then key and kernel, pickled.

    Numba's own files know no damage; and two processes that compile two signatures at once may give both the same
    number. folder: where they lie. name: of the function. stamp: of its source; part of every key.
    """

    def __init__(self, folder: Path, name: str, stamp: object) -> None:
        self._folder, self._name, self._stamp = folder, name, stamp

    def path(self, key: object) -> Path:
        """Return where the kernel of a key is kept."""
        name = hashlib.sha256(repr((self._stamp, key)).encode()).hexdigest()[:16]
        return self._folder / f"{self._name}.{name}.nbc"

    def load(self, key: object) -> Any:
        """Return the kernel of a key; None if there is none, or a damaged one. Nothing damaged is unpickled."""
        try:
            content = memoryview(self.path(key).read_bytes())
        except OSError:
            return None
        if hashlib.sha256(content[_DIGEST:]).digest() != content[:_DIGEST]:
            return None
        saved, kernel = pickle.loads(content[_DIGEST:])
        return kernel if saved == (self._stamp, key) else None

    @contextlib.contextmanager
    def alone(self, key: object, wait: bool) -> Iterator[bool]:
        """Give whether no other process is in such a block for the same key; wait: until none is.

        Where the file system has no locks, or no room for them, all are let in: each compiles for itself.
        """
        place = int(self.path(key).suffixes[-2][1:], 16) >> 2
        try:
            handle = _locks()
            fcntl.lockf(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB), 1, place)
        except (BlockingIOError, PermissionError):
            yield False
            return
        except OSError:
            yield True
            return
        try:
            yield True
        finally:
            fcntl.lockf(handle, fcntl.LOCK_UN, 1, place)

    def save(self, key: object, kernel: Any) -> None:
        """Keep the kernel of a key in place of whatever is there; raises OSError if it cannot be stored."""
        path, content = self.path(key), serialize.dumps(((self._stamp, key), kernel))  # type: ignore[no-untyped-call]
        part = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
        if path.is_dir():
            shutil.rmtree(path)
        try:
            part.write_bytes(hashlib.sha256(content).digest() + content)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


@cache
def _locks() -> int:
    """Return a handle of the file whose bytes are locked: open to the end, as closing it would free all of them."""
    return os.open(cache_folder() / "locks", os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)


class _Locator(UserProvidedCacheLocator):
    """The folder chosen for kernels, and no other: the others that numba tries would serve stale kernels.

    A kernel is known by the digest of its sources, wherever they lie: a copy of the project compiles nothing again. Of
    one outside the package, a benchmark's, that is its own file.
    """

    def __init__(self, py_func: Callable[..., Any], py_file: str) -> None:
        super().__init__(py_func, py_file)  # type: ignore[no-untyped-call]
        self._module, self._file = py_func.__module__, Path(py_file)

    def get_cache_path(self) -> str:
        return str(cache_folder())

    def get_source_stamp(self) -> str:
        return code_digest(self._module) + hashlib.sha256(self._file.read_bytes()).hexdigest()

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator:
        return cls(py_func, py_file)


class _Implementation(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012 (as numba has it)


class _KernelCache(FunctionCache):
    """Numba's cache of a function, with files of our own."""

    _impl_class = _Implementation
    _cache_file: Any

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        locator = self._impl.locator
        folder, stamp = Path(locator.get_cache_path()), locator.get_source_stamp()
        self._cache_file = KernelFiles(folder, self._impl.filename_base, stamp)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return what is stored, None if that is nothing; raises NotStoredError for nothing in `only_stored`."""
        found = super().load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        if found is None and LOADING.get():
            raise NotStoredError
        return found

    def alone(self, sig: Any, target_context: Any, *, wait: bool) -> contextlib.AbstractContextManager[bool]:
        """Return a block that one process at a time is in for a signature; see `KernelFiles.alone`."""
        key = self._index_key(sig, target_context.codegen())  # type: ignore[no-untyped-call]
        return cast(KernelFiles, self._cache_file).alone(key, wait)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled; where it cannot be stored, it serves this process alone."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]


# Of these numba has no types.
_Library: Any = codegen.JITCodeLibrary
_Lowering: Any = typed_passes.NativeLowering
_Compiler: Any = compiler.Compiler
_Dispatcher: Any = registry.CPUDispatcher
_FunctionCompiler: Any = vars(dispatcher)["_FunctionCompiler"]
_register_pass: Any = compiler_machinery.register_pass


class _Kernel(_Dispatcher):  # type: ignore[misc]
    """A compiled function that Python calls."""

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
        """Compile, or load; garbage is left, as most of what that makes stays."""
        enabled = gc.isenabled()
        gc.disable()
        try:
            return super().compile(sig)
        finally:
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


# Functions of a part, at most, that is optimised: one that holds more is far from any inner loop.
_MANY = 40


class _PartLibrary(_Library):  # type: ignore[misc]
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
class _PartLowering(_Lowering):  # type: ignore[misc]
    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        state.flags.no_compile = True
        super().run_pass(state)
        entry = object()  # by which what calls the part finds it
        state.targetctx.insert_user_function(entry, state["cr"].fndesc, [state.library])
        state["cr"] = state["cr"]._replace(cfunc=entry)
        return True


class _PartCompiler(_Compiler):  # type: ignore[misc]
    def define_pipelines(self) -> list[Any]:
        (pipeline,) = super().define_pipelines()
        pipeline.passes = [
            (_PartLowering if made is _Lowering else made, description) for made, description in pipeline.passes
        ]
        pipeline.finalize()
        return [pipeline]


@cache
def _callable(part: _Part) -> Any:
    def call(*arguments: Any) -> Any:
        return part(*arguments)

    return numba.njit(call, error_model="numpy", fastmath=False)


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
        named = {name: value for name, value in options.items() if name != "cache"}
        kernel = _Kernel(function, targetoptions=named | {"no_cfunc_wrapper": True})
        kernel._cache = _KernelCache(function)
        return kernel
    bare = options | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    part = _Part(function, targetoptions=bare, pipeline_class=_PartCompiler)
    if bodies is not None:
        part._compiler.__class__ = _ChoiceCompiler
        part._compiler.bodies = bodies
    return part


def type_of(intrinsic: Any) -> Any:
    """Return numba's type of an intrinsic that has just been imported."""
    target: Any = registry.cpu_target
    target.typing_context.refresh()
    target.target_context.refresh()
    return target.typing_context.resolve_value_type(intrinsic)

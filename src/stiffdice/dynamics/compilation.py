"""`njit` with a cache on disk that never serves stale code.

Numba looks only at the file of a cached function, not at those it imports: edit a contact law, and a cached kernel
would keep the old physics. So the folder of the cache carries a digest of all sources of the simulation, and the
versions that compile them. What is in it is digested, too, and known by the processor it is for (`kernel_cache`).
"""

from __future__ import annotations

import gc
import hashlib
import inspect
import os
import stat
import tempfile
from collections.abc import Callable
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from stiffdice.dynamics.code_digest import code_digest
from stiffdice.errors import OutputError

_BLOCK = 4096  # bytes: a full disk has not one


def _cache_folder() -> Path:
    parts = [code_digest("stiffdice.simulation.run"), version("numba"), version("numpy"), version("llvmlite")]
    name = "kernels-" + hashlib.sha256(" ".join(parts).encode()).hexdigest()[:16]
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    fallback = _temporary() / f"stiffdice-{os.getuid()}"
    try:
        home = Path(base) if base else Path("~/.cache").expanduser()
    except RuntimeError:  # a user without a home
        home = fallback
    if home.name.startswith("kernels-") and home.parent.name == "stiffdice":
        home = home.parent.parent  # a parent process set it to its own folder
    for parent in (home / "stiffdice", fallback):
        try:
            if _is_made(parent) and _is_made(parent / name) and _has_room(parent / name):
                return parent / name
        except OSError:
            continue
    try:
        return Path(tempfile.mkdtemp(prefix="stiffdice-"))
    except OSError as error:
        raise OutputError(
            f"compiled kernels: neither {home} nor a folder for temporary files can be written ({error.strerror}); "
            "name one that can be in NUMBA_CACHE_DIR"
        ) from None


def _is_made(folder: Path) -> bool:
    """Make a folder if it is not there; return whether it is one, no link to one, ours, and not for all to write."""
    folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    found = folder.lstat()
    return stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & stat.S_IWOTH


def _has_room(folder: Path) -> bool:
    """Return whether files can be written there: numba does not ask, and fails at the end of compiling."""
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(_BLOCK))
    except OSError:
        return False
    return True


def _temporary() -> Path:
    try:
        return Path(tempfile.gettempdir())
    except OSError:  # there is none that can be written
        return Path("/tmp")


# In the environment for child processes and for numba to find when it reads it again; in its configuration in case
# that somebody imported numba before.
_FOLDER = str(_cache_folder())
os.environ["NUMBA_CACHE_DIR"] = _FOLDER

import numba  # noqa: E402
from numba.core import codegen, compiler, compiler_machinery, dispatcher, registry, typed_passes  # noqa: E402

from stiffdice.dynamics.kernel_cache import KernelCache  # noqa: E402

setattr(numba.config, "CACHE_DIR", _FOLDER)  # noqa: B010 (mypy knows no such attribute)


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
        """Compile for a signature, or load what is stored; garbage is left, as most of what that makes stays."""
        enabled = gc.isenabled()
        gc.disable()
        try:
            return super().compile(sig)
        finally:
            if enabled:
                gc.enable()


class _Part(_Dispatcher):  # type: ignore[misc]
    """A compiled function that is meant for compiled code, without machine code and wrappers for calls from Python.

    They are half of all time to compile. Who does call it from Python, a test, say, has a kernel made for the call;
    numba's own would jump to nowhere.
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


class _PartLibrary(_Library):  # type: ignore[misc]
    """LLVM code of a part: optimised and turned into machine code with the kernel that takes it in, not before."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

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


def njit(*function: Any, **options: Any) -> Any:
    """Compile a function as numba's decorator does, with division by zero giving infinity or not-a-number.

    At the extremes a step, a stiffness or a weight may leave the range of doubles; that is a result, not an error.
    Arithmetic is as written unless `fastmath` is asked for here: left unsaid, numba takes it from whoever happens to
    call the function first. What is not kept in the cache on disk is a part of what is, and compiled as such.
    """
    options = {"error_model": "numpy", "fastmath": False, "nopython": True} | options
    cached = options.pop("cache", False)

    def compiled(python: Callable[..., Any]) -> Any:
        if not cached:
            bare = options | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
            return _Part(python, targetoptions=bare, pipeline_class=_PartCompiler)
        kernel = _Kernel(python, targetoptions=options)
        kernel._cache = KernelCache(python)
        return kernel

    return compiled(*function) if function else compiled


def constant(value: Any) -> Any:
    """Return a function, for compiled code only, that returns a value whatever its arguments."""

    @njit
    def body(*arguments: Any) -> Any:
        return value

    return body


class _ChoiceCompiler(_FunctionCompiler):  # type: ignore[misc]
    """Compiles, for a tag, a call of the body that it stands for."""

    bodies: dict[type, Any]

    def _get_implementation(self, args: Any, kws: Any) -> Any:
        body = self.bodies[args[0].instance_class]
        return lambda tag, *arguments: body(*arguments)


def by_tag(bodies: dict[type, Any], *, inlined: bool = False) -> Any:
    """Return a function, for compiled code only, that calls the body which the type of its first argument stands for.

    The first argument is a tag: an empty named tuple that stands for a model or a scheme. The body,
    which gets the arguments after it, is chosen at compile time, which costs nothing in a loop; unlike functions passed
    as arguments it leaves the kernel cacheable on disk, and unlike string literals it does not slow down every call of
    it (1 µs against 11 ms, numba 0.68). inlined: put what chooses into its caller, whatever its size.
    """

    @njit(forceinline=inlined)
    def call(tag: Any, *arguments: Any) -> Any:
        raise TypeError("chosen by the type of the tag")

    call._compiler.__class__ = _ChoiceCompiler
    call._compiler.bodies = bodies
    return call

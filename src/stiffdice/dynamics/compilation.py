"""`njit` with a cache on disk that never serves stale code.

Numba looks only at the file of a cached function, not at those it imports: edit a contact law, and a cached kernel
would keep the old physics. So the folder of the cache carries a digest of all sources of the simulation, and the
versions that compile them. Each file in it begins with its own digest, and is known by the processor that it is for;
what does not match is compiled again.
"""

from __future__ import annotations

import contextlib
import gc
import hashlib
import inspect
import os
import pickle
import shutil
import stat
import tempfile
import uuid
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numba
from numba.core import codegen, compiler, compiler_machinery, dispatcher, registry, serialize, typed_passes
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator

from stiffdice.dynamics.code_digest import code_digest
from stiffdice.errors import OutputError


def _cache_folder() -> Path:
    parts = [code_digest("stiffdice.simulation.run"), version("numba"), version("numpy"), version("llvmlite")]
    name = "kernels-" + hashlib.sha256(" ".join(parts).encode()).hexdigest()[:16]
    base = os.environ.get("NUMBA_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME")
    try:
        home = Path(base) if base else Path("~/.cache").expanduser()
    except RuntimeError:  # a user without a home
        home = Path("/tmp")
    if home.name.startswith("kernels-") and home.parent.name == "stiffdice":
        home = home.parent.parent  # a parent process set it to its own folder
    for place in (home, None):
        with contextlib.suppress(OSError):
            folder = (place / "stiffdice" if place else Path(tempfile.gettempdir(), f"stiffdice-{os.getuid()}")) / name
            if _is_made(folder.parent) and _is_made(folder):
                with tempfile.TemporaryFile(dir=folder) as file:
                    file.write(bytes(4096))  # on a full disk numba would fail, at the end of compiling
                return folder
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


# In the environment for child processes and for numba to find when it reads it again.
os.environ["NUMBA_CACHE_DIR"] = str(_cache_folder())
setattr(numba.config, "CACHE_DIR", os.environ["NUMBA_CACHE_DIR"])  # noqa: B010 (mypy knows no such attribute)

_DIGEST = hashlib.sha256().digest_size
_LOADING: ContextVar[bool] = ContextVar("_LOADING", default=False)
_TELLING: ContextVar[Callable[[], None] | None] = ContextVar("_TELLING", default=None)


class NotStoredError(Exception):
    """A kernel is not on disk, and is not to be compiled now."""


@contextlib.contextmanager
def only_stored() -> Iterator[None]:
    """Raise NotStoredError where the block would have to compile a kernel."""
    token = _LOADING.set(True)
    try:
        yield
    finally:
        _LOADING.reset(token)


@contextlib.contextmanager
def telling(compiles: Callable[[], None]) -> Iterator[None]:
    """Call a function before a kernel is compiled in the block."""
    token = _TELLING.set(compiles)
    try:
        yield
    finally:
        _TELLING.reset(token)


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


class _Locator(UserProvidedCacheLocator):
    """The folder chosen above, and no other: the others that numba tries would serve stale kernels."""

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
        if found is None and _LOADING.get():
            raise NotStoredError
        if found is None and (compiles := _TELLING.get()) is not None:
            compiles()
        return found

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


def njit(function: Any = None, **options: Any) -> Any:
    """Compile a function as numba's decorator does, with division by zero giving infinity or not-a-number.

    At the extremes a step, a stiffness or a weight may leave the range of doubles; that is a result, not an error.
    Arithmetic is as written unless `fastmath` is asked for here: left unsaid, numba takes it from whoever happens to
    call the function first. What is not kept in the cache on disk is a part of what is, and compiled as such.
    """
    if function is None:
        return partial(njit, **options)
    options = {"error_model": "numpy", "fastmath": False, "nopython": True} | options
    if not options.pop("cache", False):
        bare = options | {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        return _Part(function, targetoptions=bare, pipeline_class=_PartCompiler)
    kernel = _Kernel(function, targetoptions=options | {"no_cfunc_wrapper": True})
    kernel._cache = _KernelCache(function)
    return kernel


def constant(value: Any) -> Any:
    """Return a function, for compiled code only, that returns a value whatever its arguments."""
    return njit(lambda *arguments: value)


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

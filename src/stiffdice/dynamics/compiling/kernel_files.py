"""Compiled kernels on disk, never stale ones.

Each file begins with its own digest, and is known by the processor that it is for; what does not match is compiled
again.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import os
import pickle
import shutil
import uuid
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, cast

from numba.core import serialize
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator

from stiffdice.dynamics.code_digest import code_digest
from stiffdice.dynamics.compiling.kernel_cache import LOADING, NotStoredError, cache_folder
from stiffdice.dynamics.compiling.separate_kernels import Call

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
    """What is stored of a kernel: before it, which separate kernels it calls."""

    _locator_classes = [_Locator]  # noqa: RUF012 (as numba has it)

    def reduce(self, data: Any) -> Any:
        reduced = super().reduce(data)  # type: ignore[no-untyped-call]
        return [call.name for call in data.library.calls()], reduced

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        calls, reduced = payload
        for call in calls:
            Call.named(*call).link()
        return super().rebuild(target_context, reduced)  # type: ignore[no-untyped-call]


class KernelCache(FunctionCache):
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

    def stem(self, sig: Any, target_context: Any) -> str:
        """Return the name of the file of a signature, without its ending."""
        key = self._index_key(sig, target_context.codegen())  # type: ignore[no-untyped-call]
        return cast(KernelFiles, self._cache_file).path(key).stem

    def alone(self, sig: Any, target_context: Any, *, wait: bool) -> contextlib.AbstractContextManager[bool]:
        """Return a block that one process at a time is in for a signature; see `KernelFiles.alone`."""
        key = self._index_key(sig, target_context.codegen())  # type: ignore[no-untyped-call]
        return cast(KernelFiles, self._cache_file).alone(key, wait)

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled; where it cannot be stored, it serves this process alone."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)  # type: ignore[no-untyped-call]

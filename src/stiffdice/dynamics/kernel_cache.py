"""Compiled kernels on disk: each file begins with its digest, and what does not match it is compiled again."""

from __future__ import annotations

import contextlib
import hashlib
import pickle
import shutil
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from numba.core import serialize
from numba.core.caching import CompileResultCacheImpl, FunctionCache, UserProvidedCacheLocator

_dumps: Callable[[object], bytes] = serialize.dumps  # numba has it without types
_DIGEST = hashlib.sha256().digest_size
_LOADING: ContextVar[bool] = ContextVar("_LOADING", default=False)


class NotStoredError(Exception):
    """A kernel is not on disk, and is not to be compiled now."""


@contextmanager
def only_stored() -> Iterator[None]:
    """Raise NotStoredError where the block would have to compile a kernel."""
    token = _LOADING.set(True)
    try:
        yield
    finally:
        _LOADING.reset(token)


_TELLING: ContextVar[Callable[[], None] | None] = ContextVar("_TELLING", default=None)


@contextmanager
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
        path, content = self.path(key), _dumps(((self._stamp, key), kernel))
        part = path.with_name(f"{path.name}.{uuid.uuid4().hex}.part")
        if path.is_dir():
            shutil.rmtree(path)
        try:
            part.write_bytes(hashlib.sha256(content).digest() + content)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)


class _Locator(UserProvidedCacheLocator):
    """The folder that `compiled` has chosen, and no other: the others that numba tries would serve stale kernels."""

    @classmethod
    def from_function(cls, py_func: Callable[..., Any], py_file: str) -> _Locator:
        return cls(py_func, py_file)


class _Implementation(CompileResultCacheImpl):
    _locator_classes = [_Locator]  # noqa: RUF012 (as numba has it)


class KernelCache(FunctionCache):
    """Numba's cache of a function, with files of our own."""

    _impl_class = _Implementation
    _cache_file: Any

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)  # type: ignore[no-untyped-call]
        locator = self._impl.locator
        self._cache_file = KernelFiles(
            Path(locator.get_cache_path()), self._impl.filename_base, locator.get_source_stamp()
        )

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

"""What numba compiles. Numba itself comes with `compiler.py`, when it does."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, partial, update_wrapper
from typing import Any


class Compiled:
    """A function that numba compiles. Numba is imported once it is called, or taken into another that is.

    bodies: by the type of the first argument, of a function that calls one of them with the others. options: numba's,
    in place of those that all have.
    """

    def __init__(self, function: Callable[..., Any], bodies: dict[type, Any] | None, options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func, self._bodies = function, bodies
        self._options = {"error_model": "numpy", "fastmath": False, "nopython": True} | options

    @cached_property
    def dispatcher(self) -> Any:
        """What numba has for the function."""
        from stiffdice.dynamics.compiling import compiler

        return compiler.dispatcher_of(self.py_func, self._bodies, self._options)

    @property
    def is_compiled(self) -> bool:
        """Whether it is compiled for any arguments, in this process."""
        return "dispatcher" in vars(self) and bool(self.dispatcher.overloads)

    @property
    def _numba_type_(self) -> Any:
        return self.dispatcher._numba_type_

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call it, compiled for these arguments if it was not."""
        return self.dispatcher(*arguments, **named)


class Intrinsic:
    """A function for compiled code only that writes LLVM's: that of this name in `lanes.py`."""

    def __init__(self, name: str) -> None:
        self._name = name

    @property
    def _numba_type_(self) -> Any:
        from stiffdice.dynamics.compiling import compiler

        return compiler.type_of(self._name)


def compile_together(*calls: tuple[Compiled, tuple[Any, ...]]) -> None:
    """Compile kernels for what they are about to be called with, the heaviest first, in two processes if that helps."""
    from stiffdice.dynamics.compiling import parallel_compilation

    parallel_compilation.compile_together([(kernel.dispatcher, arguments) for kernel, arguments in calls])


def njit(function: Any = None, **options: Any) -> Any:
    """Compile a function as numba's decorator does, with division by zero giving infinity or not-a-number.

    At the extremes a step, a stiffness or a weight may leave the range of doubles; that is a result, not an error.
    Arithmetic is as written unless `fastmath` is asked for here: left unsaid, numba takes it from whoever happens to
    call the function first. What is not kept in the cache on disk is a part of what is, and compiled as such.
    """
    if function is None:
        return partial(njit, **options)
    return Compiled(function, None, options)


def separate(returns: str) -> Any:
    """Compile a function as a kernel of its own, which other kernels call by its address; numba's would hold a copy.

    So it is compiled beside what calls it, and once for all that do. It is never put into its caller: that is for what
    works for longer than a call takes, some nanoseconds. returns: numba's type of what it returns, by which its callers
    are compiled.
    """
    return njit(cache=True, returns=returns)


def constant(value: Any) -> Any:
    """Return a function, for compiled code only, that returns a value whatever its arguments."""
    return njit(lambda *arguments: value)


def by_tag(bodies: dict[type, Any], *, inlined: bool = False) -> Any:
    """Return a function, for compiled code only, that calls the body which the type of its first argument stands for.

    The first argument is a tag: an empty named tuple that stands for a model or a scheme. The body, which gets the
    arguments after it, is chosen at compile time, which costs nothing in a loop; unlike functions passed as arguments
    it leaves the kernel cacheable on disk, and unlike string literals it does not slow down every call of it (1 µs
    against 11 ms, numba 0.68). inlined: put what chooses into its caller, whatever its size.
    """

    def call(tag: Any, *arguments: Any) -> Any:
        raise TypeError("chosen by the type of the tag")

    return Compiled(call, bodies, {"forceinline": inlined})


# Numbers of several members side by side, in compiled code; `lanes.py` says what there is of them. load(array, row,
# width): a row of an array of doubles, shape (row, width). store(array, row, value): keep lanes there. where(mask, yes,
# no): `yes` in the lanes of the mask and `no` in the others. bits(mask): a whole number, lane k its bit k.
load: Any = Intrinsic("load")
store: Any = Intrinsic("store")
where: Any = Intrinsic("where")
bits: Any = Intrinsic("bits")

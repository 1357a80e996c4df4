"""What the processor can do at best, measured: its clock, how long one operation waits for another, its FMA peak.

No counter of the processor is read, as a guest system may have none. The clock follows from a chain of operations of
which each takes a cycle on every processor of this century; the latencies of the floating-point operations from chains
of them; the peak from as many independent chains as a vector unit can be kept full with.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import numba
import numpy as np

from benchmarks.case import Case, Effort
from stiffdice.dynamics.compilation import njit

# Of which a call makes so many at full effort; about a millisecond.
_LINKS = 1_000_000

# Shifts and exclusive ors in a round of xorshift64 (Marsaglia, J. Stat. Softw. 8(14), 2003), each waiting for the last.
_PER_ROUND = 6

# Multiply-adds of one accumulator in a row: more would wait for each other, fewer for the memory.
_DEPTH, _ACCUMULATORS = 8, 256


@njit(cache=True)
def _shifted(x: Any, rounds: int) -> Any:
    """Return x after so many rounds of xorshift64; no compiler finds a shorter way."""
    for _ in range(rounds):
        x ^= x << np.uint64(13)
        x ^= x >> np.uint64(7)
        x ^= x << np.uint64(17)
    return x


@njit(cache=True)
def _added(x: float, a: float, links: int) -> float:
    for _ in range(links):
        x = x + a
    return x


@njit(cache=True)
def _multiplied(x: float, a: float, links: int) -> float:
    for _ in range(links):
        x = x * a
    return x


@njit(cache=True, fastmath={"contract"})
def _fused(x: float, a: float, links: int) -> float:
    for _ in range(links):
        x = x * a + a
    return x


@njit(cache=True)
def _divided(x: float, a: float, links: int) -> float:
    for _ in range(links):
        x = a / x
    return x


@njit(cache=True)
def _rooted(x: float, a: float, links: int) -> float:
    for _ in range(links):
        x = math.sqrt(x)
    return x


@njit(cache=True)
def _sine(x: float, a: float, links: int) -> float:
    for _ in range(links):
        x = math.sin(x)
    return x


# By the name that a case's chain uses.
LATENCIES: dict[str, Callable[..., float]] = {
    "add": _added,
    "multiply": _multiplied,
    "fuse": _fused,
    "divide": _divided,
    "root": _rooted,
    "sine": _sine,
}


@numba.njit(error_model="numpy", fastmath={"contract"})
def _fused_in_parallel(x: Any, a: float, b: float, rounds: int) -> None:
    """Take multiply-adds with every element of x; not cached on disk, so that its machine code can be looked at."""
    for _ in range(rounds):
        for k in range(x.shape[0]):
            y = x[k]
            for _ in range(_DEPTH):
                y = y * a + b
            x[k] = y


def _peak(rounds: int) -> Callable[[], None]:
    x = np.ones(_ACCUMULATORS)

    def run() -> None:
        _fused_in_parallel(x, 0.999, 1e-3, rounds)

    return run


@cache
def vector_width() -> int:
    """Return how many bits of a vector register the compiler fills in a loop it can vectorise."""
    _fused_in_parallel(np.ones(_ACCUMULATORS), 0.999, 1e-3, 1)
    code = "\n".join(_fused_in_parallel.inspect_asm().values())
    for register, bits in (("zmm", 512), ("ymm", 256)):
        if re.search(rf"\bvfn?m(add|sub)\w*pd\b.*%{register}", code):
            return bits
    return 128


def compiler() -> dict[str, Any]:
    """Return the attributes that say what compiled the kernels, and for which processor."""
    return {
        "compiler": f"LLVM {'.'.join(map(str, llvm.llvm_version_info))}",
        "compiler_target": llvm.get_host_cpu_name(),
        "vector_width": vector_width(),
        "vector_width_units": "bit",
    }


def cases(effort: Effort) -> Iterator[Case]:
    """Yield the clock, the latencies and the peak."""
    links = min(_LINKS, 10 * effort.steps)
    rounds = max(1, links // _PER_ROUND)
    start = np.uint64(88172645463325252)
    yield Case(
        "cycle",
        "clock, by a chain of shifts and exclusive ors",
        "cycle",
        rounds * _PER_ROUND,
        lambda: lambda: _shifted(start, rounds),
        effort.rounds,
        "the clock, as it is under this load",
    )
    for name, chain in LATENCIES.items():
        yield Case(
            f"latency_{name}",
            f"latency of the operation {name}, in doubles",
            "operation",
            links,
            lambda chain=chain: lambda: chain(1.1, 0.9999999, links),  # type: ignore[misc]
            effort.rounds,
            "each operation waits for the one before",
            flops=2 if name == "fuse" else 1,
            chain=(name,),
        )
    passes = max(1, 16 * links // (_DEPTH * _ACCUMULATORS))
    yield Case(
        "fma_peak",
        "fused multiply-add peak of one core, in doubles",
        "operation",
        2 * _DEPTH * _ACCUMULATORS * passes,
        lambda: _peak(passes),
        effort.rounds,
        "the vector units are full: two of them, lanes of each, two operations a lane, every cycle",
        flops=1,
    )

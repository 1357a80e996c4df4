"""What a benchmark measures: one case is one thing whose wall time is taken, again and again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple


class Effort(NamedTuple):
    """How much is done.

    steps: of a kernel in one call, at most. rounds: in each of which every case has its turn; slow: how often what
    takes a good part of a second does; fresh: how often what takes seconds does, new processes above all. members: of
    an ensemble. many: processes that start at once, and jobs.
    """

    steps: int
    rounds: int
    slow: int
    fresh: int
    members: int
    many: int


FULL = Effort(steps=100_000, rounds=21, slow=7, fresh=3, members=8, many=4)
# Too short to tell a time by, but all of it is done.
QUICK = Effort(steps=2_000, rounds=3, slow=3, fresh=1, members=1, many=2)


class Case(NamedTuple):
    """One thing to be timed.

    name: in snake case, the variable's name in a file. what: it is, in words. per: what is counted, as `step`, and
    amount: how many of them a call makes. prepare: what has to be done before a call, untimed; returns the call. times:
    in how many of the rounds it has its turn. holds: what holds it back, in one line.
    flops: floating-point operations of one `per`; comparisons and selections are none, a quotient, a root and a sine
    are one each; 0 where nobody counted. chain: the operations, names of `roof.LATENCIES`, of which each waits for the
    one before, and the first for the last of the `per` before: a bound from below, whatever else is done meanwhile.
    fresh: a call stands alone, and there is nothing to be warmed up. version: of a package other than ours.
    """

    name: str
    what: str
    per: str
    amount: float
    prepare: Callable[[], Callable[[], object]]
    times: int
    holds: str
    flops: float = 0
    chain: Sequence[str] = ()
    fresh: bool = False
    version: str = ""


class Missing(NamedTuple):
    """What could not be measured, and in one line why."""

    name: str
    why: str

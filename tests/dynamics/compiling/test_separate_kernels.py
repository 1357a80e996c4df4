"""Kernels that other kernels call by their addresses."""

from __future__ import annotations

import pytest

OWN = """
import os
import sys
import numba
from stiffdice.dynamics.compilation import njit, separate
from stiffdice.dynamics.compiling import kernel_files, parallel_compilation

store, first = kernel_files.KernelFiles.save, os.getpid()

def save(self, key, kernel):
    print("stored", "here" if os.getpid() == first else "elsewhere", self._name.partition("-")[0], flush=True)
    store(self, key, kernel)

kernel_files.KernelFiles.save = save
parallel_compilation._can_fork = lambda: "fork" in sys.argv

@separate("{returns}")
def third(x):
    return x / 3.0

@njit(cache=True)
def sum_of_thirds(x, y):
    return third(x) + third(y)

@njit(cache=True)
def twice_a_third(x):
    return 2.0 * third(x)

@separate("float64")
def ninth(x):
    return third(third(x))

@njit(cache=True)
def a_third_and_a_ninth(x):
    return third(x) + ninth(x)

@njit
def part(x):
    return third(x)

if "one" in sys.argv:
    print(sum_of_thirds(1.0, 2.0))
if "other" in sys.argv:
    print(twice_a_third(1.5))
if "both" in sys.argv:
    print(a_third_and_a_ninth(2.25))
if "itself" in sys.argv:
    print(third(1.5))
if "part" in sys.argv:
    print(part(1.5))
if "numba" in sys.argv:
    print(numba.njit(lambda x: third(x))(1.5))
"""


@pytest.fixture
def call(run_script):
    """Return what lines a new process prints that calls kernels."""

    def called(*what, returns="float64"):
        done = run_script(OWN.format(returns=returns), *what)
        return done.stdout.splitlines() if done.returncode == 0 else [done.stderr.splitlines()[-1]]

    return called


def stored(lines):
    return sorted(line.rpartition(".")[2] for line in lines if line.startswith("stored"))


@pytest.mark.long
@pytest.mark.parametrize("process", ["fork", "alone"])
def test_it_is_compiled_once_for_all_that_call_it(call, process):
    first = call("one", process)
    assert first[-1] == "1.0" and stored(first) == ["sum_of_thirds", "third"]
    other = call("other", process)
    assert other[-1] == "1.0" and stored(other) == ["twice_a_third"]
    assert call("one", "other", process) == ["1.0", "1.0"]


@pytest.mark.long
def test_one_that_calls_another_is_compiled_beside_its_caller_too(call):
    lines = call("both", "fork")
    assert lines[-1] == "1.0" and stored(lines) == ["a_third_and_a_ninth", "ninth", "third"]
    assert [line.rpartition(".")[2] for line in lines if line.startswith("stored here")] == ["a_third_and_a_ninth"]


@pytest.mark.long
def test_it_is_compiled_again_with_its_callers_when_it_is_gone(call, tmp_path):
    call("one")
    for kernel in tmp_path.rglob("own.third*.nbc"):
        kernel.unlink()
    again = call("one")
    assert again[-1] == "1.0" and "third" in stored(again)


@pytest.mark.long
def test_what_returns_another_type_than_its_callers_were_told_is_refused(call):
    assert "third returns float64, not int64" in call("one", returns="int64")[-1]


@pytest.mark.long
def test_python_may_call_it(call):
    assert call("itself")[-1] == "0.5"


@pytest.mark.long
def test_python_may_call_a_part_that_calls_it(call):
    assert call("part")[-1] == "0.5"


@pytest.mark.long
def test_code_that_numba_compiles_for_itself_ends_with_a_sentence(call):
    assert call("numba")[-1].endswith("compile that with `compilation.njit`")

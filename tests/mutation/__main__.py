"""Print which mutants of modules their tests do not notice; see README.md."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from tests.mutation.mutants import chosen, mutant

ROOT = Path(__file__).parent.parent.parent

# Tests of a module besides those that mirror it.
FURTHER = {
    "dynamics/models/free_flight": ["integrators/test_registry.py"],
    "dynamics/vector": ["dynamics/models/test_tumbling.py"],
    "integrators/exact/oscillator": ["integrators/exact/test_scheme.py"],
    "integrators/forward_euler": ["integrators/test_registry.py"],
    "integrators/free_flight": ["integrators/test_registry.py"],
    "integrators/member_block": ["integrators/test_batched_kernel.py"],
    "integrators/rk4": ["integrators/test_registry.py"],
    "integrators/symplectic_euler": ["integrators/test_registry.py"],
    "integrators/velocity_verlet": ["integrators/test_registry.py"],
    "integrators/registry": ["integrators/event_driven/test_dop853.py", "integrators/exact/test_scheme.py"],
    "sweep/grid": ["study/test_config.py", "simulation/test_reach.py", "sweep/test_partition.py"],
}


def tests_of(module: str) -> list[str]:
    """Return the files of tests that a module of src/stiffdice answers to, as `package/name`."""
    package, _, name = module.rpartition("/")
    mirror = f"{package}/test_{name}.py"
    files = [mirror] if (ROOT / "tests" / mirror).exists() else []
    return [f"tests/{file}" for file in files + FURTHER.get(module, [])]


def passes(module: str, index: int | None, limit: float) -> bool:
    """Return whether the tests pass, with a mutant or as it is; one that takes too long does not."""
    source = ROOT / "src/stiffdice" / f"{module}.py"
    environment = dict(os.environ)
    with tempfile.TemporaryDirectory() as folder:
        if index is not None:
            environment["STIFFDICE_MUTANT"] = f"stiffdice.{module.replace('/', '.')}:{index}"
            if "dynamics.compilation" in source.read_text(encoding="utf-8"):
                environment["NUMBA_CACHE_DIR"] = folder  # kernels of a mutant are no one else's
        words = [sys.executable, "-m", "pytest", "-p", "tests.mutation.plugin", "--hypothesis-profile=mutants"]
        words += ["-n", "0", "-x", "-p", "no:cacheprovider", *tests_of(module)]
        try:
            done = subprocess.run(
                words, cwd=ROOT, env=environment, capture_output=True, text=True, check=False, timeout=limit
            )
        except subprocess.TimeoutExpired:
            return False
    return done.returncode == 0


def run(module: str, most: int, seed: int, limit: float) -> None:
    """Print a line for each mutant that survives, and how many were caught."""
    if not tests_of(module):
        print(f"{module}: no tests", flush=True)
        return
    if not passes(module, None, limit):
        print(f"{module}: its tests fail, or take over {limit:g} s, as it is", flush=True)
        return
    source = (ROOT / "src/stiffdice" / f"{module}.py").read_text(encoding="utf-8")
    indices = chosen(source, most, seed)
    survived = 0
    for index in indices:
        if passes(module, index, limit):
            survived += 1
            line, change = mutant(source, index)[1:]
            print(f"  {module}.py:{line}: [{index}] {change}", flush=True)
    print(f"{module}: {len(indices) - survived} of {len(indices)} caught, {survived} survived", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m tests.mutation", description=__doc__)
    parser.add_argument("modules", nargs="+", help="as dynamics/linear_theory")
    parser.add_argument("--most", type=int, default=12, help="mutants of each module")
    parser.add_argument("--seed", type=int, default=0, help="of the choice among them")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds of a run of the tests")
    given = parser.parse_args()
    for module in given.modules:
        run(module, given.most, given.seed, given.limit)


if __name__ == "__main__":
    main()

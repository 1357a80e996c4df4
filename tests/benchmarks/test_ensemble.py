"""What a step of the loop of sweeps costs is counted in its machine code."""

from __future__ import annotations

import re

import numpy as np
import pytest
from benchmarks.ensemble import FLOPS
from benchmarks.scenes import scene_of

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.compiling.kernel_files import KernelFiles
from stiffdice.dynamics.state import Ensemble
from stiffdice.integrators import member_block
from stiffdice.simulation import batch_loop
from stiffdice.simulation.initial_conditions import turned
from stiffdice.simulation.run import simulate

COST = {"vadd": 1, "vsub": 1, "vmul": 1, "vmax": 1, "vmin": 1, "vdiv": 1, "vsqrt": 1}
COST |= {"vfmadd": 2, "vfmsub": 2, "vfnmadd": 2, "vfnmsub": 2}


def operations(assembly):
    """Floating-point operations of eight members in a time loop: the shortest loop that has most of them."""

    def cost(line):
        found = re.match(r"\s+(v[a-z]+?)(?:132|213|231)?pd\s.*%zmm", line)
        return COST.get(found[1], 0) if found else 0

    lines = assembly.splitlines()
    place = {found[1]: k for k, line in enumerate(lines) if (found := re.match(r"(\.L\w+):", line))}
    jumps = [
        (place.get(found[1], k), k) for k, line in enumerate(lines) if (found := re.match(r"\s+j\w+\s+(\.L\w+)", line))
    ]
    loops = {(start, end): sum(map(cost, lines[start:end])) for start, end in jumps if start < end}
    start, end = min(
        (loop for loop in loops if loops[loop] > 0.5 * max(loops.values())), key=lambda loop: loop[1] - loop[0]
    )
    return loops[start, end]


@pytest.mark.parametrize(
    ("model", "contact"),
    [
        pytest.param(*which, marks=pytest.mark.long if which == ("sliding", "ungated") else pytest.mark.broad)
        for which in FLOPS
    ],
)
def test_operations_are_those_of_the_compiled_loop(model, contact, monkeypatch, tmp_path):
    scene = scene_of(contact, 10)
    members = Ensemble(turned(scene, model, 4), np.zeros(4))
    simulate(scene, model=model, steps=10, members=members)  # compiles all else
    loop = njit(batch_loop._march.py_func, cache=True)
    # What comes from the cache has no assembly.
    monkeypatch.setattr(loop.dispatcher._cache, "_cache_file", KernelFiles(tmp_path, "march", "anew"))
    monkeypatch.setattr(batch_loop, "_march", loop)
    simulate(scene, model=model, steps=10, members=members)
    (assembly,) = loop.dispatcher.inspect_asm().values()
    if "zmm" not in assembly:
        pytest.skip("this processor has other vectors")
    width = member_block.WIDTHS[type(member_block.ABREAST[model])]
    assert operations(assembly) == FLOPS[model, contact] * width / 8

"""The throw in GNU Octave, node by node where the throw listing goes so: `octave.m`, our own transcription."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from benchmarks.case import Case, Effort, Missing
from benchmarks.scenes import scene_of
from stiffdice.dynamics.state import Array, physics_of
from stiffdice.errors import StiffdiceError
from stiffdice.scene.scene import Scene

PROGRAM = "octave-cli"
SCRIPT = Path(__file__).with_suffix(".m")

# Enough to take a second or two; every step costs the same, on the ground and in the air.
STEPS = 1000


class Throw:
    """An Octave that has read the script and the scene, and waits to be told to go."""

    def __init__(self, scene: Scene, steps: int) -> None:
        """Start it; raises StiffdiceError if it does not come up."""
        p = physics_of(scene)
        ground = p.stiffness, p.damping, p.friction
        numbers = scene.duration / steps, *ground, *scene.launch.spin, p.mass, p.side, p.gravity, p.cutoff
        self._octave = subprocess.Popen(
            [PROGRAM, "--quiet", "--norc", "--no-history", str(SCRIPT)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        self._write(steps, *numbers)
        assert self._octave.stdout is not None
        if self._octave.stdout.readline() != b"ready\n":
            raise StiffdiceError(f"{PROGRAM} {SCRIPT.name}: {self._octave.communicate()[1].decode().strip()}")

    def _write(self, *numbers: float) -> None:
        assert self._octave.stdin is not None
        self._octave.stdin.write(np.array(numbers, float).tobytes())
        self._octave.stdin.flush()

    def go(self) -> Array:
        """Take all steps and return the place after them [m], shape (3,); once."""
        self._write(1)
        assert self._octave.stdout is not None
        place = self._octave.stdout.readline()
        self._octave.communicate()
        return np.array(place.split(), float)


def _ready(scene: Scene, steps: int) -> Callable[[], Array]:
    return Throw(scene, steps).go


def cases(effort: Effort) -> Iterator[Case | Missing]:
    """Yield the throw as listed."""
    if shutil.which(PROGRAM) is None:
        yield Missing("octave_listing", f"the program {PROGRAM} is not installed")
        return
    told = subprocess.run([PROGRAM, "--version"], capture_output=True, text=True, check=True).stdout.splitlines()[0]
    steps = max(20, min(STEPS, effort.steps // 100))
    yield Case(
        "octave_listing",
        "throw, ungated: GNU Octave, node by node as the throw listing goes",
        "step",
        steps,
        lambda: _ready(scene_of("ungated", steps), steps),
        effort.slow,
        "interpreted: some 120 calls a step, each of a microsecond or more",
        fresh=True,
        version=f"octave {told.split()[-1]}",
    )

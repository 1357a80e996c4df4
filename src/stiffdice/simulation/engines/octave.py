"""Our own transcription of the paper's model, `octave.m` beside this file, run by GNU Octave.

One Octave serves all runs of a process. It is asked for some steps from a state at a time, and knows nothing between
two requests. Numbers go both ways as doubles, not as text. It ends when its input does: at the latest after the request
in hand when this process is killed.
"""

from __future__ import annotations

import atexit
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from typing import IO, Any

import numpy as np

from stiffdice.dynamics.state import STATE, TOUCHING, TURNING, Array, States, physics_of
from stiffdice.errors import StiffdiceError
from stiffdice.simulation.engines.adapter import Engine

PROGRAM = shutil.which("octave-cli")
if PROGRAM is None:
    raise ModuleNotFoundError("octave-cli is not on the PATH", name="octave-cli")

SCRIPT = Path(__file__).with_suffix(".m")


class Octave(Engine):
    """One run, standing where the last step left it."""

    BATCH = 4000  # steps of one request: about a second of work, so that an orphan does not outlive it

    def __post_init__(self) -> None:
        p, model = physics_of(self.scene), self.model
        flags = model in TURNING, model in TOUCHING, model != "vertical", self.scene.ground.contact == "gated"
        rest = p.mass, p.inertia, p.node_weight, p.stiffness, p.damping, p.friction, p.cutoff, p.nx, p.ny, p.nz
        self._constants = np.array([*flags, self.h, *rest], float)
        self._state = self.launch.copy()

    @classmethod
    @cache
    def version(cls) -> str:
        """Return the engine's name and version."""
        told = subprocess.run([str(PROGRAM), "--version"], capture_output=True, text=True, check=True).stdout
        return f"octave {told.splitlines()[0].split()[-1]}"

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations."""
        at_once = max(1, self.BATCH // every)
        for first in range(0, len(states), at_once):
            part = states[first : first + at_once]
            for done in range(0, every - self.BATCH, self.BATCH):
                self._state = self._asked(1, min(self.BATCH, every - self.BATCH - done))
            part[:] = self._asked(len(part), min(every, self.BATCH))
            self._state = part[-1:].copy()
        return len(states) * every

    def _asked(self, count: int, every: int) -> States:
        """Return `count` states, each after `every` further steps."""
        request = np.concatenate([[count, every], self._constants, self._state.view(np.float64)])
        return _process().answer(request, count * STATE.itemsize).view(STATE)


class Process:
    """An Octave that waits for requests."""

    def __init__(self) -> None:
        self._complaints: IO[bytes] = tempfile.TemporaryFile()  # noqa: SIM115 (it lives as long as the process)
        self._octave: Any = subprocess.Popen(
            [str(PROGRAM), "--quiet", "--norc", "--no-history", str(SCRIPT)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._complaints,
        )
        atexit.register(self.end)

    def answer(self, request: Array, size: int) -> Any:
        """Return so many bytes of an answer; raises StiffdiceError with Octave's own words if it gives none."""
        try:
            self._octave.stdin.write(request.tobytes())
            self._octave.stdin.flush()
            found = self._octave.stdout.read(size)
        except BrokenPipeError:
            found = b""
        except BaseException:  # interrupted: what is still to come would be taken for the next answer
            self.end()
            raise
        if len(found) < size:
            raise StiffdiceError(f"Octave gave up: {self.end() or 'it said nothing'}")
        return np.frombuffer(bytearray(found), np.uint8)

    def end(self) -> str:
        """End the process, whatever it does, forget it, and return what it complained about, in one line."""
        _process.cache_clear()
        atexit.unregister(self.end)
        self._octave.kill()
        self._octave.communicate()
        with self._complaints as complaints:
            complaints.seek(0)
            return " ".join(complaints.read().decode(errors="replace").split())


@cache
def _process() -> Process:
    return Process()

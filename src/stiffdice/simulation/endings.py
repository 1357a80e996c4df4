"""How a run ended, whatever it was asked: the verdicts that its last state, its launch and its steps tell."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.rotation import along
from stiffdice.dynamics.state import TOUCHING, TURNING, Physics, States, physics_of
from stiffdice.integrators import linear_stability
from stiffdice.integrators import registry as schemes
from stiffdice.scene.scene import Scene
from stiffdice.simulation.outcome import Verdict

Flags = npt.NDArray[np.bool_]


def endings_of(
    scene: Scene,
    model: str,
    scheme: str | None,
    steps: int,
    launches: States,
    ends: States,
    memory: npt.NDArray[np.void],
    sight: npt.NDArray[np.void],
) -> dict[Verdict, Flags]:
    """Return whether each run ended so, shape (member,), by the verdict that says it.

    scheme: None for an engine's own. ends: the last states. memory, sight: what was watched of the runs.
    """
    touched = sight["touched"] > 0
    return {
        Verdict.UNRESOLVED: unresolved(scene, model, scheme, steps, touched, launches, ends),
        Verdict.SANK: sunk(physics_of(scene), ends, memory, sight),
        Verdict.STALLED: stalled(launches, scene.duration / steps),
    }


def unresolved(
    scene: Scene, model: str, scheme: str | None, steps: int, touched: Flags, launches: States, ends: States
) -> Flags:
    """Return whether steps were too long for what a run met, shape (member,).

    That is: beyond the linear limit of a contact where it touched the ground, beyond that of the ungated law's drag
    anywhere, or more than half a turn in a step, at the launch or at the end. scheme: None for an engine's own.
    """
    fewest = np.zeros(len(launches))
    if scheme is not None:
        contact, drag = linear_stability.fewest_steps(scene, model, scheme)
        fewest = np.maximum(np.where(touched, contact, 0.0), drag)
    if model in TURNING & TOUCHING and scheme not in schemes.OWN_STEPS:
        for states in (launches, ends):
            fewest = np.fmax(fewest, linear_stability.half_turn_steps(scene, states["angular_momentum"]))
    return np.asarray(steps < fewest)


def sunk(physics: Physics, ends: States, memory: npt.NDArray[np.void], sight: npt.NDArray[np.void]) -> Flags:
    """Return whether every node ended below the ground, shape (member,), and not just in the middle of a bounce.

    A bounce ends, if the cube rests with its upper nodes out, and is no deeper than the energy of the launch takes it.
    """
    normal = np.array([physics.nx, physics.ny, physics.nz])
    with np.errstate(all="ignore"):  # a run that blew up has infinite heights
        heights = along(ends["position"][:, None, :] + ends["node_offset"], normal)
        fall = np.sqrt(memory["energy"][:, 2] / (2 * physics.stiffness))
    sag = sight["sag"]
    bounces = (sag < physics.side) & (-heights.min(axis=1) <= 2 * sag + fall)
    return np.asarray((heights < 0).all(axis=1) & ~bounces)


def stalled(launches: States, h: float) -> Flags:
    """Return whether a step of h [s] at the speed of the launch is lost in round-off of the place, shape (member,)."""
    place, speed = launches["position"], launches["velocity"]
    with np.errstate(over="ignore"):  # launches may be anything
        return np.asarray(((speed != 0) & (place + h * speed == place)).any(axis=1))

"""Up to which ωh a scheme of fixed steps is linearly stable on a damped contact, and a scene's fastest contact."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from stiffdice import theory
from stiffdice.scene import Scene

# Limits are looked for up to this ωh, in so many parts of it; all of explicit schemes are below three.
_LONGEST, _LOOKS = 3.0, 3000

# What round-off may add to an eigenvalue of modulus one.
_ROUND_OFF = 1e-12


class Hardest(NamedTuple):
    """The fastest contact of a scene: its ω [rad/s], its damping ratio ζ [1], and what moves in it."""

    omega: float
    zeta: float
    mode: str


def hardest(scene: Scene, model: str) -> Hardest:
    """Return the fastest contact mode of a cube on a face, which no edge or corner exceeds.

    It is the bounce, ω² = 4S/m, for a model that does not turn the cube; rocking, 6S/m for a `solid` cube, where that
    is faster. ζ = (D/S) ω/2, as dashpots stand beside the springs. All zero where nothing touches.
    """
    stiffness, damping = scene.ground.stiffness, scene.ground.damping
    if model == "flying" or stiffness == 0:
        return Hardest(0.0, 0.0, "none")
    omega, mode = theory.contact_frequency(stiffness, scene.cube.mass), "bounce, ω² = 4 S/m"
    if model == "tumbling":
        upright = scene.with_ground(normal=(0.0, 0.0, 1.0))
        offsets = scene.cube.node_offsets()
        rocking = math.sqrt(float(theory.contact_modes(upright, offsets, offsets[:, 2] < 0)[-1]))
        if rocking > omega * (1 + _ROUND_OFF):
            omega, mode = rocking, f"rocking, ω² = {rocking**2 * scene.cube.mass / stiffness:.3g} S/m"
    return Hardest(omega, damping / stiffness * omega / 2, mode)


def stability_limit(scheme: str, zeta: float) -> float:
    """Return the ωh [1] up to which every step of a scheme shrinks or keeps x'' = −ω²x − 2ζω x'.

    Infinite for a scheme without a limit, 0 for one that is never stable. By the formula of `theory` for symplectic
    Euler, for forward Euler as |1 + hλ| <= 1 asks with both λ = ω(−ζ ± √(ζ² − 1)), for the others by the spectral
    radius of a step's linear map.
    """
    if scheme == "symplectic_euler":
        return theory.stability_limit(zeta)
    if scheme == "forward_euler":
        return 2 * zeta if zeta <= 1 else 2 / (zeta + math.sqrt(zeta - 1) * math.sqrt(zeta + 1))
    step = _STEPS.get(scheme)
    if step is None:
        return math.inf
    # A strongly damped contact is faster than its ω by 2ζ.
    longest = _LONGEST / (1 + zeta)
    stable, unstable = 0.0, longest / _LOOKS
    while _radius(step, unstable, zeta) <= 1 + _ROUND_OFF:
        stable, unstable = unstable, unstable + longest / _LOOKS
    while stable < (middle := (stable + unstable) / 2) < unstable:
        stable, unstable = (middle, unstable) if _radius(step, middle, zeta) <= 1 + _ROUND_OFF else (stable, middle)
    return stable


Step = Callable[[float, float, float, float], tuple[float, float]]


def _radius(step: Step, h: float, zeta: float) -> float:
    columns = [step(1.0, 0.0, h, zeta), step(0.0, 1.0, h, zeta)]
    return float(np.abs(np.linalg.eigvals(np.array(columns).T)).max())


def _velocity_verlet(x: float, v: float, h: float, zeta: float) -> tuple[float, float]:
    old = -x - 2 * zeta * v
    x, v = x + h * (v + h / 2 * old), v + h * old
    return x, v + h / 2 * (-x - 2 * zeta * v - old)


def _rk4(x: float, v: float, h: float, zeta: float) -> tuple[float, float]:
    there, sum_x, sum_v = (x, v), x, v
    # Of a linear motion it is the exponential series up to h⁴.
    for power in range(1, 5):
        there = h / power * there[1], -h / power * (there[0] + 2 * zeta * there[1])
        sum_x, sum_v = sum_x + there[0], sum_v + there[1]
    return sum_x, sum_v


_STEPS: dict[str, Step] = {"velocity_verlet": _velocity_verlet, "rk4": _rk4}

"""Up to which ωh a scheme of fixed steps is linearly stable on a damped contact, a scene's fastest contact, and the
steps that resolve both.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import TOUCHING, TURNING, Array
from stiffdice.scene import die
from stiffdice.scene.cube import SIGNS, Cube
from stiffdice.scene.scene import Scene

# Limits are looked for up to this ωh, in so many parts of it; all of explicit schemes are below three.
_LONGEST, _LOOKS = 3.0, 3000
# What round-off may add to an eigenvalue of modulus one.
_ROUND_OFF = 1e-12
# A damping ratio at which springs no longer matter to how fast a motion decays.
_OVERDAMPED = 1e6


class Hardest(NamedTuple):
    """The fastest contact of a scene: its ω [rad/s], its damping ratio ζ [1], and what moves in it."""

    omega: float
    zeta: float
    mode: str


def hardest(scene: Scene, model: str) -> Hardest:
    """Return the fastest contact mode of a cube on a face, which no edge or corner exceeds.

    It is the bounce, ω² = 4S/m, for a model that does not turn the cube; rocking, 6S/m for a `solid` cube, where that
    is faster; of a box, on its worst face. ζ = (D/S) ω/2, as dashpots stand beside the springs. All zero where nothing
    touches.
    """
    stiffness, damping = scene.ground.stiffness, scene.ground.damping
    if model not in TOUCHING or stiffness == 0:
        return Hardest(0.0, 0.0, "none")
    nodes = _nodes_of_mode(scene, model, falling=False)
    mode = f"bounce, ω² = {nodes:g} S/m" if nodes == linear_theory.BOUNCE_NODES else f"rocking, ω² = {nodes:.3g} S/m"
    omega = linear_theory.contact_frequency(stiffness, scene.cube.mass, nodes)
    return Hardest(omega, damping / stiffness * omega / 2, mode)


def _nodes_of_mode(scene: Scene, model: str, *, falling: bool) -> float:
    """Return k of the fastest mode's ω² = k S/m and damping k D/m: of a cube on a face, or of one damped in mid-air."""
    nodes = 2 * linear_theory.BOUNCE_NODES if falling else linear_theory.BOUNCE_NODES
    if model not in TURNING:
        return nodes
    turning = max(_fastest_on(scene, axis, falling) for axis in _faces(scene.cube)) * scene.cube.mass
    return turning if turning > nodes * (1 + _ROUND_OFF) else nodes


def _faces(cube: Cube) -> Array:
    """Return the outward normals of the faces that differ in how a body stands on them, shape (face, 3)."""
    return die.NORMALS if cube.is_box else die.NORMALS[:1]


def _fastest_on(scene: Scene, normal: Array, falling: bool) -> float:
    """Return the largest ω² [1/s²] at S = 1 kg/s² on a face's four nodes, or damped at all eight."""
    offsets = scene.cube.node_offsets()
    standing = scene.with_ground(normal=tuple(-normal), stiffness=1.0)
    touching = np.ones(len(offsets), bool) if falling else SIGNS @ normal > 0
    return float(linear_theory.contact_modes(standing, offsets, touching)[-1])


@lru_cache(maxsize=64)  # the cells of a column share them
def fewest_steps(scene: Scene, model: str, scheme: str) -> tuple[float, float]:
    """Return the fewest steps [1], not rounded, that keep a run within the linear limit of its scheme; 0 without one.

    First of the fastest contact mode (`hardest`), then of a falling cube's damping under the ungated law.
    """
    if model not in TOUCHING:
        return 0.0, 0.0
    mass, ground = scene.cube.mass, scene.ground
    with np.errstate(all="ignore"):  # numbers of a scene may be anything
        decay = scene.duration / np.float64(2 * _OVERDAMPED * stability_limit(scheme, _OVERDAMPED))
        omega, zeta, _ = hardest(scene, model)
        if omega > 0 and zeta < _OVERDAMPED:
            contact = np.float64(omega) * scene.duration / stability_limit(scheme, zeta)
        else:
            contact = _nodes_of_mode(scene, model, falling=False) * ground.damping / np.float64(mass) * decay
        drag = _nodes_of_mode(scene, model, falling=True) * ground.damping / np.float64(mass) * decay
    return float(contact), float(drag) if ground.contact == "ungated" else 0.0


def half_turn_steps(scene: Scene, momentum: Array) -> Array:
    """Return the fewest steps [1] at which a cube turns by at most half a turn in a step, shape (...).

    momentum: angular momenta [kg m²/s], shape (..., 3).
    """
    with np.errstate(all="ignore"):
        rate = np.hypot(np.hypot(momentum[..., 0], momentum[..., 1]), momentum[..., 2]) / scene.cube.least_moment
        return np.asarray(scene.duration * rate / math.pi)


def stability_limit(scheme: str, zeta: float) -> float:
    """Return the ωh [1] up to which every step of a scheme shrinks or keeps x'' = −ω²x − 2ζω x'.

    Infinite for a scheme without a limit, 0 for one that is never stable. By the formula of `linear_theory` for
    symplectic Euler, for forward Euler as |1 + hλ| <= 1 asks with both λ = ω(−ζ ± √(ζ² − 1)), for the others by the
    spectral radius of a step's linear map.
    """
    if scheme == "symplectic_euler":
        return linear_theory.stability_limit(zeta)
    if scheme == "forward_euler":
        return 2 * zeta if zeta <= 1 else 2 / (zeta + math.sqrt(zeta - 1) * math.sqrt(zeta + 1))
    step = STEPS.get(scheme)
    if step is None:
        return math.inf

    def stays(omega_h: float) -> bool:
        map_of_step = step(omega_h * np.array([[0.0, 1.0], [-1.0, -2 * zeta]]))
        return bool(np.abs(np.linalg.eigvals(map_of_step)).max() <= 1 + _ROUND_OFF)

    # A strongly damped contact is faster than its ω by 2ζ.
    part = _LONGEST / (1 + zeta) / _LOOKS
    stable, unstable = 0.0, part
    while stays(unstable):
        stable, unstable = unstable, unstable + part
    while stable < (middle := (stable + unstable) / 2) < unstable:
        stable, unstable = (middle, unstable) if stays(middle) else (stable, middle)
    return stable


def _velocity_verlet(motion: Array) -> Array:
    """Return the map of place and velocity by a step, for h times the matrix of the motion; h is its upper right."""
    kick, one = motion[1], np.eye(2)
    predicted = one + motion + [motion[0, 1] / 2 * kick, np.zeros(2)]
    return np.array([predicted[0], one[1] + (kick + kick @ predicted) / 2])


def _rk4(motion: Array) -> Array:
    """Return the same: of a linear motion the exponential series up to h⁴."""
    one = np.eye(2)
    return one + motion @ (one + motion / 2 @ (one + motion / 3 @ (one + motion / 4)))


# The map of place and velocity by a step of a linear motion x' = A x, as a function of h A.
STEPS: dict[str, Callable[[Array], Array]] = {"velocity_verlet": _velocity_verlet, "rk4": _rk4}

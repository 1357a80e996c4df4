"""Rest and rocking: the step size at which each contact mode of a cube on the ground goes unstable.

Measured twice, on the compiled step itself. Linearised: a cube is pressed lightly into the ground on four, two or one
of its nodes, and finite differences around that state give the linear map of one step; its spectral radius passes one
at the limit. In time: a cube at rest on its face is nudged, and the nudge is followed while it is small against the
sag: for some ten steps above the limit, or wherever another mode is unstable.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import STATE, Array, physics_of
from stiffdice.errors import InputError
from stiffdice.experiments.measuring import bisected, coordinates, mapped, numbers, result
from stiffdice.experiments.placement import level
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.cube import INERTIAS
from stiffdice.scene.rotation import rotated
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation.engines import registry as engines

MODEL, SCHEME = "tumbling", "symplectic_euler"
_TAGS = schemes.SCHEMES[SCHEME], MODELS[MODEL]

# By mode: the axis about which a slight turn leaves four, two or one of the upright cube's nodes lowest. An edge and a
# corner touch the ground with the longest arms when the cube is nearly flat; a steeper one has a lower frequency.
_TILTS = {
    "face_bounce": (0.0, 0.0, 0.0),
    "face_rocking": (0.0, 0.0, 0.0),
    "edge": (0.0, 1.0, 0.0),
    "corner": (-1.0, 1.0, 0.0),
}
# The modes that a nudge to the cube at rest on its face brings out: vertically, and tipped.
NUDGES = {"bounce": "face_bounce", "rocking": "face_rocking"}

# In units of the side. The preload makes forces that topple the cube, relative to those that right it as preload to
# side: an error of this order in ω². The difference must exceed round-off in a height, 1e-16, by as much. A quarter
# of the preload keeps every force in one piece of max(0, S d − D u) up to ζ = 1.
_PRELOAD = 4e-8
_DIFFERENCE = _PRELOAD / 4
_LIFT = 4 * _PRELOAD

# Below the limit and without damping the spectral radius is one to round-off in a difference.
_TINY = 1e-7

# In units of the sag of the cube at rest: the nudge, and the motion of a node up to which it is followed.
_NUDGE, _FOLLOWED = 1e-4, 1e-2
# The sag in units of the side: room for all that above round-off, and a cube that still stands on its ground.
_SAGS = 1e-7, 1e-1
# ωh in units of its limit. Slower, a run's steps show too little of a swing; faster, the nudge is out of hand at once.
_SCAN = 0.5, 1.15

_LIMITS = {
    "mode_number": ("k of omega^2 = k S/m, as the step shows it", "1"),
    "mode_number_theory": ("k of omega^2 = k S/m by theory", "1"),
    "limit": ("omega h at which one step's spectral radius passes 1; omega of the mode by theory", "1", "zeta"),
    "longest_step": ("step size h at the measured limit, as h sqrt(S/m)", "1", "zeta"),
}
_GROWTH = {"growth": ("factor by which a nudge to the cube at rest grows in a step", "1")}


def measure(
    scene: Scene,
    *,
    zeta: Sequence[float] = tuple(np.linspace(0, 1, 21)),
    nudge_zeta: Sequence[float] = (0.0, 0.2),
    omega_h_relative: Sequence[float] = tuple(np.linspace(0.9, 1.1, 41)),
    steps: int = 300,
) -> xr.Dataset:
    """Return the measured limits of all modes, and the growth of a nudge around two of them.

    scene: gives the cube's size and mass, the stiffness and gravity. zeta: damping ratios ζ = (D/S) ω/2 of each mode
    itself, up to 1, for the linearised step. nudge_zeta, omega_h_relative, steps: damping ratios, ωh in units of its
    limit, and steps at most for the nudged cube.
    Dimensions inertia, mode, zeta; and inertia, nudge, nudge_zeta, omega_h_relative. Relative accuracy: limits 2.5e-7;
    growth, but for the limit itself, 1e-6 for a sag of 2e-6 to 2e-4 of the side, else at most 6e-4.
    Raises InputError for a number out of range and for a scene in which the cube sinks too far or too little to nudge.
    """
    zeta = _numbers("zeta", zeta, 0.0, 1.0)
    nudge_zeta = _numbers("nudge_zeta", nudge_zeta, 0.0, 1.0)
    scan = _numbers("omega_h_relative", omega_h_relative, *_SCAN)
    steps = validation.count("steps", steps, at_least=20)
    lowest, highest = (part * scene.cube.side for part in _SAGS)
    if not lowest <= linear_theory.sag(scene) <= highest:
        raise InputError(
            f"ground.stiffness = {scene.ground.stiffness:g}, gravity = {scene.gravity:g}: a cube at rest sinks in by "
            f"m g/(4 S); allowed is {lowest:.3g} to {highest:.3g} [m]"
        )
    bare = level(scene, friction=0.0, damping=0.0)
    cubes = {inertia: dataclasses.replace(scene.cube, inertia=inertia) for inertia in INERTIAS}
    grounds = {inertia: dataclasses.replace(bare, cube=cube) for inertia, cube in cubes.items()}
    modes = {(inertia, name): _mode(ground, name) for inertia, ground in grounds.items() for name in _TILTS}
    unit = scene.ground.stiffness / scene.cube.mass  # of ω² [rad²/s²]

    def limits(inertia: str, name: str) -> tuple[float, float, Array, Array]:
        mode = modes[inertia, name]
        h = np.array([_limit(scene, mode, value) for value in zeta])
        return mode.square / unit, mode.predicted / unit, h * np.sqrt(mode.predicted), h * np.sqrt(unit)

    def growth(inertia: str, nudge: str, value: float, relative: float) -> list[float]:
        return [_growth(grounds[inertia], modes[inertia, NUDGES[nudge]], value, relative, steps)]

    found = coordinates(zeta=zeta) | mapped(limits, _LIMITS, inertia=INERTIAS, mode=_TILTS)
    found |= mapped(growth, _GROWTH, inertia=INERTIAS, nudge=NUDGES, nudge_zeta=nudge_zeta, omega_h_relative=scan)
    note = "inertia, damping and launch are the experiment's, not the scene's; ground: level, gated, without friction"
    return result(found, "Limits of the contact modes", scene, MODEL, SCHEME, __name__, scene_note=note)


def _numbers(key: str, values: Sequence[float], least: float, most: float) -> list[float]:
    found = numbers(key, values, "1")
    if not all(least <= value <= most for value in found):
        raise InputError(f"{key} = {validation.shown(values)}: allowed are numbers from {least:g} to {most:g} [1]")
    return found


class _Mode(NamedTuple):
    """One mode of a cube on some of its nodes."""

    step: Callable[[float, float], Array]  # of `_linearised`
    shape: Array  # (4,) of length one, in the first four coordinates of the step
    square: float  # ω² as measured [rad²/s²]
    predicted: float  # ω² by theory [rad²/s²]


def _linearised(scene: Scene, offsets: Array) -> Callable[[float, float], Array]:
    """Return what gives, for a damping [kg/s] and a step size [s], the linear map of a compiled step, shape (8, 8).

    It is that around a cube with these node offsets, pressed into the ground on the lowest: height and rotation vector,
    then their rates, weighted by √M, by central differences. The cube is not in balance: weight and preload drop out,
    being the same in both states of a pair.
    """
    side, mass, inertia = scene.cube.side, np.sqrt(scene.cube.mass), np.sqrt(scene.cube.moment_of_inertia)
    move = _DIFFERENCE * side * mass
    sizes = np.repeat([move, move * np.sqrt(scene.ground.stiffness / scene.cube.mass)], 4)
    states = np.zeros((16, 2), STATE)  # raised coordinates before lowered ones, each before and after the step
    states["position"][..., 2] = -offsets[:, 2].min() - _PRELOAD * side
    for state, change in zip(states[:, 0], np.concatenate([np.diag(sizes), np.diag(-sizes)]), strict=True):
        state["position"][2] += change[0] / mass
        state["node_offset"] = rotated(offsets, change[1:4] / inertia)
        state["velocity"][2] = change[4] / mass
        state["angular_momentum"] = change[5:] * inertia
        state["angular_velocity"] = change[5:] / inertia

    def step(damping: float, h: float) -> Array:
        physics = physics_of(scene.with_ground(damping=damping))
        for pair in states:
            schemes.advance(*_TAGS, physics, pair, 1, h, schemes.TOLERANCE)
        after = states[:, 1]
        rates = [after["velocity"][:, 2] * mass, after["angular_momentum"] / inertia]
        turned = _rotation(offsets, after["node_offset"]) * inertia
        raised, lowered = np.split(np.column_stack([after["position"][:, 2] * mass, turned, *rates]), 2)
        return np.asarray(((raised - lowered) / (2 * sizes[:, None])).T)

    return step


def _rotation(offsets: Array, turned: Array) -> Array:
    """Return the small rotations [rad] that turn a cube's nodes, shape (node, 3), to (state, node, 3).

    Σ r × (φ × r) = ⅔ Σ r² φ over a cube's nodes; exact to φ³.
    """
    return np.asarray(np.cross(offsets, turned).sum(axis=-2) / (2 / 3 * np.sum(offsets**2)))


def _mode(scene: Scene, name: str) -> _Mode:
    """Find a mode in the stiffness that the step itself shows: rates change by −h M⁻¹K times the displacements."""
    upright = scene.cube.node_offsets()
    offsets = rotated(upright, np.array(_TILTS[name]) * _LIFT)
    step, h = _linearised(scene, offsets), np.sqrt(scene.cube.mass / scene.ground.stiffness)
    stiffness = -step(0.0, h)[4:, :4] / h
    squares, shapes = np.linalg.eigh((stiffness + stiffness.T) / 2)
    bounce = np.arange(4) == np.argmax(np.abs(shapes[0]))
    found = np.argmax(np.where({"face_bounce": bounce, "face_rocking": ~bounce}.get(name, True), squares, 0.0))
    touching = offsets[:, 2] < offsets[:, 2].min() + _PRELOAD * scene.cube.side
    modes = linear_theory.contact_modes(scene, upright, touching)
    predicted = modes[np.argmin(np.abs(modes - squares[found]))]
    return _Mode(step, shapes[:, found], float(squares[found]), float(predicted))


def _limit(scene: Scene, mode: _Mode, zeta: float) -> float:
    """Return the step size [s] at which the spectral radius of the step, seen in this mode, passes one.

    By bisection, which is right here and nowhere in a sweep: contact is kept, so that the map is linear, and an
    eigenvalue leaves the unit circle at −1 only, where (ωh)² + 4ζωh − 4 has its one positive root.
    """
    omega = np.sqrt(mode.predicted)
    damping = 2 * zeta * scene.ground.stiffness / omega
    inside = np.kron(np.eye(2), mode.shape[:, None])  # a motion in this mode alone, (8, 2)

    def stable(h: float) -> bool:
        step = inside.T @ mode.step(damping, h) @ inside
        return bool(np.abs(np.linalg.eigvals(step)).max() <= 1 + _TINY)

    return bisected(stable, 0.0, 2 * linear_theory.STABILITY_LIMIT / omega, relative=1e-10)[0]


def _growth(scene: Scene, mode: _Mode, zeta: float, relative: float, steps: int) -> float:
    """Return the factor [1] by which a nudge to the cube at rest grows in a step, while it is small.

    zeta, relative: damping ratio, and ωh in units of its limit, of the nudged motion. A cube that is tipped at rest is
    toppled by its weight with m g s/2 per radian: ω² of rocking is less by that over I. A motion of one mode follows
    x₂ = a x₁ − b x₀: a and b by least squares, the growth is the larger modulus of the roots of λ² = aλ − b. Where they
    meet, at the limit without damping, only half of its digits are known.
    """
    half, sag = scene.cube.side / 2, linear_theory.sag(scene)
    tips = abs(mode.shape[0]) < 0.5
    toppling = scene.cube.mass * scene.gravity * half / scene.cube.moment_of_inertia if tips else 0.0
    omega = np.sqrt(mode.predicted - toppling)
    h = relative * linear_theory.stability_limit(zeta) / omega
    lift, tip = (0.0, _NUDGE * sag / half) if tips else (_NUDGE * sag, 0.0)
    launch = Launch(position=(0.0, 0.0, half - sag + lift), velocity=(0.0, 0.0, 0.0), orientation=(tip, 0.0, 0.0))
    damped = scene.with_ground(damping=2 * zeta * omega * scene.ground.stiffness / mode.predicted)
    nudged = dataclasses.replace(damped, launch=launch, duration=h * steps)
    state, upright = engines.ready(SCHEME, nudged, MODEL, steps, steps)()().states, scene.cube.node_offsets()
    motion = _rotation(upright, state["node_offset"])[:, 0] if tips else state["position"][:, 2] - (half - sag)
    heights = state["position"][:, 2:] + state["node_offset"][:, upright[:, 2] < 0, 2]
    small = np.abs(heights + sag).max(axis=1) <= _FOLLOWED * sag
    motion = motion[: len(small) if small.all() else int(np.argmin(small))]
    a, b = np.linalg.lstsq(np.column_stack([motion[1:-1], -motion[:-2]]), motion[2:], rcond=None)[0]
    return float(np.abs(np.roots([1.0, -a, b])).max())

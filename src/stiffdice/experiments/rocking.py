"""Rest and rocking: the step size at which each contact mode of a cube on the ground goes unstable.

Measured twice, on the compiled step itself. Linearised: a cube is pressed lightly into the ground on four, two or one
of its nodes, and finite differences around that state give the linear map of one step; its spectral radius passes one
at the limit. In time: a cube at rest on its face is nudged, and what becomes of the nudge is followed step by step
while it is small against the sag. Above the limit that is for some ten steps; below it, too, for rocking with `corners`
inertia, because at such a step the bounce is unstable and soon takes over. (A bounce of a `solid` cube stays alone
where rocking is unstable: the torques of four nodes cancel to the last bit.)
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import LAWS
from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.rotation import rotated
from stiffdice.dynamics.state import STATE, Array, Physics, States, physics_of
from stiffdice.errors import InputError
from stiffdice.experiments import options
from stiffdice.experiments.bisection import bisected
from stiffdice.experiments.layout import Variable, enum, quantity
from stiffdice.experiments.placement import level
from stiffdice.experiments.sampling import states_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene import validation
from stiffdice.scene.cube import INERTIAS
from stiffdice.scene.scene import Launch, Scene
from stiffdice.simulation import dataset
from stiffdice.simulation.run import simulate

MODEL, SCHEME = "tumbling", "symplectic_euler"
_TAGS = schemes.SCHEMES[SCHEME], MODELS[MODEL], LAWS["gated"]

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


def measure(
    scene: Scene,
    *,
    zeta: Sequence[float] = tuple(np.linspace(0, 1, 21)),
    nudge_zeta: Sequence[float] = (0.0, 0.2),
    omega_h_relative: Sequence[float] = tuple(np.linspace(0.9, 1.1, 41)),
    steps: int = 300,
) -> xr.Dataset:
    """Return the measured limits of all modes, and the growth of a nudge around two of them.

    scene: gives the cube's size and mass, the stiffness and gravity; the experiment sets inertia, damping and launch,
    and puts the cube on level ground without friction under the gated law. zeta: damping ratios ζ = (D/S) ω/2 of each
    mode itself, up to 1, for the linearised step. nudge_zeta, omega_h_relative, steps: damping ratios, ωh in units of
    its limit, and steps at most for the nudged cube.
    Dimensions inertia, mode, zeta; and inertia, nudge, nudge_zeta, omega_h_relative.
    Relative accuracy: limits 2.5e-7, stored as `limit_error`; growth, but for the limit itself, 1e-6 for a sag of
    2e-6 to 2e-4 of the side, 6e-4 on the softest ground that is allowed, 2e-5 on the hardest.

    Raises InputError for a number out of range and for a scene in which the cube sinks too far or too little to nudge.
    """
    zeta = _numbers("zeta", zeta, 0.0, 1.0)
    nudge_zeta = _numbers("nudge_zeta", nudge_zeta, 0.0, 1.0)
    scan = _numbers("omega_h_relative", omega_h_relative, *_SCAN)
    steps = validation.count("steps", steps, at_least=20)
    grounds = [_on_level_ground(scene, inertia) for inertia in INERTIAS]
    modes = [{name: _mode(ground, name) for name in _TILTS} for ground in grounds]
    limits = np.array([[[_limit(mode, value) for value in zeta] for mode in row.values()] for row in modes])
    nudged = np.empty((len(INERTIAS), len(NUDGES), len(nudge_zeta), len(scan), 2))
    for i, ground in enumerate(grounds):
        for k, name in enumerate(NUDGES.values()):
            nudged[i, k] = [
                [_nudged(ground, modes[i][name], value, part, steps) for part in scan] for value in nudge_zeta
            ]
    attributes = dataset.provenance_attributes("Limits of the contact modes", scene, MODEL, SCHEME, __name__)
    attributes["scene_note"] = (
        "inertia, damping and launch are the experiment's, not the scene's; ground: level, gated, without friction"
    )
    coordinates = {
        "inertia": enum("inertia", INERTIAS, "moment of inertia of the cube"),
        "mode": enum("mode", list(_TILTS), "contact mode"),
        "nudge": enum("nudge", list(NUDGES), "nudge to a cube at rest on its face"),
        "zeta": quantity("zeta", zeta, "damping ratio of the mode itself, (D/S) omega/2"),
        "nudge_zeta": quantity("nudge_zeta", nudge_zeta, "damping ratio of the nudged motion"),
        "omega_h_relative": quantity("omega_h_relative", scan, "omega h of the nudged motion over its limit by theory"),
    }
    unit = scene.ground.stiffness / scene.cube.mass
    return xr.Dataset(
        _limit_variables(modes, zeta, limits, unit) | _growth_variables(nudge_zeta, scan, nudged),
        coordinates,
        attributes,
    )


def _limit_variables(
    modes: Sequence[Mapping[str, _Mode]], zeta: Sequence[float], limits: Array, unit: float
) -> dict[str, Variable]:
    """Return what was found of the linearised step; unit: S/m [rad²/s²]."""
    grid = ("inertia", "mode", "zeta")
    squares, predicted = (
        np.array([[getattr(mode, name) for mode in row.values()] for row in modes]) for name in ("square", "predicted")
    )
    limit = limits * np.sqrt(predicted)[:, :, None]
    theory = np.array([linear_theory.stability_limit(value) for value in zeta])
    return {
        "mode_number": quantity(grid[:2], squares / unit, "k of omega^2 = k S/m, as the step shows it"),
        "mode_number_theory": quantity(grid[:2], predicted / unit, "k of omega^2 = k S/m by theory"),
        "limit": quantity(
            grid, limit, "omega h at which one step's spectral radius passes 1; omega of the mode by theory"
        ),
        "limit_theory": quantity("zeta", theory, "2 (sqrt(1 + zeta^2) - zeta)"),
        "limit_error": quantity(grid, limit / theory - 1, "measured limit over theory, minus 1"),
        "longest_step": quantity(grid, limits * np.sqrt(unit), "step size h at the measured limit, as h sqrt(S/m)"),
    }


def _growth_variables(zeta: Sequence[float], scan: Sequence[float], nudged: Array) -> dict[str, Variable]:
    """Return what was found of nudges."""
    grid = ("inertia", "nudge", "nudge_zeta", "omega_h_relative")
    limits = [(value, linear_theory.stability_limit(value)) for value in zeta]
    theory = [[linear_theory.growth(part * limit, value) for part in scan] for value, limit in limits]
    followed = nudged[..., 1].astype(np.int32)
    return {
        "growth": quantity(grid, nudged[..., 0], "factor by which a nudge to the cube at rest grows in a step"),
        "growth_theory": quantity(grid[2:], theory, "the same by theory"),
        "steps_followed": quantity(grid, followed, "steps that show it: until a node has moved by 1 % of the sag"),
    }


def _numbers(key: str, values: Sequence[float], smallest: float, largest: float) -> list[float]:
    numbers = options.numbers(key, values, "1")
    if not numbers or min(numbers) < smallest or max(numbers) > largest:
        raise InputError(
            f"{key} = {validation.shown(values)}: allowed are numbers from {smallest:g} to {largest:g} [1]"
        )
    return numbers


def _on_level_ground(scene: Scene, inertia: str) -> Scene:
    ground = level(scene, friction=0.0, damping=0.0)
    lowest, highest = (part * scene.cube.side for part in _SAGS)
    if not lowest <= linear_theory.sag(scene) <= highest:
        raise InputError(
            f"ground.stiffness = {scene.ground.stiffness:g}, gravity = {scene.gravity:g}: a cube at rest sinks in by "
            f"m g/(4 S); allowed is {lowest:.3g} to {highest:.3g} [m]"
        )
    return dataclasses.replace(ground, cube=dataclasses.replace(scene.cube, inertia=inertia))


class _Contact(NamedTuple):
    """A cube on some of its nodes, and the pairs of states around it that differ in one coordinate each."""

    scene: Scene
    offsets: Array  # [m] (node, 3)
    states: States  # (2 · 8,), all raised coordinates before all lowered ones
    sizes: Array  # (8,) half the difference of a pair, in the units of `_weighted`


class _Mode(NamedTuple):
    """One mode of a contact."""

    contact: _Contact
    shape: Array  # (4,) of length one, in the first four of `_weighted`
    square: float  # ω² as measured [rad²/s²]
    predicted: float  # ω² by theory [rad²/s²]


def _contact(scene: Scene, tilt: Sequence[float]) -> _Contact:
    """Press the cube into the ground on the nodes that `tilt` leaves lowest."""
    side, mass, inertia = scene.cube.side, scene.cube.mass, scene.cube.moment_of_inertia
    offsets = rotated(scene.cube.node_offsets(), np.array(tilt) * _LIFT)
    move = _DIFFERENCE * side * np.sqrt(mass)
    sizes = np.repeat([move, move * np.sqrt(scene.ground.stiffness / mass)], 4)
    states = np.zeros(16, STATE)
    states["position"][:, 2] = -offsets[:, 2].min() - _PRELOAD * side
    states["node_offset"] = offsets
    for state, change in zip(states, np.concatenate([np.diag(sizes), np.diag(-sizes)]), strict=True):
        state["position"][2] += change[0] / np.sqrt(mass)
        state["node_offset"] = rotated(offsets, change[1:4] / np.sqrt(inertia))
        state["velocity"][2] = change[4] / np.sqrt(mass)
        state["angular_momentum"] = change[5:] * np.sqrt(inertia)
        state["angular_velocity"] = change[5:] / np.sqrt(inertia)
    return _Contact(scene, offsets, states, sizes)


def _weighted(scene: Scene, offsets: Array, states: States) -> Array:
    """Return height and rotation vector from `offsets`, then their rates, shape (state, 8), weighted by √M."""
    mass, inertia = np.sqrt(scene.cube.mass), np.sqrt(scene.cube.moment_of_inertia)
    return np.column_stack(
        [
            states["position"][:, 2] * mass,
            _rotation(offsets, states["node_offset"]) * inertia,
            states["velocity"][:, 2] * mass,
            states["angular_momentum"] / inertia,
        ]
    )


def _rotation(offsets: Array, turned: Array) -> Array:
    """Return the small rotations [rad] that turn a cube's nodes, shape (node, 3), to (state, node, 3).

    Σ r × (φ × r) = ⅔ Σ r² φ over a cube's nodes; exact to φ³.
    """
    rotation: Array = np.cross(offsets, turned).sum(axis=-2) / (2 / 3 * np.sum(offsets**2))
    return rotation


def _jacobian(contact: _Contact, damping: float, h: float) -> Array:
    """Return the linear map of one compiled step around the pressed cube, shape (8, 8), by central differences.

    The cube is not in balance: weight and preload drop out, being the same in both states of a pair.
    """
    physics = physics_of(contact.scene.with_ground(damping=damping))
    after = contact.states.copy()
    _step_each(*_TAGS, physics, after, h)
    raised, lowered = np.split(_weighted(contact.scene, contact.offsets, after), 2)
    jacobian: Array = ((raised - lowered) / (2 * contact.sizes[:, None])).T
    return jacobian


@njit(cache=True)
def _step_each(scheme: Any, model: Any, law: Any, physics: Physics, states: States, h: float) -> None:
    """Advance each state by one step of h [s]."""
    for k in range(states.shape[0]):
        schemes.step(scheme, model, law, physics, states[k], h, schemes.TOLERANCE)


def _mode(scene: Scene, name: str) -> _Mode:
    """Find a mode in the stiffness that the step itself shows: rates change by −h M⁻¹K times the displacements."""
    contact = _contact(scene, _TILTS[name])
    h = np.sqrt(scene.cube.mass / scene.ground.stiffness)
    stiffness = -_jacobian(contact, 0.0, h)[4:, :4] / h
    squares, shapes = np.linalg.eigh((stiffness + stiffness.T) / 2)
    bounce = np.argmax(np.abs(shapes[0]))
    if name == "face_bounce":
        found = bounce
    elif name == "face_rocking":
        found = np.argmax(np.where(np.arange(4) == bounce, 0.0, squares))
    else:
        found = np.argmax(squares)
    touching = contact.offsets[:, 2] < contact.offsets[:, 2].min() + _PRELOAD * scene.cube.side
    modes = linear_theory.contact_modes(scene, scene.cube.node_offsets(), touching)
    predicted = modes[np.argmin(np.abs(modes - squares[found]))]
    return _Mode(contact, shapes[:, found], float(squares[found]), float(predicted))


def _limit(mode: _Mode, zeta: float) -> float:
    """Return the step size [s] at which the spectral radius of the step, seen in this mode, passes one.

    By bisection, which is right here and nowhere in a sweep: contact is kept, so that the map is linear, and an
    eigenvalue leaves the unit circle at −1 only, where (ωh)² + 4ζωh − 4 has its one positive root.
    """
    omega = np.sqrt(mode.predicted)
    damping = 2 * zeta * mode.contact.scene.ground.stiffness / omega
    inside = np.kron(np.eye(2), mode.shape[:, None])  # a motion in this mode alone, (8, 2)

    def stable(h: float) -> bool:
        step = inside.T @ _jacobian(mode.contact, damping, h) @ inside
        return bool(np.abs(np.linalg.eigvals(step)).max() <= 1 + _TINY)

    return bisected(stable, 0.0, 2 * linear_theory.STABILITY_LIMIT / omega, relative=1e-10)[0]


def _nudged(scene: Scene, mode: _Mode, zeta: float, relative: float, steps: int) -> tuple[float, float]:
    """Return the growth per step [1] of a nudge to the cube at rest, and the number of steps that show it.

    zeta, relative: damping ratio, and ωh in units of its limit, of the nudged motion. A cube that is tipped at rest is
    toppled by its weight with m g s/2 per radian: ω² of rocking is less by that over I.
    """
    half, sag = scene.cube.side / 2, linear_theory.sag(scene)
    tips = abs(mode.shape[0]) < 0.5
    toppling = scene.cube.mass * scene.gravity * half / scene.cube.moment_of_inertia if tips else 0.0
    omega = np.sqrt(mode.predicted - toppling)
    h = relative * linear_theory.stability_limit(zeta) / omega
    lift, tip = (0.0, _NUDGE * sag / half) if tips else (_NUDGE * sag, 0.0)
    launch = Launch(position=(0.0, 0.0, half - sag + lift), velocity=(0.0, 0.0, 0.0), orientation=(tip, 0.0, 0.0))
    damped = scene.with_ground(damping=2 * zeta * omega * scene.ground.stiffness / mode.predicted)
    run = simulate(
        dataclasses.replace(damped, launch=launch, duration=h * steps),
        model=MODEL,
        scheme=SCHEME,
        steps=steps,
        every=1,
    )
    state, upright = states_of(run, steps), scene.cube.node_offsets()
    motion = _rotation(upright, state["node_offset"])[:, 0] if tips else state["position"][:, 2] - (half - sag)
    heights = state["position"][:, 2:] + state["node_offset"][:, upright[:, 2] < 0, 2]
    gone = np.flatnonzero(np.abs(heights + sag).max(axis=1) > _FOLLOWED * sag)
    last = int(gone[0]) - 1 if gone.size else len(state) - 1
    return _growth(motion[: last + 1]), last


def _growth(motion: Array) -> float:
    """Return the factor [1] by which a motion of one mode grows in a step.

    From step to step such a motion follows x₂ = a x₁ − b x₀: a and b by least squares, the growth is the larger
    modulus of the roots of λ² = aλ − b. Unlike the last amplitude over the first, this does not take for growth what a
    nudge swings up to in the end, near the limit many times its size. Where the two roots meet, at the limit without
    damping, it is known to the root of the accuracy it has elsewhere.
    """
    a, b = np.linalg.lstsq(np.column_stack([motion[1:-1], -motion[:-2]]), motion[2:], rcond=None)[0]
    return float(np.abs(np.roots([1.0, -a, b])).max())

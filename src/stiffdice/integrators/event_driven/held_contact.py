"""How a regime's forces change with the motion: what implicit steps need, with friction by its tangent.

Regularised friction, s/(|s| + ε) of the most that it can be, is straight as long as a slip s is small beside the
cutoff ε, and flat beyond. Newton's method on it as it is jumps to and fro over that knee. So the tangent is taken not
where the iterations are, but at slips that follow them.
"""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import normal_of
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import Vector, cross, dot, minus, norm, plus, plus_times, row, times, unit
from stiffdice.integrators.event_driven.active_set import BELOW, NODES, PUSHED, Contact, node_of, push_of, spin_of


@njit
def slips(contact: Contact, motion: Any, about: Any) -> None:
    """Set the velocity along the ground [m/s] of each node that is pushed, shape (8, 3)."""
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED:
            about[k, 0], about[k, 1], about[k, 2] = node_of(contact, motion, k).slip


@njit
def _tangent(physics: Physics, about: Vector) -> tuple[float, float]:
    """Return what the tangent of s/(|s| + ε) at a slip takes of a change of slip, and what bends it along that slip."""
    length = norm(about)
    long = length + physics.cutoff
    return 1.0 / long, 1.0 / (length * long * long) if length > 0.0 else 0.0


@njit
def _share(physics: Physics, about: Vector, slip: Vector) -> Vector:
    """Return s/(|s| + ε) of a slip by its tangent at the slip `about`."""
    grip, bend = _tangent(physics, about)
    return plus_times(times(grip, slip), bend * (dot(about, about) - dot(about, slip)), about)


@njit
def retouch(contact: Contact, motion: Any, about: Any) -> float:
    """Move the slips `about` towards a motion's own, shape (8, 3); return what their tangents were off by [m/s].

    Friction's law has a knee: its tangent at a slip tells little beyond. Where a slip has become larger than its
    tangent holds for, the friction that the tangent gives is kept, below the greatest, and with it the slip that has
    it; where one has turned round, none is taken (as for a diode: Nagel 1975, SPICE2, junction limiting).
    """
    physics, off = contact.physics, 0.0
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED == 0:
            continue
        here, there = row(about, k), node_of(contact, motion, k).slip
        length, most, apart = norm(here), norm(there), norm(minus(there, here))
        off = max(off, apart * apart / (min(length, most) + physics.cutoff))
        if apart > 0.5 * (length + physics.cutoff):
            kept = _share(physics, here, there)
            if most > length and norm(kept) < 1.0:
                there = times(physics.cutoff / (1.0 - norm(kept)), kept)
            elif dot(here, there) < 0.0 and most > physics.cutoff:
                there = Vector(0.0, 0.0, 0.0)
        about[k, 0], about[k, 1], about[k, 2] = there
    return off


@njit
def straighten(contact: Contact, motion: Any, about: Any, rate: Any) -> None:
    """Change a motion's rate to what it were, were friction by its tangent at the slips `about`, shape (8, 3)."""
    physics = contact.physics
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED == 0:
            continue
        node = node_of(contact, motion, k)
        own = times(1.0 / (norm(node.slip) + physics.cutoff), node.slip)
        change = minus(own, _share(physics, row(about, k), node.slip))
        force = times(physics.friction * push_of(contact, k, node), change)
        torque = cross(node.arm, force)
        for axis in range(3):
            rate[3 + axis] += force[axis] / physics.mass
            rate[6 + axis] += torque[axis]


@njit
def slopes(contact: Contact, motion: Any, about: Any, by_speed: Any, by_place: Any) -> None:
    """Set the slopes of u' and L', shape (6, 6) each: in u and L, and in place and I times rotation.

    A node's force f n − μ f p, with f = S d − D u, s the velocity along the ground and p = s/(|s| + ε) by its tangent
    at the slip `about` (shape (8, 3)), changes with the node's velocity v and place x by
    −(n − μ p) (D n·δv + S n·δx) − μ f δp.
    A rotation δθ moves the node, and the torque's arm, by δθ × r, and its velocity by ω × (δθ × r).
    """
    physics = contact.physics
    by_speed.fill(0.0)
    by_place.fill(0.0)
    spin, none = spin_of(physics, motion), Vector(0.0, 0.0, 0.0)
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED == 0:
            continue
        node, tangent = node_of(contact, motion, k), row(about, k)
        spring = physics.stiffness if contact.regime.bits[k] & BELOW else 0.0
        push = push_of(contact, k, node)
        line = plus_times(normal_of(physics), -physics.friction, _share(physics, tangent, node.slip))
        law = spring, push, line, tangent, _tangent(physics, tangent)
        for axis in range(3):
            one = unit(axis)
            _add(physics, node.arm, _force_change(physics, law, one, none), none, by_speed, axis)
            _add(physics, node.arm, _force_change(physics, law, none, one), none, by_place, axis)
            if contact.turning:
                moved = times(1.0 / physics.inertia, cross(one, node.arm))
                change = _force_change(physics, law, cross(spin, moved), moved)
                _add(physics, node.arm, _force_change(physics, law, moved, none), none, by_speed, 3 + axis)
                _add(physics, node.arm, change, cross(moved, times(push, line)), by_place, 3 + axis)


@njit
def _force_change(physics: Physics, law: Any, velocity: Vector, place: Vector) -> Vector:
    """Return by how much the force on a node changes with its velocity and its place.

    law: the spring's stiffness, the normal force, the force's direction over it, the slip of the tangent, and that.
    """
    spring, push, line, about, (grip, bend) = law
    n = normal_of(physics)
    speed = dot(n, velocity)
    lost = physics.damping * speed + spring * dot(n, place)
    slip = plus_times(velocity, -speed, n)
    change = plus_times(times(grip, slip), -bend * dot(about, slip), about)
    return plus_times(times(-lost, line), -physics.friction * push, change)


@njit
def _add(physics: Physics, arm: Vector, force: Vector, torque: Vector, slope: Any, column: int) -> None:
    """Add to a column of the slopes of u' and L' what a force on a node at `arm` does, and a torque."""
    turned = plus(cross(arm, force), torque)
    for axis in range(3):
        slope[axis, column] += force[axis] / physics.mass
        slope[3 + axis, column] += turned[axis]

"""What two boxes do to each other: at each contact of their overlap, the law by which the ground acts on a node.

At a contact of share w and depth d, whose points part at a velocity u along the direction q of the overlap's slope,
so that d' = −q·u, the force is w max(0, S d + D d'/q²) along q, and friction is −μ |q| times it along the slip,
regularised as in `contact.py`. So a dashpot acts on the velocity along q alone, however long q is, w D u along a unit
vector: where an edge grazes a plane, w q² is without bound. The law is gated: boxes that are apart feel nothing.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from stiffdice.dynamics.box_contact.overlap import CONTACT, MOST, Frame, Overlap, frame_of, overlap_of
from stiffdice.dynamics.box_contact.pair_state import PairPhysics, Pairs, are_near
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench
from stiffdice.dynamics.state import Array
from stiffdice.dynamics.vector import Vector, assign, cross, dot, minus, norm, plus, plus_times, times, vector

FORMULA = (
    "boxes overlap, U = S/2 sum of w d^2 at the vertices of the overlap below the face where that is least; at each "
    "f = w max(0, S d + D d'/q^2) q, friction -mu f |q| u_t/(|u_t| + 1e-6 r)"
)


class Load(NamedTuple):
    """A force [N], and its moment [N m] about the centre of the box whose face it is below."""

    force: Vector
    moment: Vector


class Loads(NamedTuple):
    """What the box that is not the one with the face feels: of the springs, of damping, of friction."""

    spring: Load
    damping: Load
    friction: Load


NOTHING = Load(Vector(0.0, 0.0, 0.0), Vector(0.0, 0.0, 0.0))


@njit
def overlap(physics: PairPhysics, pair: Any, contacts: Any) -> tuple[Frame, Overlap]:
    """Set the contacts of the two boxes; return the frame of the one whose face they are below, and what they are."""
    first, second = frame_of(physics.a, pair.a, physics.half_a), frame_of(physics.b, pair.b, physics.half_b)
    least = overlap_of(first, second, contacts)
    return (first if least.box == 0 else second), least


@njit
def _in_space(frame: Frame, v: Any) -> Vector:
    """Return a vector of a frame in the axes of space."""
    return plus(times(v[0], frame.axes[0]), plus(times(v[1], frame.axes[1]), times(v[2], frame.axes[2])))


@njit
def _with(load: Load, place: Vector, force: Vector) -> Load:
    return Load(plus(load.force, force), plus(load.moment, cross(place, force)))


@njit
def _parting(on: Any, other: Any, centre: Vector, place: Vector) -> Vector:
    """Return how fast the points of two bodies at a place, relative to a centre, part [m/s]."""
    at = plus(centre, place)
    moved = plus(vector(on.velocity), cross(vector(on.angular_velocity), minus(at, vector(on.position))))
    still = plus(vector(other.velocity), cross(vector(other.angular_velocity), minus(at, vector(other.position))))
    return minus(moved, still)


@njit
def _at(physics: PairPhysics, contact: Any, frame: Frame, bodies: Any, loads: Loads) -> Loads:
    """Add what one contact does; bodies: the one that feels it, and the one with the face."""
    place, direction = _in_space(frame, contact.place), _in_space(frame, contact.direction)
    parting = _parting(bodies[0], bodies[1], frame.centre, place)
    rate = -dot(direction, parting) / dot(direction, direction)
    spring = contact.share * physics.stiffness * contact.depth
    pressed = max(0.0, spring + contact.share * physics.damping * rate)
    slip = plus_times(parting, rate, direction)
    grip = -physics.friction * pressed * norm(direction) / (norm(slip) + physics.cutoff)
    elastic = _with(loads.spring, place, times(spring, direction))
    couple = times(-0.5 * physics.stiffness * contact.depth * contact.depth, _in_space(frame, contact.couple))
    elastic = Load(elastic.force, plus(elastic.moment, couple))
    damped = _with(loads.damping, place, times(pressed - spring, direction))
    return Loads(elastic, damped, _with(loads.friction, place, times(grip, slip)))


@njit
def loads_of(physics: PairPhysics, pair: Any, contacts: Any, frame: Frame, least: Overlap) -> Loads:
    """Return what the contacts do to the box that is not the one with the face."""
    loads = Loads(NOTHING, NOTHING, NOTHING)
    for k in range(least.number):
        if least.box == 0:
            loads = _at(physics, contacts[k], frame, (pair.b, pair.a), loads)
        else:
            loads = _at(physics, contacts[k], frame, (pair.a, pair.b), loads)
    return loads


@njit
def wrenches_of(pair: Any, load: Load, frame: Frame, box: int) -> tuple[Wrench, Wrench]:
    """Return what a load is to either body, about its centre of mass; box: the one with the face, 0 or 1."""
    sign = 1.0 if box == 1 else -1.0
    force = times(sign, load.force)
    on_a = plus(times(sign, load.moment), cross(minus(frame.centre, vector(pair.a.position)), force))
    on_b = plus(times(sign, load.moment), cross(minus(frame.centre, vector(pair.b.position)), force))
    return (force.x, force.y, force.z, on_a.x, on_a.y, on_a.z), (
        -force.x,
        -force.y,
        -force.z,
        -on_b.x,
        -on_b.y,
        -on_b.z,
    )


@njit
def contact_wrenches(physics: PairPhysics, pair: Any) -> tuple[Wrench, Wrench]:
    """Return force [N] and torque [N m] of the boxes' contact on either, and set how deep it is."""
    none = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    pair.depth = 0.0
    if not are_near(physics, pair):
        return none, none
    contacts = np.empty(2 * MOST, CONTACT)
    frame, least = overlap(physics, pair, contacts)
    if least.number == 0:
        return none, none
    for k in range(least.number):
        pair.depth = max(pair.depth, contacts[k].depth)
    loads = loads_of(physics, pair, contacts, frame, least)
    force = plus(plus(loads.spring.force, loads.damping.force), loads.friction.force)
    moment = plus(plus(loads.spring.moment, loads.damping.moment), loads.friction.moment)
    return wrenches_of(pair, Load(force, moment), frame, least.box)


@njit
def elastic_energy(physics: PairPhysics, pair: Any) -> float:
    """Return the energy in the springs between the boxes [J]."""
    if not are_near(physics, pair):
        return 0.0
    _, least = overlap(physics, pair, np.empty(2 * MOST, CONTACT))
    return 0.5 * physics.stiffness * least.square


@njit(cache=True)
def evaluate(physics: PairPhysics, pairs: Pairs) -> tuple[Array, Array]:
    """Return the energy between the boxes [J], shape (state,), and the wrench on either, shape (state, 2, 6)."""
    energy, wrenches = np.empty(len(pairs)), np.empty((len(pairs), 2, 6))
    for k in range(len(pairs)):
        energy[k] = elastic_energy(physics, pairs[k])
        a, b = contact_wrenches(physics, pairs[k])
        assign(wrenches[k, 0], a)
        assign(wrenches[k, 1], b)
    return energy, wrenches

"""The motion between two events: as long as the same nodes touch and are pushed, its equations are smooth.

A regime says of each node whether it is below the ground and whether the ground's force on it is positive. In a regime
the forces are taken as these two answers say, past the event that ends it, too, so that no step of an integrator ever
meets a jump or a kink. Events are the zeros of the switches, two for each node: its depth, and the force that the
contact law would give it, S d − D u, before the law cuts it off at zero.

The motion is a vector: position [m], velocity [m/s], angular momentum [kg m²/s], and the quaternion (scalar first) that
turned the nodes since the vector was made; of a body that does not turn the last two stay as they are.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stiffdice.dynamics import inertia
from stiffdice.dynamics.compilation import by_tag, constant, njit
from stiffdice.dynamics.contact import normal_of, split, upward
from stiffdice.dynamics.inertia import Box, Isotropic
from stiffdice.dynamics.state import Physics
from stiffdice.dynamics.vector import Vector, assign, cross, dot, minus, norm, plus, plus_times, row, times

# Parts of a motion, 13, and as many more as make it whole vectors of the processor.
SIZE = 16

# What a regime says of a node, as bits.
BELOW = 1
PUSHED = 2

NODES = 8
SWITCHES = 2 * NODES  # depth and force of node k are 2k and 2k + 1

# Units in the last place of the height, and of a speed, within which a switch is taken for zero.
_ULPS = 8 * 2.0**-52


class Contact(NamedTuple):
    """turning: whether the body turns; dragging: whether the ground damps nodes above it; flying: whether flights are
    computed as contacts are, as the spin changes in them.

    regime: a record, as arrays would be counted at every call: nodes [m], relative to the centre before they are
    turned, shape (8, 3); bits, of each node, shape (8,); inverse [1/(kg m²)], of the tensor of inertia then, shape
    (3, 3), of a box.
    """

    turning: bool
    dragging: bool
    flying: bool
    physics: Physics
    regime: Any


class Node(NamedTuple):
    """arm [m]: place relative to the centre; clearance [m]; velocity [m/s]: speed along the normal, slip aside."""

    arm: Vector
    velocity: Vector
    clearance: float
    speed: float
    slip: Vector


@njit
def part_of(motion: Any, first: int) -> Vector:
    """Return three parts of a motion, from the first on."""
    return Vector(motion[first], motion[first + 1], motion[first + 2])


@njit
def _turned(motion: Any, sense: float, v: Vector) -> Vector:
    """Return a vector turned by the motion's quaternion, or with sense −1 turned back.

    The quaternion's norm is one but for what integration makes of it within a step.
    """
    w, x, y, z = motion[9], sense * motion[10], sense * motion[11], sense * motion[12]
    p, q, r = cross(Vector(x, y, z), v)
    return Vector(
        v.x + 2.0 * (w * p + y * r - z * q),
        v.y + 2.0 * (w * q + z * p - x * r),
        v.z + 2.0 * (w * r + x * q - y * p),
    )


@njit
def _by_momentum_of_box(contact: Contact, motion: Any, v: Vector) -> Vector:
    own, inverse = _turned(motion, -1.0, v), contact.regime.inverse
    return _turned(motion, 1.0, Vector(dot(row(inverse, 0), own), dot(row(inverse, 1), own), dot(row(inverse, 2), own)))


# (body of `inertia.py`, contact, motion, momentum) -> the spin [rad/s] that a body turned as in a motion has with an
# angular momentum; linear in it.
spin_by = by_tag(
    {
        Isotropic: njit(lambda contact, motion, momentum: times(1.0 / contact.physics.inertia, momentum)),
        Box: _by_momentum_of_box,
    }
)


@njit
def spin_of(contact: Contact, motion: Any) -> Vector:
    """Return the angular velocity [rad/s] of a motion."""
    return spin_by(contact.physics.body, contact, motion, part_of(motion, 6))


@njit
def _change_by_turn_of_box(contact: Contact, motion: Any, turn: Vector) -> Vector:
    momentum = part_of(motion, 6)
    spin = spin_by(contact.physics.body, contact, motion, momentum)
    return minus(cross(turn, spin), spin_by(contact.physics.body, contact, motion, cross(turn, momentum)))


# (body of `inertia.py`, contact, motion, turn) -> by how much the spin changes [rad/s] where a body of the same angular
# momentum is turned by a small rotation vector [rad], or at which rate [rad/s²] if `turn` is a spin.
change_by_turn = by_tag(
    {Isotropic: constant(Vector(0.0, 0.0, 0.0)), Box: _change_by_turn_of_box},
)


@njit
def node_of(contact: Contact, motion: Any, k: int) -> Node:
    """Return where node k is, and how it moves."""
    arm, velocity = row(contact.regime.nodes, k), part_of(motion, 3)
    if contact.turning:
        arm = _turned(motion, 1.0, arm)
        velocity = plus(velocity, cross(spin_of(contact, motion), arm))
    height, n = upward(contact.physics, part_of(motion, 0)), normal_of(contact.physics)
    clearance = height + n.x * arm.x + n.y * arm.y + n.z * arm.z
    return Node(arm, velocity, clearance, *split(contact.physics, velocity))


@njit
def push_of(contact: Contact, k: int, node: Node) -> float:
    """Return the normal force [N] on node k, which is pushed."""
    push = -contact.physics.damping * node.speed
    return push - contact.physics.stiffness * node.clearance if contact.regime.bits[k] & BELOW else push


@njit
def derivative(contact: Contact, motion: Any, rate: Any) -> None:
    """Set `rate` to the motion's time derivative in a regime (equations 3 to 5, 8, 10; q' = ω q/2)."""
    physics = contact.physics
    total, torque = Vector(0.0, 0.0, 0.0), Vector(0.0, 0.0, 0.0)
    for k in range(NODES):
        if contact.regime.bits[k] & PUSHED:
            node = node_of(contact, motion, k)
            push = push_of(contact, k, node)
            grip = physics.friction * push / (norm(node.slip) + physics.cutoff)
            force = plus_times(times(push, normal_of(physics)), -grip, node.slip)
            total, torque = plus(total, force), plus(torque, cross(node.arm, force))
    rate[0], rate[1], rate[2] = motion[3], motion[4], motion[5]
    rate[3] = total.x / physics.mass
    rate[4] = total.y / physics.mass
    rate[5] = (total.z - physics.weight) / physics.mass
    if contact.turning:
        rate[6], rate[7], rate[8] = torque
        x, y, z = times(0.5, spin_of(contact, motion))
        turned = motion[9], motion[10], motion[11], motion[12]
        rate[9], rate[10], rate[11], rate[12] = quaternion_rate(x, y, z, *turned)


@njit
def quaternion_rate(
    x: float, y: float, z: float, a: float, b: float, c: float, d: float
) -> tuple[float, float, float, float]:
    """Return the product of half a spin (0, x, y, z) [rad/s] and a quaternion (a, b, c, d)."""
    return -x * b - y * c - z * d, x * a + y * d - z * c, y * a + z * b - x * d, z * a + x * c - y * b


@njit
def switches(contact: Contact, motion: Any, rate: Any, value: Any, slope: Any) -> None:
    """Set values and time derivatives of the switches, shape (16,): positive as long as the regime lasts.

    Depths in m; forces in N. A switch that nothing hangs on is 1 for ever.
    """
    physics = contact.physics
    height, centre_speed = upward(physics, part_of(motion, 0)), upward(physics, part_of(motion, 3))
    centre_gain = upward(physics, part_of(rate, 3))
    # Three vectors of which the products with a node, not turned yet, are its level, speed and acceleration along the
    # normal n, relative to the centre; turned back, n, n × ω and n × α + (n·ω) ω − ω² n: for n·(ω × r) = (n × ω)·r,
    # and n·(ω × (ω × r)) = (n·ω)(ω·r) − ω² n·r.
    n, none = normal_of(physics), Vector(0.0, 0.0, 0.0)
    level, turn, bend = n, none, none
    if contact.turning:
        spin, body = spin_of(contact, motion), physics.body
        gained = plus(spin_by(body, contact, motion, part_of(rate, 6)), change_by_turn(body, contact, motion, spin))
        bend = plus_times(cross(n, gained), dot(n, spin), spin)
        bend = _turned(motion, -1.0, plus_times(bend, -dot(spin, spin), n))
        level, turn = _turned(motion, -1.0, n), _turned(motion, -1.0, cross(n, spin))
    for k in range(NODES):
        node = row(contact.regime.nodes, k)
        clearance = height + level.x * node.x + level.y * node.y + level.z * node.z
        speed = centre_speed + turn.x * node.x + turn.y * node.y + turn.z * node.z
        below = contact.regime.bits[k] & BELOW != 0
        value[2 * k], slope[2 * k] = (-clearance, -speed) if below else (clearance, speed)
        value[2 * k + 1], slope[2 * k + 1] = 1.0, 0.0
        if physics.damping == 0.0 or not (below or contact.dragging):
            continue
        gain = centre_gain + bend.x * node.x + bend.y * node.y + bend.z * node.z
        push, change = -physics.damping * speed, -physics.damping * gain
        if below:
            push -= physics.stiffness * clearance
            change -= physics.stiffness * speed
        pushed = contact.regime.bits[k] & PUSHED != 0
        value[2 * k + 1], slope[2 * k + 1] = (push, change) if pushed else (-push, -change)


@njit
def vanishing(physics: Physics, motion: Any, small: Any) -> None:
    """Set below which size a depth [m] and a force [N] are zero but for round-off, shape (2,)."""
    length = abs(motion[0]) * abs(physics.nx) + abs(motion[1]) * abs(physics.ny) + abs(motion[2]) * abs(physics.nz)
    small[0] = _ULPS * (length + physics.reach)
    small[1] = physics.stiffness * small[0] + physics.damping * _ULPS * fastest(physics, motion)


@njit
def fastest(physics: Physics, motion: Any) -> float:
    """Return a speed that no node exceeds [m/s]."""
    return norm(part_of(motion, 3)) + physics.reach * norm(part_of(motion, 6)) / physics.inertia


@njit
def passes(regime: Any, switch: int) -> bool:
    """Return whether a node that the ground does not push is about to leave it: no force changes by that."""
    return switch % 2 == 0 and regime[switch // 2] == BELOW


@njit
def begin(contact: Contact, motion: Any, small: Any) -> None:
    """Set the regime that a motion is in; small: from `vanishing`."""
    for k in range(NODES):
        node = node_of(contact, motion, k)
        # A node that is about at the ground is on the side to which it goes.
        below = node.speed < 0.0 if abs(node.clearance) <= small[0] else node.clearance < 0.0
        contact.regime.bits[k] = _answers(contact, below, node.clearance, node.speed)


@njit
def _answers(contact: Contact, below: bool, clearance: float, speed: float) -> int:
    physics = contact.physics
    if not below:
        return PUSHED if contact.dragging and -physics.damping * speed > 0.0 else 0
    if physics.damping == 0.0 or -physics.stiffness * clearance - physics.damping * speed > 0.0:
        return BELOW | PUSHED
    return BELOW


@njit
def cross_zero(contact: Contact, motion: Any, switch: int) -> None:
    """Change the regime where a switch went through zero."""
    k = switch // 2
    if switch % 2:
        contact.regime.bits[k] ^= PUSHED
    else:
        below = contact.regime.bits[k] & BELOW == 0
        contact.regime.bits[k] = _answers(contact, below, 0.0, node_of(contact, motion, k).speed)


@njit
def take(turning: bool, state: Any, motion: Any) -> None:
    """Set a motion to a state's, not turned yet."""
    for axis in range(3):
        motion[axis], motion[3 + axis] = state.position[axis], state.velocity[axis]
        motion[6 + axis] = state.angular_momentum[axis] if turning else 0.0
    assign(motion[9:13], (1.0, 0.0, 0.0, 0.0))


@njit
def give(turning: bool, physics: Physics, nodes: Any, motion: Any, state: Any) -> None:
    """Set a state to a motion's, turning the nodes it began with."""
    for axis in range(3):
        state.position[axis] = motion[axis]
        state.velocity[axis] = motion[3 + axis]
        if turning:
            state.angular_momentum[axis] = motion[6 + axis]
    if turning:
        for k in range(NODES):
            x, y, z = _turned(motion, 1.0, row(nodes, k))
            state.node_offset[k, 0], state.node_offset[k, 1], state.node_offset[k, 2] = x, y, z
        spin = state.angular_velocity
        spin[0], spin[1], spin[2] = inertia.spin_of(physics.body, physics, state, part_of(motion, 6))


@njit
def normalise(motion: Any) -> None:
    """Give the quaternion the norm one."""
    w, x, y, z = motion[9], motion[10], motion[11], motion[12]
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    for part in range(9, 13):
        motion[part] /= norm


@njit
def hardness(contact: Contact, motion: Any, hard: Any) -> None:
    """Set `hard` to the contact's frequency [rad/s], its fastest friction or damping [1/s], and its speed [m/s].

    The frequency is a bound, from the trace of M⁻¹ S Σ JᵀJ over the nodes below the ground; the speed is that of the
    contact's motion along the normal: the fastest node's, or what its depth or the weight stands for.
    """
    physics, bits = contact.physics, contact.regime.bits
    square = rubbing = speed_most = depth_most = 0.0
    height, pliancy = upward(physics, part_of(motion, 0)), 1.0 / physics.mass
    for k in range(NODES):
        if bits[k] == 0:
            continue
        node = node_of(contact, motion, k)
        arm, velocity, speed = node.arm, node.velocity, node.speed
        level, reach = upward(physics, arm), dot(arm, arm)
        along = pliancy + (reach - level * level) / physics.inertia if contact.turning else pliancy
        across = pliancy + reach / physics.inertia if contact.turning else pliancy
        push = -physics.damping * speed
        if bits[k] & BELOW:
            square += physics.stiffness * along
            push -= physics.stiffness * (height + level)
            speed_most = max(speed_most, abs(speed))
            depth_most = max(depth_most, abs(height + level))
        if bits[k] & PUSHED:
            slip = math.sqrt(max(0.0, dot(velocity, velocity) - speed * speed))
            rubbing += physics.friction * max(0.0, push) / (slip + physics.cutoff) * across + physics.damping * along
    hard[0], hard[1] = math.sqrt(square), rubbing
    hard[2] = speed_most + hard[0] * depth_most
    if hard[0] > 0.0:
        hard[2] += physics.gravity / hard[0]

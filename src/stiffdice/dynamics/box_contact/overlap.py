"""The energy of two boxes that overlap: one continuous function of where they are, and its slopes.

Against one face k of one box, of outward normal n, the other box X is taken as far as it lies between the planes of the
faces beside k: the column behind the face, without an end. The intersection of X with that column is a convex
polyhedron. Each of its vertices v that lies at a depth d_v below the face is a spring, as a node in the ground is:

    U_k = ½ S Σ_v w_v d_v²,    U = the least U_k of the twelve faces of both boxes.

w_v is eight times the solid angle of the outward normals at v over 4π: the curvature measure C_0, 1/8 at a node of a
box. So a node in a face counts as one node in the ground does, w = 1. Where an edge of X leaves the column the normals
are those of the edge's two faces and of the plane it passes; where an edge of the column meets X, those of two planes
and of a face of X.

Curvature measures of convex bodies are weakly continuous (Schneider, Convex Bodies: The Brunn-Minkowski Theory, 4.2),
and depth is a continuous function of place, so each U_k is continuous, and so is the least of them: at every hand-over
of a contact from nodes to edges, and from face to face. U is zero if and only if the boxes are apart: where a plane
separates them, the column behind a face on that side stays on that side. The slope of U is a set of forces, each along
the normal of a face at a node, or along the common normal of two edges, and of couples, as the solid angles change with
the turn of one box against the other. Both act equal and opposite on the two boxes: momentum is conserved, and without
damping and friction, so is energy.

All patches in which two faces meet have the same Σ w = 4, whatever the offset and the twist: a flush, a shifted, and a
twisted stack are equally stiff.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.inertia import centre_of, half_edge
from stiffdice.dynamics.state import Array
from stiffdice.dynamics.vector import Vector, assign, cross, dot, minus, plus, plus_times, row, times, unit, vector
from stiffdice.scene.cube import LINKS, SIGNS

# A vertex of the intersection. In the frame of the box whose face it is below: place [m], direction: −∂depth/∂place of
# X, couple [1/rad]: the slope of its share with a turn of X. depth [m]. share [1]: w.
CONTACT = np.dtype(
    [
        ("place", np.float64, 3),
        ("direction", np.float64, 3),
        ("couple", np.float64, 3),
        ("depth", np.float64),
        ("share", np.float64),
    ]
)
Contacts = npt.NDArray[np.void]

# A polyhedron of ten planes has at most 16 vertices; twelve edges, eight nodes and four lines are never all of them.
MOST = 40

# By how much a column is wider than its box, relative to it. Cubes that stand flush have the nodes of one on the planes
# of the other: this far inside, they are no matter of round-off.
MARGIN = 1e-12


def _edges() -> npt.NDArray[np.int64]:
    """Return the twelve edges of a box, shape (12, 3): axis, node at its negative end, node at its positive end."""
    ends = (sorted(link, key=lambda node: SIGNS[node].sum()) for link in LINKS)
    return np.array(sorted((int(np.argmax(SIGNS[near] != SIGNS[far])), near, far) for near, far in ends))


EDGES = _edges()


class Frame(NamedTuple):
    """Where a box is: its centre [m], the directions of its edges, and half of its sides [m]."""

    centre: Vector
    axes: tuple[Vector, Vector, Vector]
    half: Vector


class View(NamedTuple):
    """A box X seen from another, in the frame of the other's centre and edges.

    nodes [m]: of X, shape (8, 3). axes: directions of X's edges, one a row, shape (3, 3). half [m]: of X's sides.
    reference [m]: half of the other's sides.
    """

    nodes: Array
    axes: Array
    half: Vector
    reference: Vector


class Face(NamedTuple):
    """A face of a box: the axis of its normal, and its sign, 1 or −1."""

    axis: int
    sign: float


class Found(NamedTuple):
    """How many contacts there are below a face, and their Σ w d² [m²]; `most` [m²]: where looking for more ends."""

    number: int
    square: float
    most: float


@njit
def frame_of(physics: Any, state: Any, half: Vector) -> Frame:
    """Return the frame of a box in a state; half [m]: of its sides."""
    nodes = state.node_offset
    a, b, c = half_edge(nodes, 0), half_edge(nodes, 1), half_edge(nodes, 2)
    centre = plus(vector(state.position), centre_of(physics.body, physics, a, b, c))
    return Frame(centre, (times(1.0 / half.x, a), times(1.0 / half.y, b), times(1.0 / half.z, c)), half)


@njit
def seen_from(reference: Frame, other: Frame) -> View:
    """Return the other box as it is seen from the first."""
    nodes, axes = np.empty((8, 3)), np.empty((3, 3))
    away = minus(other.centre, reference.centre)
    for axis in range(3):
        direction = reference.axes[axis]
        for k in range(3):
            axes[k, axis] = dot(other.axes[k], direction)
        for k in range(8):
            edges = SIGNS[k, 0] * other.half.x * axes[0, axis] + SIGNS[k, 1] * other.half.y * axes[1, axis]
            nodes[k, axis] = dot(away, direction) + (edges + SIGNS[k, 2] * other.half.z * axes[2, axis])
    return View(nodes, axes, other.half, reference.half)


@njit
def _beside(view: View, place: Any, axis: int) -> bool:
    """Return whether a place is between the planes of the two faces of an axis."""
    return bool(abs(place[axis]) <= view.reference[axis] * (1.0 + MARGIN))


@njit
def _depth(face: Face, view: View, place: Any) -> float:
    """Return how deep a place is below a face [m]."""
    return view.reference[face.axis] - face.sign * place[face.axis]


@njit
def _outward(face: Face) -> Vector:
    return times(face.sign, unit(face.axis))


@njit
def _with(found: Found, contacts: Contacts, place: Vector, direction: Vector, depth: float, share: float) -> Found:
    """Add a contact."""
    contact = contacts[found.number]
    assign(contact.place, place)
    assign(contact.direction, direction)
    contact.depth, contact.share = depth, share
    return Found(found.number + 1, found.square + share * depth * depth, found.most)


@njit
def _share(contact: Any, edge: tuple[Vector, Vector], faces: tuple[Vector, Vector]) -> float:
    """Return the share of a point where an edge leaves through a plane, and set the couple of its contact.

    The edge has the direction e, and the sum of the normals of its two faces, at right angles, is q; the plane has the
    normal p. The solid angle of the three normals is 2 atan2(|e·p|, 1 + q·p) (Van Oosterom and Strackee 1983,
    doi:10.1109/TBME.1983.325207). edge: e and p; faces: q and p, either pair with what turns with X first.
    """
    along, opening = dot(*edge), 1.0 + dot(*faces)
    factor = 4.0 / math.pi / (along * along + opening * opening)
    sign = 1.0 if along > 0.0 else -1.0
    turned = times(factor * opening * sign, cross(*edge))
    assign(contact.couple, plus_times(turned, -factor * abs(along), cross(*faces)))
    return 4.0 / math.pi * math.atan2(abs(along), opening)


@njit
def _nodes(face: Face, view: View, contacts: Contacts, found: Found) -> Found:
    """Add the nodes of X that lie in the column below a face."""
    for k in range(8):
        place = row(view.nodes, k)
        depth = _depth(face, view, place)
        if depth > 0.0 and _beside(view, place, (face.axis + 1) % 3) and _beside(view, place, (face.axis + 2) % 3):
            assign(contacts[found.number].couple, Vector(0.0, 0.0, 0.0))
            found = _with(found, contacts, place, _outward(face), depth, 1.0)
            if found.square >= found.most:
                break
    return found


@njit
def _crossings(face: Face, view: View, contacts: Contacts, found: Found) -> Found:
    """Add the points where an edge of X leaves the column below a face."""
    for edge in range(12):
        for turn in range(1, 3):
            side = (face.axis + turn) % 3
            near, far = view.nodes[EDGES[edge, 1], side], view.nodes[EDGES[edge, 2], side]
            wide = view.reference[side] * (1.0 + MARGIN)
            for sign in (-1.0, 1.0):
                if (sign * near > wide) != (sign * far > wide):
                    part = (sign * wide - near) / (far - near)
                    found = _crossing(face, view, contacts, found, (edge, part), Face(side, sign))
                    if found.square >= found.most:
                        return found
    return found


@njit
def _crossing(
    face: Face, view: View, contacts: Contacts, found: Found, crossed: tuple[int, float], side: Face
) -> Found:
    """Add a point of an edge, so far along it, on the plane of a side of the column, if it is on the side itself."""
    edge, part = crossed
    axis, begin = EDGES[edge, 0], EDGES[edge, 1]
    along, out, normal = row(view.axes, axis), _outward(side), _outward(face)
    place = plus_times(row(view.nodes, begin), 2.0 * view.half[axis] * part, along)
    depth = _depth(face, view, place)
    if not (depth > 0.0 and _beside(view, place, 3 - face.axis - side.axis)):
        return found
    one, two = (axis + 1) % 3, (axis + 2) % 3
    faces = plus_times(times(SIGNS[begin, one], row(view.axes, one)), SIGNS[begin, two], row(view.axes, two))
    share = _share(contacts[found.number], (along, out), (faces, out))
    direction = plus_times(normal, -dot(normal, along) / dot(out, along), out)
    return _with(found, contacts, place, direction, depth, share)


@njit
def _lines(face: Face, view: View, contacts: Contacts, found: Found) -> Found:
    """Add the points where an edge of the column below a face goes into X, and out of it."""
    one, two = (face.axis + 1) % 3, (face.axis + 2) % 3
    centre = times(0.5, plus(row(view.nodes, 0), row(view.nodes, 6)))  # of opposite nodes
    for corner in range(4):
        sides = plus_times(times(1.0 if corner < 2 else -1.0, unit(one)), 1.0 if corner % 2 == 0 else -1.0, unit(two))
        wide = 1.0 + MARGIN
        x, y, z = sides.x * view.reference.x, sides.y * view.reference.y, sides.z * view.reference.z
        line = Vector(wide * x, wide * y, wide * z)
        ends, axes = _through(view, minus(line, centre), face.axis)
        for end in range(2 if ends[0] < ends[1] else 0):
            place = plus_times(line, ends[end], unit(face.axis))
            depth = _depth(face, view, place)
            if depth > 0.0:
                axis = row(view.axes, axes[end])
                normal = times(-1.0 if (axis[face.axis] > 0.0) == (end == 0) else 1.0, axis)
                share = _share(contacts[found.number], (normal, _outward(face)), (normal, sides))
                direction = times(1.0 / dot(normal, _outward(face)), normal)
                found = _with(found, contacts, place, direction, depth, share)
                if found.square >= found.most:
                    return found
    return found


@njit
def _through(view: View, start: Vector, along: int) -> tuple[tuple[float, float], tuple[int, int]]:
    """Return where a line from a start, relative to X's centre, along an axis of the frame goes into X and out of it.

    With the axes of X whose faces it passes; the first is not less than the second where it misses X.
    """
    into, out, first, last = -math.inf, math.inf, 0, 0
    for axis in range(3):
        direction = row(view.axes, axis)
        at, slope = dot(direction, start), direction[along]
        if slope == 0.0:
            if abs(at) > view.half[axis]:
                return (0.0, 0.0), (0, 0)
            continue
        middle, reach = -at / slope, view.half[axis] / abs(slope)
        if middle - reach > into:
            into, first = middle - reach, axis
        if middle + reach < out:
            out, last = middle + reach, axis
    return (into, out), (first, last)


@njit
def contacts_below(face: Face, view: View, contacts: Contacts, most: float) -> Found:
    """Set the contacts of X below a face of the box that it is seen from; return how many, and their Σ w d² [m²].

    most [m²]: as soon as Σ w d² is not below it, the rest is left out.
    """
    found = _nodes(face, view, contacts, Found(0, 0.0, most))
    if found.square < most:
        found = _crossings(face, view, contacts, found)
    if found.square < most:
        found = _lines(face, view, contacts, found)
    return found


class Overlap(NamedTuple):
    """The contacts of two boxes: below which face of which box (0 or 1), how many, and their Σ w d² [m²]."""

    box: int
    face: Face
    number: int
    square: float


@njit
def _reach(face: Face, view: View) -> float:
    """Return how far X reaches below the plane of a face [m]; not above zero: the plane separates the boxes."""
    centre = 0.5 * (view.nodes[0, face.axis] + view.nodes[6, face.axis])  # of opposite nodes
    extent = 0.0
    for k in range(3):
        extent += view.half[k] * abs(view.axes[k, face.axis])
    return view.reference[face.axis] + extent - face.sign * centre


@njit
def _nearest(views: tuple[View, View]) -> tuple[int, Face, float]:
    """Return the face that the other box reaches least below, whose it is, and how far that is [m]."""
    box, nearest, least = 0, Face(0, 1.0), math.inf
    for k in range(2):
        for axis in range(3):
            for sign in (-1.0, 1.0):
                reach = _reach(Face(axis, sign), views[k])
                if reach < least:
                    box, nearest, least = k, Face(axis, sign), reach
    return box, nearest, least


@njit
def _less(box: int, face: Face, view: View, contacts: Contacts, least: Overlap) -> Overlap:
    """Return the overlap below a face, if it has less energy, with its contacts; otherwise the least so far."""
    found = contacts_below(face, view, contacts[MOST:], least.square)
    if not found.square < least.square:
        return least
    for k in range(found.number):
        contacts[k] = contacts[MOST + k]
    return Overlap(box, face, found.number, found.square)


@njit
def overlap_of(first: Frame, second: Frame, contacts: Contacts) -> Overlap:
    """Set the contacts of two boxes, those below the face with the least energy; none where they are apart.

    contacts: room for twice MOST.
    """
    views = seen_from(first, second), seen_from(second, first)
    box, face, reach = _nearest(views)
    if reach <= 0.0:
        return Overlap(box, face, 0, 0.0)
    # The nearest face has the least energy in most cases, and then one contact tells that another has more.
    least = _less(box, face, views[box], contacts, Overlap(box, face, 0, math.inf))
    for k in range(2):
        for axis in range(3):
            for sign in (-1.0, 1.0):
                if (k, axis, sign) != (box, face.axis, face.sign):
                    least = _less(k, Face(axis, sign), views[k], contacts, least)
    return least

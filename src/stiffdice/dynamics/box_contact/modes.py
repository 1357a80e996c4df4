"""Modes of two boxes in contact, with each other and with the ground: what linear theory says of their contact.

The coordinates are the displacements of both centres of mass and the rotation vectors of both bodies. A contact at p,
whose depth grows by −q·u where a point of one box moves by u against the other (`overlap.py`), has the row

    J = (q, (p − x) × q) of the one, and −(q, (p − x) × q) of the other,

and so does a node in the ground, q its normal. The modes are those of M⁻¹ K, K = S Σ w JᵀJ and M of the masses and the
tensors of inertia. Contacts shallow against the sides: what a force does as the overlap turns or slides, and the slope
of the shares w, are left out, being smaller by depth over side.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.box_contact import law
from stiffdice.dynamics.box_contact.overlap import CONTACT, MOST, Frame
from stiffdice.dynamics.box_contact.pair_state import PairPhysics, Pairs, pair_physics_of
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.state import Array, turned_tensor
from stiffdice.scene.pair import PairScene


@njit(cache=True)
def _overlap(physics: PairPhysics, pairs: Pairs, contacts: npt.NDArray[np.void]) -> tuple[Frame, int, int]:
    """Set the contacts of the first pair; return the frame they are in, whose it is (0 or 1), and their number."""
    frame, least = law.overlap(physics, pairs[0], contacts)
    return frame, least.box, least.number


def _between(scene: PairScene, pair: Pairs) -> tuple[Array, Array, Array]:
    """Return place [m], direction and share of the contacts between the boxes, shapes (contact, 3), (…, 3), (…).

    The direction is that of the force on the first box.
    """
    contacts = np.zeros(2 * MOST, CONTACT)
    frame, box, number = _overlap(pair_physics_of(scene), pair, contacts)
    found, axes = contacts[:number], np.array(frame.axes)
    sign = 1.0 if box == 1 else -1.0
    return np.array(frame.centre) + found["place"] @ axes, sign * found["direction"] @ axes, found["share"]


def _levers(body: np.void, place: Array, direction: Array) -> Array:
    """Return by how much places on a body move along directions with each of its coordinates, shape (place, 6)."""
    return np.concatenate([direction, np.cross(place - body["position"], direction)], axis=-1)


def rows(scene: PairScene, pair: Pairs) -> Array:
    """Return √(S w) J M^(−½) of each contact, shape (contact, 12); the sum of their squares is K, weighted by M.

    The first six coordinates are the first box's. pair: one state of both, shape (1,), in which they overlap as they
    are to; contacts with the ground are those of the nodes below it.
    """
    (state,) = pair
    bodies = state["a"], state["b"]
    place, direction, share = _between(scene, pair)
    parts = [np.hstack([_levers(body, place, sign * direction) for body, sign in zip(bodies, (1, -1), strict=True)])]
    normal = np.array(scene.ground.normal)
    for k, body in enumerate(bodies):
        nodes = body["position"] + body["node_offset"]
        touching = nodes[nodes @ normal < 0]
        levers = np.zeros((len(touching), 12))
        levers[:, 6 * k : 6 * k + 6] = _levers(body, touching, np.broadcast_to(normal, touching.shape))
        parts.append(levers)
    shares = np.concatenate([share, np.ones(len(parts[1]) + len(parts[2]))])
    found = np.sqrt(scene.ground.stiffness * shares)[:, None] * np.vstack(parts)
    for k, (cube, body) in enumerate(zip(scene.cubes, bodies, strict=True)):
        found[:, 6 * k : 6 * k + 3] /= np.sqrt(cube.mass)
        tensor = turned_tensor(cube, body["node_offset"])
        found[:, 6 * k + 3 : 6 * k + 6] @= np.linalg.cholesky(np.linalg.inv(tensor))
    return found


def squares(scene: PairScene, pair: Pairs) -> Array:
    """Return ω² [rad²/s²] of the modes of two boxes in a state, shape (1,), ascending, shape (12,); 0 without a spring.

    The damping ratio of a mode is (D/S) ω/2 where dashpots stand beside the springs, |q| = 1: not where edges cross.
    """
    found = rows(scene, pair)
    return np.maximum(np.linalg.eigvalsh(found.T @ found), 0.0)  # round-off around the modes without a spring


def translations(scene: PairScene, pair: Pairs, direction: Array) -> Array:
    """Return ω² [rad²/s²] of two boxes that move along a unit vector, shape (3,), and do not turn: ascending, (2,).

    They are modes if the contacts' forces pass the centres of mass, or in pairs do. The larger of boxes that touch
    nothing else is that of the reduced mass on Σ w S (q·direction)².
    """
    found = rows(scene, pair)
    along = np.column_stack([found[:, :3] @ direction, found[:, 6:9] @ direction])
    return np.maximum(np.linalg.eigvalsh(along.T @ along), 0.0)

"""Which bodies of a MuJoCo model meet, how they touch first, and the law of their contact."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import mujoco
import numpy as np
import numpy.typing as npt

from stiffdice.simulation.engines.mjcf.law import Law

Vector = npt.NDArray[np.float64]

_FREE, _PLANE = mujoco.mjtJoint.mjJNT_FREE, mujoco.mjtGeom.mjGEOM_PLANE
# A plane is a floor if its normal is within 60° of upwards.
_FLOOR = 0.5
# Of heights that are halved until contact begins; and how deep, in sizes, a contact is looked at.
_HALVINGS, _DEPTH = 60, 1e-6
# A contact is straight below the centre of mass, or it turns the body: its part of 1/A, and of a tilt.
_CENTRAL = 1e-3
_KNOWN = ("EULER", "RK4", "IMPLICIT", "IMPLICITFAST")
_STRANGE = ("DIAGEXACT", "IPC", "SPECULATIVE", "SLEEP")


@dataclass(frozen=True)
class Meeting:
    """A free body, or a tree of bodies on a free joint, that falls on something.

    body: root of the tree; trees: its root, and that of what it falls on if that moves; geoms, other_geoms: of either;
    is_floor: whether it is a plane; up: direction from which it comes, shape (3,); size [m]: longest side of its
    bounding box; names: of both.
    """

    body: int
    trees: tuple[int, ...]
    geoms: npt.NDArray[np.intp]
    other_geoms: npt.NDArray[np.intp]
    is_floor: bool
    up: Vector
    size: float
    names: tuple[str, str]


@dataclass(frozen=True)
class Touch:
    """How a meeting begins: where, and by which law.

    pose: qpos at first contact, shape (nq,); row: how fast the contacts open by generalised velocity, on average, shape
    (nv,); law: at the model's own time step; contacts: how many; why: what is not linear; is_straight: whether all of
    that is in the law, as several contacts below the centre of mass are; geoms: pairs of geoms in contact; pairs:
    <pair> elements, −1 where there is none.
    """

    pose: Vector
    row: Vector
    law: Law
    contacts: int
    why: tuple[str, ...]
    is_straight: bool
    geoms: tuple[tuple[int, int], ...]
    pairs: tuple[int, ...]


def name_of(model: mujoco.MjModel, kind: mujoco.mjtObj, number: int) -> str:
    """Return the name of a thing of a model, or its kind and number."""
    return mujoco.mj_id2name(model, kind, number) or f"{kind.name.removeprefix('mjOBJ_').lower()} {number}"


def meetings_of(model: mujoco.MjModel) -> list[Meeting]:
    """Return every free body with each floor, then with each other body, that the model lets collide."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    free = [int(body) for body in model.jnt_bodyid[model.jnt_type == _FREE]]
    root = model.body_rootid[model.geom_bodyid]
    plane = model.geom_type == _PLANE
    up = _upwards(model)
    found: list[Meeting] = []
    for body in free:
        for geom in np.flatnonzero(plane):
            normal = data.geom_xmat[geom].reshape(3, 3)[:, 2]
            if normal @ up >= _FLOOR:
                found += _meeting(model, data, body, np.array([geom]), normal, is_floor=True)
    others = [int(body) for body in dict.fromkeys(root)]
    for k, body in enumerate(free):
        for other in others:
            if other != body and other not in free[:k]:
                found += _meeting(model, data, body, np.flatnonzero((root == other) & ~plane), up, is_floor=False)
    return found


def _upwards(model: mujoco.MjModel) -> Vector:
    gravity = np.array(model.opt.gravity)
    size = float(np.linalg.norm(gravity))
    return -gravity / size if size > 0 else np.array([0.0, 0.0, 1.0])


def _meeting(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, others: npt.NDArray[np.intp], up: Vector, *, is_floor: bool
) -> list[Meeting]:
    """Return the meeting of a body with some geoms, in a list that is empty if they are not let collide."""
    own = np.flatnonzero(model.body_rootid[model.geom_bodyid] == body)
    pairs = [(one, other) for one in own for other in others if _may_collide(model, int(one), int(other))]
    if not pairs:
        return []
    geoms, other_geoms = (np.array(list(dict.fromkeys(side))) for side in zip(*pairs, strict=True))
    kind = mujoco.mjtObj.mjOBJ_BODY
    second = int(model.body_rootid[model.geom_bodyid[others[0]]])
    told = name_of(model, mujoco.mjtObj.mjOBJ_GEOM, int(others[0])) if is_floor else name_of(model, kind, second)
    names = name_of(model, kind, body), told
    moves = bool((model.body_rootid[model.jnt_bodyid] == second).any())
    return [
        Meeting(
            body,
            (body, second) if moves else (body,),
            geoms,
            other_geoms,
            is_floor,
            up,
            _size(model, data, geoms),
            names,
        )
    ]


def _may_collide(model: mujoco.MjModel, one: int, other: int) -> bool:
    """Return whether two geoms are an explicit pair, or pass the filters of types and exclusions."""
    if {one, other} in [{a, b} for a, b in zip(model.pair_geom1, model.pair_geom2, strict=True)]:
        return True
    low, high = sorted((int(model.geom_bodyid[one]), int(model.geom_bodyid[other])))
    if (low << 16) + high in model.exclude_signature:
        return False
    kind, with_kind = model.geom_contype, model.geom_conaffinity
    return bool(kind[one] & with_kind[other] or kind[other] & with_kind[one])


def _size(model: mujoco.MjModel, data: mujoco.MjData, geoms: npt.NDArray[np.intp]) -> float:
    """Return the longest side [m] of the box around some geoms, along the axes of the world."""
    turn = data.geom_xmat[geoms].reshape(-1, 3, 3)
    centre = data.geom_xpos[geoms] + np.einsum("nij,nj->ni", turn, model.geom_aabb[geoms, :3])
    reach = np.einsum("nij,nj->ni", np.abs(turn), model.geom_aabb[geoms, 3:])
    return float(((centre + reach).max(0) - (centre - reach).min(0)).max())


def alone(model: mujoco.MjModel, meeting: Meeting) -> mujoco.MjModel:
    """Return a copy of a model in which nothing but this meeting touches, is tied, driven or reset."""
    model = copy(model)
    keep = np.zeros(model.ngeom, bool)
    keep[np.flatnonzero(model.body_rootid[model.geom_bodyid] == meeting.body)] = True
    keep[meeting.other_geoms] = True
    model.geom_contype[~keep] = model.geom_conaffinity[~keep] = 0
    disable = mujoco.mjtDisableBit
    model.opt.disableflags |= int(disable.mjDSBL_ACTUATION) | int(disable.mjDSBL_AUTORESET)
    model.eq_active0[_ties(model, meeting)] = 0
    strings = _strings(model, meeting)
    model.tendon_stiffness[strings], model.tendon_damping[strings], model.tendon_limited[strings] = 0, 0, 0
    return model


def _ties(model: mujoco.MjModel, meeting: Meeting) -> list[int]:
    """Return the equality constraints that tie bodies of a meeting to other ones, or to the world."""
    kind, of_bodies = mujoco.mjtEq, []
    for k in range(model.neq):
        if model.eq_type[k] in (int(kind.mjEQ_CONNECT), int(kind.mjEQ_WELD)):
            ends = [int(model.eq_obj1id[k]), int(model.eq_obj2id[k])]
            if model.eq_objtype[k] == int(mujoco.mjtObj.mjOBJ_SITE):
                ends = [int(model.site_bodyid[site]) for site in ends]
            of_bodies.append((k, ends))
    return [k for k, ends in of_bodies if _leads_out(model, meeting, ends)]


def _strings(model: mujoco.MjModel, meeting: Meeting) -> list[int]:
    """Return the spatial tendons that run from bodies of a meeting to other ones, or to the world."""
    found = []
    for k, (first, count) in enumerate(zip(model.tendon_adr, model.tendon_num, strict=True)):
        on_sites = model.wrap_type[first : first + count] == int(mujoco.mjtWrap.mjWRAP_SITE)
        sites = model.wrap_objid[first : first + count][on_sites]
        if _leads_out(model, meeting, [int(body) for body in model.site_bodyid[sites]]):
            found.append(k)
    return found


def _leads_out(model: mujoco.MjModel, meeting: Meeting, bodies: list[int]) -> bool:
    roots = {int(model.body_rootid[body]) for body in bodies}
    return bool(roots & set(meeting.trees)) and len(roots) > 1


def active(data: mujoco.MjData, meeting: Meeting) -> npt.NDArray[np.intp]:
    """Return the numbers of the meeting's contacts that may bear a force."""
    if data.ncon == 0:
        return np.empty(0, np.intp)
    contact = data.contact
    one, other = contact.geom[:, 0], contact.geom[:, 1]
    between = np.isin(one, meeting.geoms) & np.isin(other, meeting.other_geoms)
    between |= np.isin(other, meeting.geoms) & np.isin(one, meeting.other_geoms)
    return np.flatnonzero(between & (contact.dist < contact.includemargin))


def raised(model: mujoco.MjModel, meeting: Meeting, pose: Vector, by: float) -> Vector:
    """Return a pose whose body is higher by so much [m]."""
    moved = pose.copy()
    place = model.jnt_qposadr[model.body_jntadr[meeting.body]]
    moved[place : place + 3] += by * meeting.up
    return moved


def touch_of(model: mujoco.MjModel, meeting: Meeting) -> Touch | None:
    """Return how a meeting begins, of a model that is `alone`; None if the body falls past."""
    data = mujoco.MjData(model)
    data.qpos = _within_limits(model)
    mujoco.mj_kinematics(model, data)
    start, target = data.geom_xpos[meeting.geoms[0]], data.geom_xpos[meeting.other_geoms[0]]
    aside = np.zeros(3) if meeting.is_floor else target - start
    pose = _within_limits(model)
    place = model.jnt_qposadr[model.body_jntadr[meeting.body]]
    pose[place : place + 3] += aside - (aside @ meeting.up) * meeting.up
    low = float((target - start) @ meeting.up)  # its first geom is in the other's middle
    high = low + meeting.size + 2 * float(model.geom_rbound[meeting.other_geoms].max()) + float(model.geom_margin.max())
    high += float(np.linalg.norm(data.geom_xpos[meeting.other_geoms] - target, axis=1).max())
    if not _touches(model, data, meeting, raised(model, meeting, pose, low)):
        return None
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        down = _touches(model, data, meeting, raised(model, meeting, pose, middle))
        low, high = (middle, high) if down else (low, middle)
    touching = raised(model, meeting, pose, high)
    data.qpos = raised(model, meeting, touching, -_DEPTH * meeting.size)
    mujoco.mj_forward(model, data)
    return _touch(model, data, meeting, touching)


def _within_limits(model: mujoco.MjModel) -> Vector:
    """Return the model's pose with its joints in their ranges: limits that are broken would drive them apart."""
    pose = np.array(model.qpos0)
    hinged = np.isin(model.jnt_type, [int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)])
    joints = np.flatnonzero(hinged & (model.jnt_limited != 0))
    places = model.jnt_qposadr[joints]
    pose[places] = np.clip(pose[places], *model.jnt_range[joints].T)
    return pose


def _touches(model: mujoco.MjModel, data: mujoco.MjData, meeting: Meeting, pose: Vector) -> bool:
    data.qpos = pose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    return len(active(data, meeting)) > 0


def _touch(model: mujoco.MjModel, data: mujoco.MjData, meeting: Meeting, pose: Vector) -> Touch | None:
    """Return the law of the contacts that there are, of a state that has been through `mj_forward`."""
    numbers = active(data, meeting)
    if len(numbers) == 0:
        return None
    contacts = [data.contact[int(k)] for k in numbers]
    first = contacts[0]
    rows = np.array([_row(model, data, contact, meeting) for contact in contacts])
    solved = np.empty_like(rows)
    mujoco.mj_solveM(model, data, solved, rows)
    sums = (rows @ solved.T).sum(1)  # what equal forces do at each contact
    inverse = float(sums.mean())
    guess = float(sum(model.body_invweight0[model.geom_bodyid[geom], 0] for geom in first.geom)) * _pyramid(
        model, first
    )
    pull = -float((rows @ data.qacc_smooth).mean())
    law = Law(
        solref=(float(first.solref[0]), float(first.solref[1])),
        solimp=tuple(float(value) for value in first.solimp),  # type: ignore[arg-type]
        softness=guess / inverse,
        pull=pull if abs(pull) > 1e-12 else 0.0,
        mass=len(rows) / inverse,
        refsafe=not model.opt.disableflags & int(mujoco.mjtDisableBit.mjDSBL_REFSAFE),
        timestep=float(model.opt.timestep),
        rk4=model.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4,
    )
    geoms = tuple(dict.fromkeys((int(contact.geom[0]), int(contact.geom[1])) for contact in contacts))
    within, beyond = _reasons(model, meeting, contacts, law, sums)
    pairs = tuple(_pair(model, pair) for pair in geoms)
    return Touch(pose, rows.mean(0), law, len(contacts), (*within, *beyond), not beyond, geoms, pairs)


def _row(model: mujoco.MjModel, data: mujoco.MjData, contact: mujoco.MjContact, meeting: Meeting) -> Vector:
    """Return how fast a contact opens along its normal by generalised velocity, shape (nv,)."""
    parts = np.zeros((2, 3, model.nv))
    for part, geom in zip(parts, contact.geom, strict=True):
        mujoco.mj_jac(model, data, part, None, contact.pos, int(model.geom_bodyid[geom]))
    row: Vector = contact.frame[:3] @ (parts[1] - parts[0])  # the normal points from the first geom to the second
    return row


def _pyramid(model: mujoco.MjModel, contact: mujoco.MjContact) -> float:
    """Return by how much a pyramid's edges, all alike, multiply the regulariser of the normal."""
    if contact.dim == 1 or model.opt.cone != mujoco.mjtCone.mjCONE_PYRAMIDAL:
        return 1.0
    square = float(contact.friction[0]) ** 2
    return (1 + square) * square / (float(model.opt.impratio) * (contact.dim - 1))


def _pair(model: mujoco.MjModel, geoms: tuple[int, int]) -> int:
    """Return the <pair> element of two geoms, −1 if there is none."""
    for k, pair in enumerate(zip(model.pair_geom1, model.pair_geom2, strict=True)):
        if set(pair) == set(geoms):
            return k
    return -1


def _reasons(
    model: mujoco.MjModel, meeting: Meeting, contacts: list[mujoco.MjContact], law: Law, inverse: Vector
) -> tuple[list[str], list[str]]:
    """Return in words what is not linear but in the law, and what the law leaves out.

    inverse [1/kg]: acceleration at each contact by a unit force at all, shape (n,).
    """
    within, beyond = [], []
    if len(contacts) > 1:
        within.append(f"{len(contacts)} contacts at once")
    if not law.is_constant:
        low, high, width, *_ = law.solimp
        within.append(f"solimp: impedance {low:g} to {high:g} over {width:g} m")
    straight = len(contacts) * sum(1 / model.body_subtreemass[root] for root in meeting.trees)
    if np.any(np.abs(inverse / straight - 1) > _CENTRAL):
        beyond.append("not below the centre of mass: the body turns")
    if any(abs(contact.frame[:3] @ meeting.up) < 1 - _CENTRAL for contact in contacts):
        beyond.append("the contact's normal is not the direction of the fall")
    if model.opt.cone == mujoco.mjtCone.mjCONE_ELLIPTIC and contacts[0].dim > 1 and (beyond or len(contacts) > 1):
        within.append("elliptic cones: friction acts on the normal force")
    if _ties(model, meeting) + _strings(model, meeting):
        within.append("ties to other bodies are left out")
    return within, [*beyond, *_moving_parts(model, meeting), *_options(model)]


def _moving_parts(model: mujoco.MjModel, meeting: Meeting) -> list[str]:
    """Return what moves with the bodies, in words."""
    joints = np.isin(model.body_rootid[model.jnt_bodyid], meeting.trees)
    own = int((joints & (model.jnt_type != _FREE)).sum())
    return [f"moving joints: {own}"] if own else []


def _options(model: mujoco.MjModel) -> list[str]:
    """Return the options that the law does not know, in words."""
    option, why = model.opt, []
    if option.density > 0 or option.viscosity > 0:
        why.append("a medium: density or viscosity")
    name = mujoco.mjtIntegrator(option.integrator).name.removeprefix("mjINT_")
    if name not in _KNOWN:
        why.append(f"integrator {name.lower()}")
    bits = mujoco.mjtEnableBit.__members__
    named = [name for name in _STRANGE if f"mjENBL_{name}" in bits]
    return why + [f"option {name.lower()}" for name in named if option.enableflags & int(bits[f"mjENBL_{name}"])]

"""A contact in the words of other engines: what to paste so that a box bounces on a plane as ours does on its ground.

MuJoCo asks for an acceleration a_ref = −b v − k r of each contact (docs/explanation/engines-mujoco-pybullet.md) and
gets it but for an impedance d < 1. The four contacts of a box on its face, of a regulariser (1 − d)/d each, are
accelerated by 4d/(1 + 3d) of a_ref; MuJoCo divides k by d and b by one of its d. So ω² = 4S/m and 2ζω = 4D/m want, in
the direct form, solref = −(S, D)(1 + 3d)/m, and in the other, with k = 1/(d τ ζ')² and b = 2/(d τ), the time constant τ
= 4/((1 + 3d) ζω) and the damping ratio ζ' = ζ √(1 + 3d)/2. Gravity acts with (1 − d)/(1 + 3d) of itself in contact.

PyBullet and Drake have a spring and a dashpot at a contact. Both take a step by implicit Euler, which damps by itself
like a further dashpot S h (docs/explanation/engines-drake.md): a damping of D − S h makes up for it. Drake's compliant
half space of a slab of H has the pressure E x/H, over a face of side s the force E s² x/H: E = 4 S H/s².
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from typing import Any, NamedTuple

from stiffdice.advice.contact_design import Contact
from stiffdice.errors import InputError

# MuJoCo's impedance: its own default at the depth of full width. All of dmin, dmax; the depth then does not matter.
IMPEDANCE = 0.95

_SOLIMP = f"{IMPEDANCE:g} {IMPEDANCE:g} 0.001 0.5 2"


class Parameters(NamedTuple):
    """What an engine is told of a contact.

    values: by the engine's own names. paste: text in its language. notes: sentences.
    """

    values: dict[str, Any]
    paste: str
    notes: list[str]


def compensated(contact: Contact, h: float) -> Contact | None:
    """Return a contact with D − S h in place of D, for an engine of implicit steps of h [s]; None where D is less."""
    ground = contact.scene.ground
    left = ground.damping - ground.stiffness * h
    if left < 0:
        return None
    return dataclasses.replace(contact, scene=contact.scene.with_ground(damping=left))


def mujoco(contact: Contact, h: float) -> Parameters:
    """Return what MuJoCo is told, with a timestep of h [s]."""
    ground, cube, scale = contact.scene.ground, contact.scene.cube, 1 + 3 * IMPEDANCE
    negative = f"{-ground.stiffness * scale / cube.mass:.9g} {-ground.damping * scale / cube.mass:.9g}"
    values: dict[str, Any] = {"solref": negative, "solimp": _SOLIMP, "timestep": h, "cone": "elliptic"}
    values["impratio"] = 1.0
    share = (1 - IMPEDANCE) / scale
    notes = [
        "solref is of the ground, with priority=1: else MuJoCo mixes those of both geoms",
        f"a box at rest is {share * contact.depth_at_rest:.3g} m deep, as MuJoCo takes {1 - share:.1%} of gravity off "
        "its contacts",
        f"contacts share one a_ref: a corner alone meets {scale / 4:.0%} of the stiffness of a face, not a quarter as "
        "with springs at nodes",
        "cone and impratio are of no effect on a flat bounce",
    ]
    if contact.zeta > 0:
        constant = 4 / (scale * contact.zeta * contact.omega)
        values["solref_positive"] = f"{constant:.9g} {contact.zeta * math.sqrt(scale) / 2:.9g}"
        if constant < 2 * h:
            notes.append(
                "the positive form does not hold at this timestep: MuJoCo takes no time constant below two of them"
            )
    else:
        notes.append("there is no positive form without damping")
    return Parameters(values, mjcf(contact, h, negative), notes)


def mjcf(contact: Contact, h: float, solref: str) -> str:
    """Return a model of a box above a plane, with a timestep of h [s]."""
    side, cube = contact.scene.cube.side, contact.scene.cube
    return f"""\
<mujoco>
  <option timestep="{h:.9g}" cone="elliptic" impratio="1" gravity="0 0 {-contact.scene.gravity:g}"/>
  <worldbody>
    <geom type="plane" size="0 0 1" priority="1" solref="{solref}" solimp="{_SOLIMP}"/>
    <body pos="0 0 {10 * side:g}">
      <freejoint/>
      <geom type="box" size="{side / 2:g} {side / 2:g} {side / 2:g}" mass="{cube.mass:g}"/>
    </body>
  </worldbody>
</mujoco>"""


def pybullet(contact: Contact, h: float) -> Parameters:
    """Return what PyBullet is told, with a fixedTimeStep of h [s]."""
    told = compensated(contact, h) or contact
    ground = told.scene.ground
    reach = 3 * contact.speed * h
    values: dict[str, Any] = {
        "contactStiffness": float(f"{ground.stiffness:.9g}"),
        "contactDamping": float(f"{ground.damping:.9g}"),
        "restitution": 0.0,
        "fixedTimeStep": h,
        "contactBreakingThreshold": float(f"{reach:.3g}"),
    }
    paste = f"""\
# body: a createCollisionShapeArray of eight small spheres at the corners
p.setPhysicsEngineParameter(fixedTimeStep={h:.9g}, numSolverIterations=200, contactSlop=0,
                            contactBreakingThreshold={reach:.3g})
p.changeDynamics(body, -1, contactStiffness={ground.stiffness:.9g}, contactDamping={ground.damping:.9g}, restitution=0)
p.changeDynamics(plane, -1, contactStiffness=1e300, contactDamping=0, restitution=0)"""
    notes = [
        _of_damping(told is not contact),
        "a box in place of the spheres has one or two contacts on a face, not four: its ground is softer",
    ]
    return Parameters(values, paste, notes)


def drake(contact: Contact, h: float) -> Parameters:
    """Return what Drake is told, with a time_step of h [s]."""
    told = compensated(contact, h) or contact
    ground, side = told.scene.ground, told.scene.cube.side
    modulus, time = 4 * ground.stiffness / side, ground.damping / ground.stiffness
    values: dict[str, Any] = {
        "point_stiffness": float(f"{ground.stiffness:.9g}"),
        "relaxation_time": float(f"{time:.9g}"),
        "time_step": h,
        "discrete_contact_approximation": "sap",
        "hydroelastic_modulus": float(f"{modulus:.9g}"),
        "slab_thickness": side,
    }
    paste = f"""\
plant, _ = AddMultibodyPlantSceneGraph(builder, time_step={h:.9g})
plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
plant.set_sap_near_rigid_threshold(0.0)
ground = ProximityProperties()  # the body's: relaxation_time 0; at points, stiffness {2.0**60 * ground.stiffness:.3g}
ground.AddProperty("material", "relaxation_time", {time:.9g})
# Points: spheres at the corners, and
AddContactMaterial(ground, point_stiffness={ground.stiffness:.9g})
# or hydroelastic: a rigid box, and
AddCompliantHydroelasticPropertiesForHalfSpace({side:.9g}, {modulus:.9g}, ground)"""
    notes = [
        _of_damping(told is not contact),
        "the other approximations, Drake's default among them, do not read relaxation_time",
    ]
    return Parameters(values, paste, notes)


def _of_damping(less: bool) -> str:
    if less:
        return "damping is less than D by S h, which implicit steps add by themselves: it goes with this timestep only"
    return "implicit steps add a damping of S h, more than there is: the bounce is too low until steps are shorter"


# What an engine is told, by its name.
ENGINES: dict[str, Callable[[Contact, float], Parameters]] = {"mujoco": mujoco, "pybullet": pybullet, "drake": drake}


def parameters(engine: str, contact: Contact, h: float) -> Parameters:
    """Return what an engine is told; raises InputError for a contact that it has not."""
    check(contact)
    return ENGINES[engine](contact, h)


def check(contact: Contact) -> None:
    """Raise InputError for a contact law that engines do not have."""
    if contact.law != "gated":
        raise InputError(
            f"--contact = {contact.law}: allowed with --engine is gated, as no engine's ground acts in the air"
        )

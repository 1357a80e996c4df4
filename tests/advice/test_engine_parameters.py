"""What is printed for an engine, pasted: the engine bounces as was asked."""

from __future__ import annotations

import math

import numpy as np
import pytest

from stiffdice.advice import contact_design, engine_parameters
from stiffdice.errors import InputError

SPEED, SIDE, MASS = 1.5, 0.016, 0.005


def contact(restitution, law="gated"):
    given = {"restitution": restitution, "stiffness": 2000.0}
    return contact_design.designed(given, mass=MASS, side=SIDE, speed=SPEED, gravity=9.8, law=law)


def thrown(model, h, contact, impratio="1", cone="elliptic"):
    """Return the restitution of the printed model in MuJoCo, from half a step above the ground."""
    mujoco = pytest.importorskip("mujoco")
    model = model.replace('impratio="1"', f'impratio="{impratio}"').replace("elliptic", cone)
    compiled = mujoco.MjModel.from_xml_string(model)
    compiled.opt.gravity[:] = 0
    data = mujoco.MjData(compiled)
    data.qpos[2], data.qvel[2] = SIDE / 2 + 1.5 * SPEED * h, -SPEED
    mujoco.mj_step(compiled, data, math.ceil(2 * (contact.contact_time + 2 * contact.zeta / contact.omega) / h))
    assert data.qpos[2] > SIDE / 2
    return data.qvel[2] / SPEED


@pytest.mark.parametrize("restitution", [0.1, 0.3, 0.5, 0.9, 0.99])
def test_both_forms_of_solref_are_the_contact(restitution):
    wanted = contact(restitution)
    h = 1e-3 / wanted.omega
    told = engine_parameters.mujoco(wanted, h)
    negative = thrown(told.paste, h, wanted)
    positive = thrown(told.paste.replace(told.values["solref"], told.values["solref_positive"]), h, wanted)
    assert negative == pytest.approx(restitution, rel=2e-3)
    assert positive == pytest.approx(negative, rel=1e-6)


@pytest.mark.parametrize("other", [{"impratio": "100"}, {"cone": "pyramidal"}])
def test_cone_and_impratio_are_of_no_effect_on_a_flat_bounce(other):
    wanted = contact(0.5)
    told = engine_parameters.mujoco(wanted, 1e-5)
    assert thrown(told.paste, 1e-5, wanted, **other) == pytest.approx(thrown(told.paste, 1e-5, wanted), rel=1e-5)


def test_a_box_at_rest_in_mujoco_is_as_deep_as_is_said():
    mujoco = pytest.importorskip("mujoco")
    wanted = contact(0.2)
    compiled = mujoco.MjModel.from_xml_string(engine_parameters.mujoco(wanted, 1e-5).paste)
    data = mujoco.MjData(compiled)
    data.qpos[2] = SIDE / 2
    mujoco.mj_step(compiled, data, 5000)
    share = (1 - engine_parameters.IMPEDANCE) / (1 + 3 * engine_parameters.IMPEDANCE)
    assert SIDE / 2 - data.qpos[2] == pytest.approx(share * wanted.depth_at_rest, rel=1e-3)


def test_there_is_no_positive_solref_without_damping_nor_one_below_two_timesteps():
    undamped = engine_parameters.mujoco(contact(1.0), 1e-5)
    assert "solref_positive" not in undamped.values
    assert any("no positive form without damping" in note for note in undamped.notes)
    assert any("does not hold at this timestep" in note for note in engine_parameters.mujoco(contact(0.05), 1e-3).notes)


@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_the_printed_lines_bounce_in_pybullet(restitution):
    pytest.importorskip("stiffdice.simulation.engines.pybullet")  # which imports it without its warning
    import pybullet as p

    wanted = contact(restitution)
    h = 0.03 / wanted.omega
    told = engine_parameters.pybullet(wanted, h)
    here = p.connect(p.DIRECT)
    plane = p.createMultiBody(0, p.createCollisionShape(p.GEOM_PLANE))
    corners = [[x, y, z] for x in (-SIDE / 2, SIDE / 2) for y in (-SIDE / 2, SIDE / 2) for z in (-SIDE / 2, SIDE / 2)]
    spheres = p.createCollisionShapeArray([p.GEOM_SPHERE] * 8, [1e-6] * 8, collisionFramePositions=corners)
    body = p.createMultiBody(MASS, spheres, basePosition=[0, 0, SIDE / 2 + 1e-6 + 1.5 * SPEED * h])
    exec(told.paste, {"p": p, "body": body, "plane": plane})
    p.changeDynamics(body, -1, linearDamping=0, angularDamping=0)
    p.resetBaseVelocity(body, [0, 0, -SPEED])
    for _ in range(math.ceil(2 * wanted.contact_time / h)):
        p.stepSimulation()
    speed = p.getBaseVelocity(body)[0][2]
    p.disconnect(here)
    assert speed / SPEED == pytest.approx(restitution, rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize("restitution", [0.5, 0.9])
def test_the_printed_hydroelastic_ground_bounces_in_drake(restitution):
    """The lines themselves, with a rigid box."""
    pytest.importorskip("pydrake")
    import pydrake.all as drake

    wanted = contact(restitution)
    h = 0.03 / wanted.omega
    builder = drake.DiagramBuilder()
    names = {"builder": builder, **{name: getattr(drake, name) for name in dir(drake) if not name.startswith("_")}}
    exec(engine_parameters.drake(wanted, h).paste, names)
    plant, ground = names["plant"], names["ground"]
    plant.set_contact_model(drake.ContactModel.kHydroelasticWithFallback)
    plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])
    unit = drake.UnitInertia.SolidBox(SIDE, SIDE, SIDE)
    body = plant.AddRigidBody("box", drake.SpatialInertia(MASS, np.zeros(3), unit))
    rigid = drake.ProximityProperties()
    drake.AddRigidHydroelasticProperties(SIDE, rigid)
    drake.AddContactMaterial(rigid, friction=drake.CoulombFriction(0, 0))
    rigid.AddProperty("material", "relaxation_time", 0.0)
    ground.AddProperty("material", "coulomb_friction", drake.CoulombFriction(0, 0))
    box, still = drake.Box(SIDE, SIDE, SIDE), drake.RigidTransform()
    plant.RegisterCollisionGeometry(body, still, box, "box", rigid)
    plant.RegisterCollisionGeometry(plant.world_body(), still, drake.HalfSpace(), "ground", ground)
    plant.Finalize()
    simulator = drake.Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositionsAndVelocities(context, [1, 0, 0, 0, 0, 0, SIDE / 2 + 1.5 * SPEED * h, 0, 0, 0, 0, 0, -SPEED])
    simulator.AdvanceTo(2 * wanted.contact_time)
    assert plant.GetPositionsAndVelocities(context)[-1] / SPEED == pytest.approx(restitution, rel=0.02)


def test_damping_is_less_by_what_implicit_steps_add_as_long_as_there_is_any():
    wanted = contact(0.5)
    ground = wanted.scene.ground
    h = 0.5 * ground.damping / ground.stiffness
    assert engine_parameters.pybullet(wanted, h).values["contactDamping"] == pytest.approx(0.5 * ground.damping)
    assert engine_parameters.drake(wanted, h).values["relaxation_time"] == pytest.approx(h)
    assert engine_parameters.compensated(wanted, 3 * h) is None
    told = engine_parameters.drake(wanted, 3 * h)
    assert told.values["relaxation_time"] == pytest.approx(2 * h)
    assert "too low" in told.notes[0]


def test_engines_have_no_ungated_ground():
    with pytest.raises(InputError, match="--contact = ungated: allowed with --engine is gated"):
        engine_parameters.parameters("mujoco", contact(0.5, "ungated"), 1e-5)

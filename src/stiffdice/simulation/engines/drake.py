"""Drake's discrete contact on our scenes: point contact at the eight nodes, its force implicit in the velocity (SAP).

A step of h [s] presses a node that is below the ground at its beginning with S·depth − D·u_n of the depth and the
normal velocity at its end, or not at all: the gated law, found a step late and solved by implicit Euler. Of what could
be chosen, these are the settings nearest to our law (docs/explanation/engines.md has what was measured):

- Only this one of Drake's approximations has a linear dashpot, a relaxation time τ = D/S; the others and the continuous
  mode multiply the force by 1 − d·u_n (Hunt and Crossley), which is ours at D = 0 only. In turn its friction is coupled
  to the normal force: a node that slips at u_t is pressed by a further (D + S h)·mu·|u_t|.
- Nodes are spheres of a billionth of the radius, and the ground's plane is lowered by that. They are rigid, so that the
  ground's stiffness is the combined one and a force acts at the node, not half way down to the plane.
- No stiffness is taken back where a step is too long to resolve it (`sap_near_rigid_threshold` 0).
- A cube that does not turn hangs on sliding joints along its axes.

SAP stops at a relative residual of 10⁻⁶ of the momentum, which cannot be set from here: rest depths are off by as much,
and below an ωh of 10⁻⁴ shorter steps make a bounce no better.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.multibody.tree import PrismaticJoint, SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from stiffdice.dynamics.state import TOUCHING, Array, States
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines.adapter import RigidBody

# Of the spheres that stand for the nodes, in units of the cube's radius: the arm of friction is too long by it.
_SPHERE = 1e-9

# How many times as stiff as the ground a sphere is: k₁k₂/(k₁ + k₂) is the ground's then, to the last bit.
_RIGID = 2.0**60


class Drake(RigidBody):
    """One run, standing where the last step left it. In free flight a step is one of symplectic Euler."""

    NAME = "Drake"
    PACKAGE = "drake"
    SCHEME = "sap"

    @classmethod
    def unfit(cls, scene: Scene, model: str) -> str | None:
        """Return in one sentence why Drake cannot represent a scene and model, or None if it can."""
        if model in TOUCHING and scene.ground.stiffness == 0:
            return "ground.stiffness = 0: allowed is a number above 0, as Drake's contact is none without a spring"
        return super().unfit(scene, model)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._steps, self._failed = 0, False
        # Where a row's numbers are among Drake's.
        self._order = [4, 5, 6, 0, 1, 2, 3, 10, 11, 12, 7, 8, 9] if self.turns else slice(None)
        with silence():
            builder = DiagramBuilder()
            self._plant, _ = AddMultibodyPlantSceneGraph(builder, self.h)
            _build(self._plant, self)
            self._simulator = Simulator(builder.Build())
            self._context = self._plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
            place, velocity = self.start["position"][self.axes], self.start["velocity"][self.axes]
            turn, spin = ([1.0, 0.0, 0.0, 0.0], self.spin) if self.turns else ([], [])
            self._plant.SetPositionsAndVelocities(self._context, np.concatenate([turn, place, spin, velocity]))

    def _next(self, row: Array, every: int) -> int:
        # An evaluation a step: each looks for contacts once. What failed once has failed for good.
        self._steps += every
        try:  # up to half a step past the last one: round-off in the time can neither lose a step nor gain one
            with silence():
                if not self._failed:
                    self._simulator.AdvanceTo((self._steps - 0.5) * self.h)
        except (RuntimeError, SystemExit):  # the latter is what a failed assertion of Drake's raises
            self._failed = True
        if self._failed:
            return 0
        row[:] = self._plant.GetPositionsAndVelocities(self._context)[self._order]
        return every

    def _turn(self, states: States, quaternions: Array, spins: Array) -> None:
        with np.errstate(all="ignore"):  # a run that blew up
            super()._turn(states, quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True), spins)


@contextmanager
def silence() -> Iterator[None]:
    """Let Drake log nothing: it warns of what half spaces cannot do, and of failures that are results here."""
    logger = logging.getLogger("drake")
    logger.disabled = True
    try:
        yield
    finally:
        logger.disabled = False


def _build(plant: Any, run: Drake) -> None:
    """Give a plant the cube, its nodes and the ground."""
    scene, cube, ground = run.scene, run.scene.cube, run.scene.ground
    plant.set_contact_model(ContactModel.kPoint)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    plant.set_sap_near_rigid_threshold(0.0)
    plant.SetUseSampledOutputPorts(False)  # nothing reads them, and they take time
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scene.gravity])
    gyration = cube.moment_of_inertia / cube.mass
    inertia = SpatialInertia(cube.mass, np.zeros(3), UnitInertia(gyration, gyration, gyration))
    body = plant.AddRigidBody("cube", inertia)
    # A cube that does not turn is joined to the world by massless carriages, one on another, that slide along axes.
    below, place = plant.world_body(), np.zeros(3) if run.turns else run.start["position"].copy()
    for axis in () if run.turns else range(3)[run.axes]:
        above = body if axis == 2 else plant.AddRigidBody(f"carriage {axis}", SpatialInertia.Zero())
        plant.AddJoint(PrismaticJoint(f"slide {axis}", below.body_frame(), above.body_frame(), np.eye(3)[axis]))
        below, place[axis] = above, 0.0
    if run.model in TOUCHING:
        size, normal = _SPHERE * cube.radius, np.array(ground.normal)
        rigid = _material(_RIGID * ground.stiffness, 0.0, ground.friction)
        for k, node in enumerate(run.start["node_offset"]):
            plant.RegisterCollisionGeometry(body, RigidTransform(place + node), Sphere(size), f"node {k}", rigid)
        soft = _material(ground.stiffness, ground.damping / ground.stiffness, ground.friction)
        plane = HalfSpace.MakePose(normal, -size * normal)
        plant.RegisterCollisionGeometry(plant.world_body(), plane, HalfSpace(), "ground", soft)
    plant.Finalize()


def _material(stiffness: float, relaxation_time: float, friction: float) -> Any:
    """Return what a geometry is made of: stiffness [N/m], relaxation time [s]; the times of two add up."""
    material = ProximityProperties()
    AddContactMaterial(material, point_stiffness=stiffness, friction=CoulombFriction(friction, friction))
    material.AddProperty("material", "relaxation_time", relaxation_time)
    return material

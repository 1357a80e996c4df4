"""Two boxes in Drake, one rigid and the other compliant, with hydroelastic contact by SAP: the setting of drake#18241.

A compliant box has a pressure that grows from its surface to its middle, up to the modulus E; pressed flat by d over an
area A it pushes with 2 E A d/s, but less near the sides. E = 2 S/s makes that 4 S d, as ours is, for a whole face.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    AddRigidHydroelasticProperties,
    Box,
    Convex,
    ProximityProperties,
)
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from stiffdice.experiments.pair.motion import Motion, pose_of
from stiffdice.scene.cube import SIGNS, Cube
from stiffdice.scene.pair import PairScene
from stiffdice.simulation.engines.drake import silence


@dataclass(frozen=True)
class Drake:
    """springs: whether without Drake's default dashpot, a relaxation time of 0.1 s.

    convex: whether a query of depth takes boxes as convex shapes, as fcl#545 did, not as boxes.
    """

    springs: bool = False
    convex: bool = False

    def ended(self, scene: PairScene, h: float) -> Motion:
        """Return how the boxes move at the end of a scene without ground, in steps of h [s]; NaN where it failed."""
        with silence():
            diagram, plant, bodies = self._built(scene, h)
            simulator = Simulator(diagram)
            context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
            for body, part in zip(bodies, scene.parts, strict=True):
                start = SpatialVelocity(np.zeros(3), np.array(part.launch.velocity))
                plant.SetFreeBodySpatialVelocity(context, body, start)
            try:  # up to half a step past the last one: round-off in the time can neither lose a step nor gain one
                simulator.AdvanceTo((round(scene.duration / h) - 0.5) * h)
            except (RuntimeError, SystemExit):  # the latter is what a failed assertion of Drake's raises
                return Motion(np.full((2, 3), np.nan), np.full((2, 3), np.nan))
            found = [body.EvalSpatialVelocityInWorld(context) for body in bodies]
        return Motion(np.array([v.translational() for v in found]), np.array([v.rotational() for v in found]))

    def depth(self, scene: PairScene) -> float:
        """Return how deep one box is in the other [m]; 0 where they are found apart."""
        with silence():
            diagram, plant, _ = self._built(scene, 1e-3)
            context = plant.GetMyContextFromRoot(diagram.CreateDefaultContext())
            query = plant.get_geometry_query_input_port().Eval(context)
            return float(max((pair.depth for pair in query.ComputePointPairPenetration()), default=0.0))

    def _built(self, scene: PairScene, h: float) -> tuple[Any, Any, list[Any]]:
        """Return the diagram, its plant and the two bodies, put where they start."""
        builder = DiagramBuilder()
        plant, _ = AddMultibodyPlantSceneGraph(builder, h)
        plant.set_contact_model(ContactModel.kHydroelasticWithFallback)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scene.gravity])
        bodies = []
        for k, part in enumerate(scene.parts):
            cube = part.cube
            body = plant.AddRigidBody(f"box {k}", _inertia(cube))
            shape = Box(*(2 * np.array(cube.half_sides)))
            if self.convex:
                shape = Convex((SIGNS * np.array(cube.half_sides)).T, f"box {k}")
            material = self._material(scene, cube, rigid=k == 0)
            plant.RegisterCollisionGeometry(body, RigidTransform(), shape, f"box {k}", material)
            place, quaternion = pose_of(part)
            plant.SetDefaultFloatingBaseBodyPose(body, RigidTransform(Quaternion(quaternion), place))
            bodies.append(body)
        plant.Finalize()
        return builder.Build(), plant, bodies

    def _material(self, scene: PairScene, cube: Cube, *, rigid: bool) -> ProximityProperties:
        material = ProximityProperties()
        if rigid:
            AddRigidHydroelasticProperties(cube.side, material)
        else:
            AddCompliantHydroelasticProperties(cube.side, 2 * scene.ground.stiffness / cube.side, material)
        friction = CoulombFriction(scene.ground.friction, scene.ground.friction)
        AddContactMaterial(friction=friction, properties=material)
        if self.springs:
            material.AddProperty("material", "relaxation_time", 0.0)
        return material


def _inertia(cube: Cube) -> SpatialInertia:
    gyration = cube.moment_of_inertia / cube.mass
    return SpatialInertia(cube.mass, np.zeros(3), UnitInertia(gyration, gyration, gyration))

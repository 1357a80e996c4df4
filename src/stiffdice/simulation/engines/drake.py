"""Drake's discrete contact on our scenes: point contact at the eight nodes, its force implicit in the velocity (SAP).

A step of h [s] presses a node that is below the ground at its beginning with S·depth − D·u_n of the depth and the
normal velocity at its end, or not at all: the gated law, found a step late and solved by implicit Euler. Of what could
be chosen, these are the settings nearest to our law (docs/engines.md has what was measured):

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
from importlib.metadata import version
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

from stiffdice.dynamics.rotation import matrices, turned
from stiffdice.dynamics.state import TOUCHING, TURNING, Array, States
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines.compatibility import gated_rigid

# In free flight a step is one of symplectic Euler.
LAG = 0.5
SCHEME = "sap"

# Of the spheres that stand for the nodes, in units of the cube's radius: the arm of friction is too long by it.
_SPHERE = 1e-9

# How many times as stiff as the ground a sphere is: k₁k₂/(k₁ + k₂) is the ground's then, to the last bit.
_RIGID = 2.0**60

# The axes along which a model that does not turn the cube lets it go.
_AXES = {"vertical": (2,), "sliding": (0, 1, 2)}


def unfit(scene: Scene, model: str) -> str | None:
    """Return in one sentence why Drake cannot represent a scene and model, or None if it can."""
    if model in TOUCHING and scene.ground.stiffness == 0:
        return "ground.stiffness = 0: allowed is a number above 0, as Drake's contact is none without a spring"
    return gated_rigid("Drake", scene, model)


def versions() -> str:
    """Return the engine's name and version."""
    return f"drake {version('drake')}"


def start(scene: Scene, model: str, launch: States, h: float, tolerance: float) -> DrakeEngine:
    """Return a run from a launch, shape (1,), in steps of h [s]; the tolerance is for others."""
    return DrakeEngine(scene, model, launch, h)


class DrakeEngine:
    """One run, standing where the last step left it."""

    def __init__(self, scene: Scene, model: str, launch: States, h: float) -> None:
        """Build Drake's model of the scene and set it to the launch, shape (1,)."""
        self._turns, self._inertia = model in TURNING, scene.cube.moment_of_inertia
        self._h, self._steps, self._failed = h, 0, False
        (self._launch,) = launch.copy()
        self._axes = list(_AXES.get(model, ()))
        with _silence():
            builder = DiagramBuilder()
            self._plant, _ = AddMultibodyPlantSceneGraph(builder, h)
            _build(self._plant, scene, self._launch, self._axes, touching=model in TOUCHING)
            self._simulator = Simulator(builder.Build())
            self._context = self._plant.GetMyMutableContextFromRoot(self._simulator.get_mutable_context())
            self._plant.SetPositionsAndVelocities(self._context, self._start())

    def _start(self) -> Array:
        launch = self._launch
        if self._turns:
            spin = launch["angular_momentum"] / self._inertia
            return np.concatenate([[1.0, 0.0, 0.0, 0.0], launch["position"], spin, launch["velocity"]])
        return np.concatenate([launch["position"][self._axes], launch["velocity"][self._axes]])

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations.

        That is the steps up to the last state: each looks for contacts once. Where Drake gives up, not-a-number.
        """
        rows = np.full((len(states), self._plant.num_multibody_states()), np.nan)
        evaluations = 0
        with _silence():
            for row in rows:
                if self._step(every):
                    row[:] = self._plant.GetPositionsAndVelocities(self._context)
                    evaluations += every
        self._put(rows, states)
        return evaluations

    def _step(self, count: int) -> bool:
        """Take so many steps, and return whether Drake could; what failed once has failed for good."""
        self._steps += count
        if not self._failed:
            try:  # up to half a step past the last one: round-off in the time can neither lose a step nor gain one
                self._simulator.AdvanceTo((self._steps - 0.5) * self._h)
            except (RuntimeError, SystemExit):  # the latter is what a failed assertion of Drake's raises
                self._failed = True
        return not self._failed

    def _put(self, rows: Array, states: States) -> None:
        """Make the states that Drake's positions and velocities, shape (K, state), stand for."""
        states[:] = self._launch
        if self._turns:
            states["position"], states["velocity"] = rows[:, 4:7], rows[:, 10:13]
            states["angular_velocity"] = rows[:, 7:10]
            states["angular_momentum"] = self._inertia * rows[:, 7:10]
            states["node_offset"] = _turned(self._launch["node_offset"], rows[:, :4])
            return
        count = len(self._axes)
        states["position"][:, self._axes], states["velocity"][:, self._axes] = rows[:, :count], rows[:, count:]


@contextmanager
def _silence() -> Iterator[None]:
    """Let Drake log nothing: it warns of what half spaces cannot do, and of failures that are results here."""
    logger = logging.getLogger("drake")
    logger.addFilter(_nothing)
    try:
        yield
    finally:
        logger.removeFilter(_nothing)


def _nothing(record: logging.LogRecord) -> bool:
    return False


def _build(plant: Any, scene: Scene, launch: Any, axes: list[int], touching: bool) -> None:
    plant.set_contact_model(ContactModel.kPoint)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    plant.set_sap_near_rigid_threshold(0.0)
    plant.SetUseSampledOutputPorts(False)  # nothing reads them, and they take time
    plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -scene.gravity])
    gyration = scene.cube.moment_of_inertia / scene.cube.mass
    inertia = SpatialInertia(scene.cube.mass, np.zeros(3), UnitInertia(gyration, gyration, gyration))
    cube = plant.AddRigidBody("cube", inertia)
    _hang(plant, cube, axes)
    if touching:
        _lay(plant, scene, cube, launch, axes)
    plant.Finalize()


def _hang(plant: Any, cube: Any, axes: list[int]) -> None:
    """Join the cube to the world by massless carriages, one on another, that slide along these axes."""
    below = plant.world_body()
    for axis in axes:
        above = cube if axis == axes[-1] else plant.AddRigidBody(f"carriage {axis}", SpatialInertia.Zero())
        way = np.eye(3)[axis]
        plant.AddJoint(PrismaticJoint(f"slide {axis}", below.body_frame(), above.body_frame(), way))
        below = above


def _lay(plant: Any, scene: Scene, cube: Any, launch: Any, axes: list[int]) -> None:
    """Give the cube its nodes and the world its ground."""
    ground, size = scene.ground, _SPHERE * scene.cube.radius
    rigid = _material(_RIGID * ground.stiffness, 0.0, ground.friction)
    place = np.zeros(3) if not axes else np.where(np.isin(range(3), axes), 0.0, launch["position"])
    for k, node in enumerate(launch["node_offset"]):
        plant.RegisterCollisionGeometry(cube, RigidTransform(place + node), Sphere(size), f"node {k}", rigid)
    normal = np.array(ground.normal)
    plane = HalfSpace.MakePose(normal, -size * normal)
    soft = _material(ground.stiffness, ground.damping / ground.stiffness, ground.friction)
    plant.RegisterCollisionGeometry(plant.world_body(), plane, HalfSpace(), "ground", soft)


def _material(stiffness: float, relaxation_time: float, friction: float) -> Any:
    """Return what a geometry is made of: stiffness [N/m], relaxation time [s]; the times of two add up."""
    material = ProximityProperties()
    AddContactMaterial(material, point_stiffness=stiffness, friction=CoulombFriction(friction, friction))
    material.AddProperty("material", "relaxation_time", relaxation_time)
    return material


def _turned(offsets: Array, quaternions: Array) -> Array:
    """Return offsets, shape (node, 3), turned by each of (K, 4) quaternions, whose length need not be one."""
    with np.errstate(all="ignore"):  # a run that blew up
        return turned(matrices(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)), offsets)

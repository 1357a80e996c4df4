"""DART on our scenes: a rigid contact with a restitution and Coulomb friction at the eight nodes, solved as an LCP.

DART's contact has no spring, no dashpot and no duration. A node that is in the ground at the beginning of a step gets
the impulse after which it leaves at e times the speed it would have come with: symplectic Euler with an instant bounce,
found up to a step late. Of a scene's contact it takes

- the restitution e of a flat landing without gravity, by the scene's contact law, S and D (`flat_landing`): each node
  has it, however many touch the ground. Stiffness, contact time and depth at rest are lost;
- friction mu, on the impulse of the step.

The settings:

- Nodes are spheres too small to matter, shapes of one body, above a plane. ODE's collision detector puts a contact at
  the node; DART's own puts it on the plane, FCL's half way. Bullet's does so too, but now and then misses one of four.
- A cube that does not turn hangs on a joint that slides. A body that is slow for half a second falls asleep by default,
  here never.

What DART cannot, as none of it can be set from Python:

- Friction is bounded along each of two fixed directions, so that it is up to √2 mu; and by mu times the normal impulse
  that there would be without friction (so Dantzig's solver does it), which only on a flat landing is the same.
- The speed that is turned round has gravity's part of the step in it: an undamped bounce gains g h.
- A rebound below 0.1 m/s is none, and one above 100 m/s is that; e and mu below 0.001 are none. A node in the ground
  that does not bounce is lifted by a hundredth of its depth in a step, at 1 mm/s at most.
"""

from __future__ import annotations

import math

import dartpy
import numpy as np

from stiffdice.dynamics.state import TOUCHING, Array
from stiffdice.scene import flat_landing
from stiffdice.scene.scene import Scene
from stiffdice.simulation.engines.adapter import RigidBody

# Of the spheres that stand for the nodes, in units of the cube's radius: nothing, in doubles, beside a place.
_SPHERE = 1e-20

# A place [m] or a speed [m/s] whose squares leave the range of doubles in the end: from there on DART prints a warning
# in each step, and goes on with zeros.
_FAR = 1e100


class Dart(RigidBody):
    """One run, standing where the last step left it. In free flight a step is one of symplectic Euler."""

    NAME = "DART"
    PACKAGE = "dartpy"
    SCHEME = "boxed_lcp"

    @classmethod
    def unfit(cls, scene: Scene, model: str) -> str | None:
        """Return in one sentence why DART cannot represent a scene and model, or None if it can."""
        if model in TOUCHING and scene.ground.stiffness == 0:
            return "ground.stiffness = 0: allowed is a number above 0, as DART's bounce is that of a spring"
        return super().unfit(scene, model)

    def __post_init__(self) -> None:
        super().__post_init__()
        scene, ground = self.scene, self.scene.ground
        self._world = dartpy.simulation.World()
        self._world.setTimeStep(self.h)
        self._world.setGravity([0.0, 0.0, -scene.gravity])
        self._world.setCollisionDetector(dartpy.collision.OdeCollisionDetector())
        sleep = dartpy.simulation.DeactivationOptions()
        sleep.mEnabled = False
        self._world.setDeactivationOptions(sleep)
        self._world.addSkeleton(self._cube())
        if self.model in TOUCHING:
            skeleton = dartpy.dynamics.Skeleton("ground")
            _, body = skeleton.createWeldJointAndBodyNodePair()
            plane = body.createShapeNode(dartpy.dynamics.PlaneShape(np.array(ground.normal), 0.0))
            _give_contact(plane, 1.0, ground.friction)  # restitutions are multiplied, of frictions it is the less
            self._world.addSkeleton(skeleton)

    def _cube(self) -> dartpy.dynamics.Skeleton:
        """Return the cube at its launch, on a joint that turns only if the cube does."""
        cube, launch = self.scene.cube, self.start
        skeleton = dartpy.dynamics.Skeleton("cube")
        if self.turns:
            self._joint, self._body = skeleton.createFreeJointAndBodyNodePair()
            self._joint.setPositions([0.0, 0.0, 0.0, *launch["position"]])
            self._joint.setLinearVelocity(launch["velocity"])
            self._joint.setAngularVelocity(self.spin)
        else:
            self._joint, self._body = skeleton.createTranslationalJointAndBodyNodePair()
            self._joint.setPositions(launch["position"])
            self._joint.setVelocities(launch["velocity"])
        self._body.setInertia(dartpy.dynamics.Inertia(cube.mass, np.zeros(3), self.inertia * np.eye(3)))
        if self.model in TOUCHING:
            friction = self.scene.ground.friction if self.model != "vertical" else 0.0
            for node in launch["node_offset"]:
                sphere = self._body.createShapeNode(dartpy.dynamics.SphereShape(_SPHERE * cube.radius))
                sphere.setRelativeTranslation(node)
                _give_contact(sphere, restitution(self.scene), friction)
        return skeleton

    def _next(self, row: Array, every: int) -> int:
        if not np.abs([*self._joint.getPositions(), *self._joint.getVelocities()]).max() < _FAR:
            return every
        for _ in range(every):
            self._world.step()
        if self.turns:
            place = self._body.getTransform()
            row[:3], row[3:7] = place.translation(), place.quaternion().wxyz()
            row[7:10], row[10:] = self._body.getLinearVelocity(), self._body.getAngularVelocity()
        else:
            row[:] = *self._joint.getPositions()[self.axes], *self._joint.getVelocities()[self.axes]
        return every


def restitution(scene: Scene) -> float:
    """Return e [1] of a flat landing without gravity by the scene's contact law, which DART is given."""
    ground = scene.ground
    zeta = ground.damping / math.sqrt(ground.stiffness) / math.sqrt(scene.cube.mass)
    return math.exp(-flat_landing.loss(ground.contact, zeta))


def _give_contact(shape: dartpy.dynamics.ShapeNode, restitution: float, friction: float) -> None:
    """Let a shape touch others."""
    shape.createCollisionAspect()
    aspect = shape.createDynamicsAspect()
    aspect.setRestitutionCoeff(restitution)
    aspect.setFrictionCoeff(friction)

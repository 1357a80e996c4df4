"""PyBullet on our scenes: Bullet's contact with stiffness and damping at eight small spheres, solved implicitly.

With `contactStiffness` S and `contactDamping` D Bullet softens a contact (erp = hS/(hS + D), cfm = 1/(h(hS + D))) such
that the normal force is max(0, S·depth − D·u_n) of the depth and the velocity at the end of the step: implicit Euler.
It looks ahead: a node that would be in the ground at the end of the step is pressed in it already, then with D·depth/h
for the dashpot. Without damping a flat bounce is that of our `implicit_euler`, to round-off. The settings:

- The cube is a compound of eight spheres, a millionth of the radius in size, above a plane lowered by that; a box keeps
  one or two contacts on a flat face. It is a multibody, not one of maximal coordinates, where two directions of
  friction hinder each other.
- Bullet adds up the dampings of two bodies, 0.1 unless told otherwise, and their stiffnesses in series: the ground has
  no damping and no end of stiffness. No slop, restitution or drag, and no limit on the speed, 100 m/s by itself.
- The contact threshold is as far as a node may come in a step; at Bullet's own, 2 cm, a fast one is seen too late.
- The solver (projected Gauss-Seidel) goes on until velocities change by less than 10⁻¹² of what they may, or for some
  10·((ωh)² + 4Dh/m) iterations, 100,000 at most: enough up to ωh = 100.
- A cube that does not turn has no inverse inertia.
- Steps are taken in C, as many at a time as a power of two: Bullet finds their number by a division, which may lose
  one.

What Bullet cannot: friction is Coulomb's in size, and holds at the end of the step, but on a cube that turns it points
along (v₁/a₁, v₂/a₂) in place of the slip (v₁, v₂), where a₁, a₂ are the inverse masses that the node has for pushes
along two fixed axes.
"""

from __future__ import annotations

import math
import os
import sys
import weakref
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from stiffdice.dynamics import linear_theory
from stiffdice.dynamics.state import TOUCHING, Array, physics_of
from stiffdice.simulation.engines.adapter import RigidBody


@contextmanager
def _quiet() -> Iterator[None]:
    """Let nothing that C code writes reach the standard error."""
    sys.stderr.flush()
    kept = os.dup(2)
    with open(os.devnull, "w") as nowhere:  # noqa: PTH123
        os.dup2(nowhere.fileno(), 2)
    try:
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


with _quiet():  # it tells when it was built
    import pybullet

# Of the spheres that stand for the nodes, in units of the cube's radius: the arm of friction is too long by it.
_SPHERE = 1e-6

# The solver's residual [1] of velocities, in units of the largest there may be, and most of its iterations: it takes
# some (ωh)² + 4Dh/m to share the weight among four nodes.
_RESIDUAL, _FEWEST, _MOST = 1e-12, 200, 100_000

# Steps at once, at most: a power of two.
_BATCH = 1024

_ENDLESS = 1e300


class Pybullet(RigidBody):
    """One run, standing where the last step left it, in a Bullet server of its own."""

    NAME = "Bullet"
    PACKAGE = "pybullet"
    SCHEME = "sequential_impulse"

    def __post_init__(self) -> None:
        super().__post_init__()
        scene, cube, ground, launch = self.scene, self.scene.cube, self.scene.ground, self.start
        here = self._here = {"physicsClientId": pybullet.connect(pybullet.DIRECT)}
        weakref.finalize(self, pybullet.disconnect, **here)
        pybullet.setGravity(0, 0, -scene.gravity, **here)
        self._batch = 0
        nodes, size, p = launch["node_offset"].tolist(), _SPHERE * cube.radius, physics_of(scene)
        # A speed [m/s] that no node exceeds, unless the run gains energy.
        turning = math.hypot(*launch["angular_momentum"]) / math.sqrt(p.mass * p.inertia)
        speed = math.hypot(math.hypot(*launch["velocity"]) + p.gravity * scene.duration, turning)
        speed *= 1 + p.reach * math.sqrt(p.mass / p.inertia)
        stride = linear_theory.contact_frequency(ground.stiffness, cube.mass) * self.h
        damped = linear_theory.BOUNCE_NODES * ground.damping * self.h / cube.mass
        # It counts an impulse S·depth·h as a velocity depth/h of the soft contact, speed/(ωh) at most.
        residual = _RESIDUAL * speed * (1 + 1 / stride if stride > 0 else 1)
        pybullet.setPhysicsEngineParameter(
            numSolverIterations=int(min(_FEWEST + 10 * (stride * stride + damped), _MOST)),
            solverResidualThreshold=residual * residual,
            contactBreakingThreshold=speed * self.h + 4 * size,
            contactSlop=0,
            restitutionVelocityThreshold=0,
            enableConeFriction=1,
            **here,
        )
        spheres = [pybullet.GEOM_SPHERE] * len(nodes)
        shape = pybullet.createCollisionShapeArray(spheres, [size] * len(nodes), collisionFramePositions=nodes, **here)
        self._cube = pybullet.createMultiBody(cube.mass, shape, basePosition=launch["position"].tolist(), **here)
        pybullet.changeDynamics(
            self._cube,
            -1,
            contactStiffness=ground.stiffness,
            contactDamping=ground.damping,
            lateralFriction=ground.friction if self.model != "vertical" else 0,
            localInertiaDiagonal=[self.inertia if self.turns else 0] * 3,
            maxJointVelocity=_ENDLESS,
            **_PLAIN,
            **here,
        )
        spin = self.spin if self.turns else np.zeros(3)
        pybullet.resetBaseVelocity(self._cube, launch["velocity"].tolist(), spin.tolist(), **here)
        if self.model in TOUCHING:
            normal = np.array(ground.normal)
            plane = pybullet.createCollisionShape(pybullet.GEOM_PLANE, planeNormal=normal.tolist(), **here)
            body = pybullet.createMultiBody(0, plane, basePosition=(-size * normal).tolist(), **here)
            # The frictions of two bodies are multiplied.
            pybullet.changeDynamics(
                body, -1, contactStiffness=_ENDLESS, contactDamping=0, lateralFriction=1, **_PLAIN, **here
            )

    def _next(self, row: Array, every: int) -> int:
        left = every
        while left:
            batch = min(_BATCH, 1 << left.bit_length() - 1)
            if batch != self._batch:
                pybullet.setPhysicsEngineParameter(fixedTimeStep=self.h * batch, numSubSteps=batch, **self._here)
                self._batch = batch
            pybullet.stepSimulation(**self._here)
            left -= batch
        place, (x, y, z, w) = pybullet.getBasePositionAndOrientation(self._cube, **self._here)
        velocity, spin = pybullet.getBaseVelocity(self._cube, **self._here)
        row[:] = (*place, w, x, y, z, *velocity, *spin) if self.turns else (*place[self.axes], *velocity[self.axes])
        return every


_PLAIN = {"restitution": 0, "spinningFriction": 0, "rollingFriction": 0, "linearDamping": 0, "angularDamping": 0}


def rebounds(restitution: float, side: float, mass: float, speed: float, h: float, clearances: Array) -> Array:
    """Return the speeds [m/s] at which a box with Bullet's own restitution leaves the plane, without gravity.

    restitution [1]: of the box, that of the plane being 1; Bullet multiplies them. speed [m/s]: of the box, down. side
    [m], mass [kg]: of the box. h [s]: a time step. clearances [m]: where its lower face starts, shape (drop,). A box
    that stays has 0.
    """
    found = np.zeros(len(clearances))
    for k, clearance in enumerate(clearances):
        here = {"physicsClientId": pybullet.connect(pybullet.DIRECT)}
        # Below Bullet's own threshold, 0.5 m/s, nothing bounces.
        pybullet.setPhysicsEngineParameter(fixedTimeStep=h, restitutionVelocityThreshold=0, **here)
        plane = pybullet.createMultiBody(0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, **here), **here)
        shape = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[side / 2] * 3, **here)
        box = pybullet.createMultiBody(mass, shape, basePosition=[0, 0, side / 2 + clearance], **here)
        pybullet.changeDynamics(plane, -1, restitution=1, **here)
        pybullet.changeDynamics(box, -1, restitution=restitution, linearDamping=0, angularDamping=0, **here)
        pybullet.resetBaseVelocity(box, [0, 0, -speed], **here)
        upward = 0.0
        for _ in range(20 + int(side / speed / h)):
            pybullet.stepSimulation(**here)
            upward = pybullet.getBaseVelocity(box, **here)[0][2]
            if upward > 0 and pybullet.getBasePositionAndOrientation(box, **here)[0][2] > side / 2 + clearance:
                break
        found[k] = max(0.0, upward)
        pybullet.disconnect(**here)
    return found

"""One landing in MuJoCo itself, by the model's own options, and what came of it."""

from __future__ import annotations

import math
from typing import NamedTuple

import mujoco
import numpy as np

from stiffdice.simulation.engines.mjcf.law import STILL, Law
from stiffdice.simulation.engines.mjcf.meeting import Meeting, Touch, Vector, active, raised


class Drop(NamedTuple):
    """What came of a landing.

    restitution [1]: speed at which the contact opens over speed at which it closes, both along its normal and at the
    surface, the mean of all contacts; zero if it stays closed; energy [1]: energy of the motion afterwards over that
    before; depth [m]: greatest below the surface at which contact begins; infinite where the run blew up.
    """

    restitution: float
    energy: float
    depth: float


BLEW_UP = Drop(math.inf, math.inf, math.inf)


class _Watch:
    """The motion of the trees of a meeting."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData, meeting: Meeting, touch: Touch, law: Law) -> None:
        self.model, self.data, self.touch, self.law = model, data, touch, law
        self.roots = list(meeting.trees)
        self.own = np.isin(model.body_rootid[model.dof_bodyid], self.roots)
        self.clearance = 0.0

    def rate(self) -> float:
        """Return how fast the contact opens [m/s]."""
        return float(self.touch.row @ self.data.qvel)

    def follow(self, former: float) -> None:
        """Follow the clearance over a step, as the scheme does. former [m/s]: rate before it."""
        rate = (former + self.rate()) / 2 if self.law.rk4 else self.rate()
        self.clearance += self.law.timestep * rate

    def square_of_speed(self) -> float:
        """Return the square of the speed [m²/s²] at which the contact closes, or opened, at the surface."""
        return self.law.square_of_speed(self.clearance, self.rate())

    def energy(self) -> float:
        """Return the kinetic and gravitational energy [J] of the trees, places taken at the time of velocities."""
        velocity, momentum = np.where(self.own, self.data.qvel, 0.0), np.empty(self.model.nv)
        mujoco.mj_mulM(self.model, self.data, momentum, velocity)
        mujoco.mj_comVel(self.model, self.data)  # a step leaves the velocities of its begin
        mujoco.mj_subtreeVel(self.model, self.data)
        place = self.data.subtree_com[self.roots] - self.law.lag * self.data.subtree_linvel[self.roots]
        weight = self.model.body_subtreemass[self.roots, None] * self.model.opt.gravity
        return float(velocity @ momentum / 2 - (weight * place).sum())


def drop(model: mujoco.MjModel, meeting: Meeting, touch: Touch, law: Law, speed: float, clearance: float) -> Drop:
    """Return what comes of a landing of a model that is `alone`, at the time step of the law.

    law: at the time step to run at; speed [m/s]: at the launch; clearance [m] there.
    """
    model.opt.timestep = law.timestep
    data = mujoco.MjData(model)
    data.qpos = touch.pose
    mujoco.mj_forward(model, data)
    watch = _Watch(model, data, meeting, touch, law)
    floor = watch.energy()
    data.qpos = raised(model, meeting, touch.pose, clearance)
    for root, part in zip(watch.roots, _shares(model, watch.roots), strict=True):
        first = model.body_dofadr[root]
        if part:
            data.qvel[first : first + 3] = -part * speed * meeting.up
    mujoco.mj_forward(model, data)
    watch.clearance = clearance
    arriving, before = watch.square_of_speed(), watch.energy() - floor
    deepest, met = 0.0, False
    for _ in range(law.longest(deepest) + math.ceil(clearance / (speed * law.timestep)) + 2):
        former = watch.rate()
        mujoco.mj_step(model, data)
        watch.follow(former)
        if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
            return BLEW_UP
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        touching = active(data, meeting)
        if len(touching):
            met = True
            deepest = max(deepest, float((data.contact.includemargin - data.contact.dist)[touching].max()))
        elif met and watch.rate() > 0:
            return Drop(math.sqrt(max(0.0, watch.square_of_speed()) / arriving), _ratio(watch, floor, before), deepest)
        if 0 < watch.rate() < min(former, STILL * speed):
            break
    return Drop(0.0, _ratio(watch, floor, before), deepest)


def _ratio(watch: _Watch, floor: float, before: float) -> float:
    return max(0.0, watch.energy() - floor) / before


def _shares(model: mujoco.MjModel, roots: list[int]) -> tuple[float, ...]:
    """Return how the speed of approach is dealt between two bodies: by mass if both are free."""
    if len(roots) == 1:
        return (1.0,)
    if model.jnt_type[model.body_jntadr[roots[1]]] != mujoco.mjtJoint.mjJNT_FREE:
        return 1.0, 0.0
    one, other = model.body_subtreemass[roots]
    return float(other / (one + other)), float(-one / (one + other))


def drops(model: mujoco.MjModel, meeting: Meeting, touch: Touch, law: Law, speed: float, phases: Vector) -> list[Drop]:
    """Return landings from several clearances. phases: the clearance in the way of one step, shape (n,)."""
    return [drop(model, meeting, touch, law, speed, float(phase) * speed * law.timestep) for phase in phases]

"""MuJoCo on our scenes, set so that its soft contact is the gated law and its Euler integrator the paper's scheme.

MuJoCo has no spring at a contact. It finds forces f >= 0 under which the acceleration of each contact is the reference
a_ref = −b·v − k·r (r < 0 in the ground), softened by a regulariser R: (A + R)·f = a_ref − a_0, where A is what the
forces do to each other and a_0 what would happen without them. R is (1 − d)/d times an estimate W of A's diagonal, made
by the compiler (`body_invweight0`), and d at least 10⁻⁴ (mjMINIMP). With a large R the forces no longer know of each
other: f = a_ref/R, a spring and a dashpot at each node. So here

- d is the least (dmin = dmax); W is 10¹⁰/m in place of the compiler's 1/m, which leaves errors of A/R = 10⁻¹⁴ where
  they would be some 10⁻⁴; `solref` = −(S, D)·W·(1 − d), the direct format, makes S and D what they are per node, with
  however many nodes in the ground. Depths and velocities are those at the begin of the step: symplectic Euler.
- Friction is Coulomb's cone (elliptic) and holds at the end of the step. `impratio` gives it an R of 10⁻³/m, so that it
  is hard and its cone does not press on the normal force; its own reference (`solreffriction`, k = 0, b = 1/h) is to
  stand still at the end of the step. Left alone it would follow the dashpot: none at D = 0.
- Nodes are spheres too small to matter, each in an explicit pair with the ground: one contact per node, at any depth,
  and no search for others.
- Newton's solver with a dense Jacobian; no step is reset where it blows up; nothing is computed that a scene has not.
- Not `mujoco.rollout`, which would be a quarter faster where every state is kept: it prints a warning, and repeats one
  state from there on, as soon as a coordinate or acceleration is above 10¹⁰.

What MuJoCo cannot: a force acts half way between the node and the ground's surface, not at the node. Normal forces have
the same torque there, friction has an arm shorter by half the depth and a slip of a place higher by as much.
"""

from __future__ import annotations

import mujoco
import numpy as np

from stiffdice.dynamics.state import TOUCHING, Array, States
from stiffdice.scene.rotation import matrices
from stiffdice.simulation.engines.adapter import RigidBody

_IMPEDANCE = 1e-4  # mjMINIMP

# Of the contacts' regularisers, in units of 1/mass: of normal forces W, before the factor (1 − d)/d; of friction R.
_SOFT, _HARD = 1e10, 1e-3

# Of the spheres that stand for the nodes, in units of the cube's radius: nothing, in doubles, beside a place.
_SPHERE = 1e-20

# Of the solver: an improvement of its cost, which is in natural units, below which it stops. One iteration is enough
# unless a node comes to slip or to stick.
_TOLERANCE, _ITERATIONS = 1e-14, 50

# Steps after which it is looked whether the run has blown up: a step of not-a-numbers takes hundreds of times as long.
_BATCH = 256

# What a scene has not; and the reset of a run that blows up.
_OFF = (
    "EQUALITY", "FRICTIONLOSS", "LIMIT", "SPRING", "DAMPER", "CLAMPCTRL", "FILTERPARENT", "ACTUATION", "SENSOR",
    "MIDPHASE", "EULERDAMP", "NATIVECCD", "ISLAND", "MULTICCD", "AUTORESET",
)  # fmt: skip


class Mujoco(RigidBody):
    """One run, standing where the last step left it."""

    NAME = "MuJoCo"
    PACKAGE = "mujoco"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._model = _compiled(self)
        self._data, self._unseen = mujoco.MjData(self._model), _BATCH
        places = len(range(3)[self.axes])
        self._data.qpos[:places] = self.start["position"][self.axes]
        self._data.qvel[:places] = self.start["velocity"][self.axes]
        if self.turns:  # its own axes are the world's at the launch, the nodes being as launched
            self._data.qvel[3:] = self.spin

    def _next(self, row: Array, every: int) -> int:
        data = self._data
        for done in range(0, every, _BATCH):
            if self._unseen >= _BATCH:
                # MuJoCo prints a warning, and writes it to a file, when it is the first of its kind.
                data.warning.number[:] = 1
                if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
                    return every
                self._unseen = 0
            part = min(_BATCH, every - done)
            mujoco.mj_step(self._model, data, part)
            self._unseen += part
        row[: len(data.qpos)], row[len(data.qpos) :] = data.qpos, data.qvel
        return every

    def _turn(self, states: States, quaternions: Array, spins: Array) -> None:
        # MuJoCo's spins are about the cube's own axes.
        super()._turn(states, quaternions, (matrices(quaternions) @ spins[..., None])[..., 0])


def _compiled(run: Mujoco) -> mujoco.MjModel:
    """Return the scene of a run as MuJoCo takes it."""
    spec, scene = mujoco.MjSpec(), run.scene
    option = spec.option
    option.timestep = run.h
    option.gravity = [0.0, 0.0, -scene.gravity]
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.tolerance, option.iterations = _TOLERANCE, _ITERATIONS
    option.impratio = _SOFT * (1 - _IMPEDANCE) / _IMPEDANCE / _HARD
    option.disableflags = sum(int(mujoco.mjtDisableBit.__members__[f"mjDSBL_{name}"]) for name in _OFF)
    cube, ground, away = scene.cube, scene.ground, {"contype": 0, "conaffinity": 0}
    body = spec.worldbody.add_body(name="cube")
    if run.turns:
        body.add_freejoint()
    else:
        for axis in np.eye(3)[run.axes]:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis)
    body.explicitinertial = True
    body.mass, body.ipos, body.inertia = cube.mass, np.zeros(3), np.full(3, cube.moment_of_inertia)
    sphere, plane = mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_PLANE
    nodes = {f"node_{k}": node for k, node in enumerate(run.start["node_offset"])}
    for name, node in nodes.items():
        body.add_geom(name=name, type=sphere, size=[_SPHERE * cube.radius, 0.0, 0.0], pos=node, **away)
    if run.model in TOUCHING:
        turn = np.empty(4)
        mujoco.mju_quatZ2Vec(turn, np.array(ground.normal))
        spec.worldbody.add_geom(name="ground", type=plane, size=[0.0, 0.0, 1.0], quat=turn, **away)
        friction = ground.friction if run.model != "vertical" else 0.0
        for name in nodes:
            spec.add_pair(
                geomname1="ground",
                geomname2=name,
                condim=3 if friction > 0 else 1,
                friction=[friction, friction, 0.0, 0.0, 0.0],
                solimp=[_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 2.0],
            )
    compiled = spec.compile()
    stiff = _SOFT * (1 - _IMPEDANCE) / cube.mass
    compiled.body_invweight0[1, :] = _SOFT / cube.mass
    compiled.pair_solref[:] = -stiff * ground.stiffness, -stiff * ground.damping
    # The first number is of no effect, but both at zero stand for the normal direction's. MuJoCo divides by d.
    compiled.pair_solreffriction[:] = -1.0, -_IMPEDANCE / run.h
    return compiled


def rebounds(model: str, height: float, speed: float, clearances: Array, steps: int) -> Array:
    """Return the speeds [m/s] of a body some steps after it was thrown at the ground, without gravity.

    model: MJCF with one body on a free joint, whose centre is `height` [m] above the ground when it touches that.
    speed [m/s]: of the body, down. clearances [m]: where it starts, above that height, shape (drop,). steps: as long as
    the model says. Positive is up; not-a-number of a body that is still in the ground. Shape (drop,).
    """
    compiled = mujoco.MjModel.from_xml_string(model)
    compiled.opt.gravity[:] = 0.0
    found = np.full(len(clearances), np.nan)
    for k, clearance in enumerate(clearances):
        data = mujoco.MjData(compiled)
        data.warning.number[:] = 1  # else it prints one, and writes it to a file, when it is the first of its kind
        data.qpos[2], data.qvel[2] = height + clearance, -speed
        mujoco.mj_step(compiled, data, steps)
        if data.qpos[2] > height:
            found[k] = data.qvel[2]
    return found

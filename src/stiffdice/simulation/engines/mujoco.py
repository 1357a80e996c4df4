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

from stiffdice.dynamics.state import TOUCHING, Array, States, matrices
from stiffdice.scene.scene import Scene
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
        """Put the cube where it is launched; its own axes are the world's then, the nodes being as launched."""
        super().__post_init__()
        self._model = _compiled(self)
        self._data, self._unseen = mujoco.MjData(self._model), _BATCH
        count = len(self.axes)
        self._data.qpos[:count], self._data.qvel[:count] = (
            self.start["position"][self.axes],
            self.start["velocity"][self.axes],
        )
        if self.turns:
            self._data.qvel[3:] = self.spin

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations."""
        count, place, velocity = len(states), self._data.qpos, self._data.qvel
        places, velocities = np.full((count, self._model.nq), np.nan), np.full((count, self._model.nv), np.nan)
        for k in range(count):
            if not self._step(every):
                break
            places[k], velocities[k] = place, velocity
        lost = ~(np.isfinite(places).all(axis=1) & np.isfinite(velocities).all(axis=1))
        places[lost], velocities[lost] = np.nan, np.nan
        spins = velocities[:, 3:]
        if self.turns:  # MuJoCo's are about the cube's own axes
            spins = (matrices(places[:, 3:]) @ spins[..., None])[..., 0]
        axes = len(self.axes)
        self.put(states, places[:, :axes], velocities[:, :axes], places[:, 3:], spins)
        return count * every

    def _step(self, steps: int) -> bool:
        """Take so many steps, unless the run is seen to have blown up; return whether they were taken."""
        for done in range(0, steps, _BATCH):
            if self._unseen >= _BATCH and not self._goes_on():
                return False
            part = min(_BATCH, steps - done)
            mujoco.mj_step(self._model, self._data, part)
            self._unseen += part
        return True

    def _goes_on(self) -> bool:
        """Return whether the run has not blown up, and see to it that no warning is printed until asked again."""
        data = self._data
        # MuJoCo prints a warning, and writes it to a file, when it is the first of its kind.
        data.warning.number[:] = 1
        if not (np.isfinite(data.qpos).all() and np.isfinite(data.qvel).all()):
            return False
        self._unseen = 0
        return True


def _compiled(run: Mujoco) -> mujoco.MjModel:
    """Return the scene of a run as MuJoCo takes it."""
    spec, scene = mujoco.MjSpec(), run.scene
    _set(spec.option, scene, run.h)
    _add_cube(spec, scene, run.start["node_offset"], None if run.turns else run.axes)
    if run.model in TOUCHING:
        _add_ground(spec, scene, run.model)
    compiled = spec.compile()
    stiff = _SOFT * (1 - _IMPEDANCE) / scene.cube.mass
    compiled.body_invweight0[1, :] = _SOFT / scene.cube.mass
    compiled.pair_solref[:] = -stiff * scene.ground.stiffness, -stiff * scene.ground.damping
    # The first number is of no effect, but both at zero stand for the normal direction's. MuJoCo divides by d.
    compiled.pair_solreffriction[:] = -1.0, -_IMPEDANCE / run.h
    return compiled


def _set(option: mujoco.MjOption, scene: Scene, h: float) -> None:
    option.timestep = h
    option.gravity = [0.0, 0.0, -scene.gravity]
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    option.tolerance, option.iterations = _TOLERANCE, _ITERATIONS
    option.impratio = _SOFT * (1 - _IMPEDANCE) / _IMPEDANCE / _HARD
    option.disableflags = sum(int(mujoco.mjtDisableBit.__members__[f"mjDSBL_{name}"]) for name in _OFF)


def _add_cube(spec: mujoco.MjSpec, scene: Scene, nodes: Array, axes: list[int] | None) -> None:
    """Add the cube, which slides along these axes; None lets it turn, too."""
    cube = scene.cube
    body = spec.worldbody.add_body(name="cube")
    if axes is None:
        body.add_freejoint()
    else:
        for axis in axes:
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=np.eye(3)[axis])
    body.explicitinertial = True
    body.mass, body.ipos, body.inertia = cube.mass, np.zeros(3), np.full(3, cube.moment_of_inertia)
    sphere = mujoco.mjtGeom.mjGEOM_SPHERE
    for k, node in enumerate(nodes):
        size = [_SPHERE * cube.radius, 0.0, 0.0]
        body.add_geom(name=f"node_{k}", type=sphere, size=size, pos=node, contype=0, conaffinity=0)


def _add_ground(spec: mujoco.MjSpec, scene: Scene, model: str) -> None:
    turn = np.empty(4)
    mujoco.mju_quatZ2Vec(turn, np.array(scene.ground.normal))
    plane = mujoco.mjtGeom.mjGEOM_PLANE
    spec.worldbody.add_geom(name="ground", type=plane, size=[0.0, 0.0, 1.0], quat=turn, contype=0, conaffinity=0)
    friction = scene.ground.friction if model != "vertical" else 0.0
    for geom in [geom.name for geom in spec.geoms if geom.name != "ground"]:
        spec.add_pair(
            geomname1="ground",
            geomname2=geom,
            condim=3 if friction > 0 else 1,
            friction=[friction, friction, 0.0, 0.0, 0.0],
            solimp=[_IMPEDANCE, _IMPEDANCE, 1.0, 0.5, 2.0],
        )

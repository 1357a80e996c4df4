"""Two boxes in MuJoCo: its own collision of boxes, with our law's springs at the contacts that it finds, or its own.

`springs` is how `simulation/engines/mujoco.py` makes contacts springs, in MJCF alone: the impedance d is the least, so
that the regulariser R = (1 − d)/d W is 10⁴ times what contacts do to each other, W = 1/m + 1/m being the compiler's;
`solref` = −(S, D) W (1 − d) makes each contact a spring S with a dashpot D, to some 10⁻⁴. Its Euler is symplectic Euler
then. Otherwise contacts are MuJoCo's default, of which a step never ends with more energy.
"""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from stiffdice.dynamics.state import Array
from stiffdice.experiments.pair.motion import Motion, Push, Rest, pose_of
from stiffdice.scene.cube import SIGNS
from stiffdice.scene.pair import PairScene
from stiffdice.scene.scene import Scene

_IMPEDANCE = 1e-4  # mjMINIMP

# Steps after which it is looked whether a run has blown up, as one of not-a-numbers takes hundreds of times as long.
_BATCH = 64


@dataclass(frozen=True)
class Mujoco:
    """springs: of our law at the contacts. mesh: whether boxes are convex meshes, which another collider takes."""

    springs: bool = False
    mesh: bool = False

    def ended(self, scene: PairScene, h: float) -> Motion:
        """Return how the boxes move at the end of a scene without ground, in steps of h [s]; NaN where they blew up."""
        model = self._model(scene, h)
        data, left = mujoco.MjData(model), round(scene.duration / h)
        data.qvel[:] = np.concatenate([[*part.launch.velocity, 0.0, 0.0, 0.0] for part in scene.parts])
        while left > 0:
            data.warning.number[:] = 1  # MuJoCo prints a warning, and writes it to a file, when it is the first
            if not np.isfinite(data.qvel).all():
                return Motion(np.full((2, 3), np.nan), np.full((2, 3), np.nan))
            mujoco.mj_step(model, data, min(_BATCH, left))
            left -= _BATCH
        moves = data.qvel.reshape(2, 2, 3)
        return Motion(moves[:, 0].copy(), moves[:, 1].copy())

    def rested(self, scene: PairScene, h: float, margin: float) -> Rest:
        """Return what becomes of a stack on the ground; margin [m]: above it contacts are found."""
        model = self._model(scene, h, margin, grounded=True)
        data, steps = mujoco.MjData(model), round(scene.duration / h)
        found, heights = np.empty(steps, np.int64), np.empty(steps)
        for k in range(steps):
            mujoco.mj_step(model, data)
            found[k], heights[k] = _between(data).size, data.qpos[9]
        return Rest(found, heights)

    def pushed(self, scene: PairScene) -> Push:
        """Return the force on the second box, its torque, and at how many contacts."""
        model = self._model(scene, 1e-3)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        turn = data.xmat[2].reshape(3, 3)  # torques are along the box's own axes
        return Push(data.qfrc_constraint[6:9].copy(), turn @ data.qfrc_constraint[9:12], len(_between(data)))

    def depth(self, scene: PairScene) -> float:
        """Return how deep one box is in the other, by the deepest contact [m]; 0 where none is found."""
        model = self._model(scene, 1e-3)
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        return float(-_between(data).min(initial=0.0))

    def _model(self, scene: PairScene, h: float, margin: float = 0.0, *, grounded: bool = False) -> mujoco.MjModel:
        return mujoco.MjModel.from_xml_string(self.mjcf(scene, h, margin, grounded=grounded))

    def mjcf(self, scene: PairScene, h: float, margin: float = 0.0, *, grounded: bool = False) -> str:
        """Return the scene as MuJoCo takes it; grounded: whether the ground is in it."""
        bodies = "".join(self._body(name, part) for name, part in zip("ab", scene.parts, strict=True))
        a, b = (1.0 / cube.mass for cube in scene.cubes)
        pairs = [("a", "b", a + b), *([("ground", "a", a), ("ground", "b", b)] if grounded else [])]
        contacts = "".join(self._contact(scene, *pair, margin) for pair in pairs)
        meshes = "".join(_mesh(name, part) for name, part in zip("ab", scene.parts, strict=True)) if self.mesh else ""
        return (
            f'<mujoco><option timestep="{h!r}" gravity="0 0 {-scene.gravity!r}" tolerance="1e-14" jacobian="dense">'
            f'<flag autoreset="disable"/></option><asset>{meshes}</asset>'
            f'<worldbody><geom name="ground" type="plane" size="0 0 1" contype="0" conaffinity="0"/>'
            f"{bodies}</worldbody>"
            f"<contact>{contacts}</contact></mujoco>"
        )

    def _body(self, name: str, part: Scene) -> str:
        place, quaternion = pose_of(part)
        shape = f'type="mesh" mesh="{name}"' if self.mesh else f'type="box" size="{_words(part.cube.half_sides)}"'
        return (
            f'<body pos="{_words(place)}" quat="{_words(quaternion)}"><freejoint/>'
            f'<geom name="{name}" {shape} mass="{part.cube.mass!r}" contype="0" conaffinity="0"/></body>'
        )

    def _contact(self, scene: PairScene, one: str, other: str, weight: float, margin: float) -> str:
        between = f'<pair geom1="{one}" geom2="{other}" condim="1" margin="{margin!r}"'
        if not self.springs:
            return f"{between}/>"
        stiff = weight * (1 - _IMPEDANCE)
        law = _words((-stiff * scene.ground.stiffness, -stiff * scene.ground.damping))
        return f'{between} solref="{law}" solimp="{_IMPEDANCE} {_IMPEDANCE} 1 0.5 2"/>'


def _between(data: mujoco.MjData) -> Array:
    """Return the distances of contacts between the boxes [m], below zero where they overlap."""
    (a, b), geoms = (data.model.geom(name).id for name in "ab"), data.contact.geom
    return np.asarray(data.contact.dist[(geoms == (a, b)).all(axis=1)] if len(geoms) else np.empty(0))


def _mesh(name: str, part: Scene) -> str:
    nodes = SIGNS * np.array(part.cube.half_sides)
    return f'<mesh name="{name}" vertex="{_words(nodes.ravel())}"/>'


def _words(numbers: Array | tuple[float, ...]) -> str:
    return " ".join(repr(float(number)) for number in numbers)

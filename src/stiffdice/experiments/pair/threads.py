"""Scenes of two boxes in which other engines' contacts failed, as their users' threads tell it.

drake#18241: one cube is thrown at another, and at a step of 1 ms they gain energy. What could be read of the thread has
no numbers but the step; those here are ours. mujoco#3476: cubes of 71 mm that lie face to face, 0.06 mm deep, are
thought 71 mm deep, and thrown apart. Its turns could not be read; those here were found by trying. mujoco#2471: boxes
of 14, 14 and 20 mm, one turned by 10⁻⁶, lose their contact again and again; contacts begin 0.5 mm before they touch
(`MARGIN`). fcl#545: a cube whose centre lies on the diagonal of a larger one is found √3 times as deep as it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from stiffdice.scene.pair import PairScene, from_mapping

_CUBE = {"side": 0.1, "mass": 0.1}  # [m], [kg]
_SHIFT, _SPEED, _GAP = 0.02, 0.3, 0.03  # [m], [m/s], [m]

_PRODUCT = {"side": 0.071, "mass": 0.1}  # [m], [kg]
PRODUCT_STIFFNESS = 500.0  # [kg/s²]

# 1000 kg/m³. One is pushed into the other beside its middle, so that there is a torque.
_SIDES = (0.02, 0.014, 0.014)  # [m]
_SMALL = {"sides": list(_SIDES), "mass": 3.92e-3}  # [kg]
_BESIDE = 0.004  # [m]
MARGIN = 5e-4  # [m]
_SMALL_GROUND = {"stiffness": 200.0, "damping": 0.1}
TURNS = {"twist": (0.0, 0.0, 1.0), "tilt": (0.0, 1.0, 0.0)}  # about the normal of the faces, and along them

_WIDE, _NARROW = {"side": 1.0, "mass": 1.0}, {"side": 0.2, "mass": 0.008}  # [m], [kg]

HEIGHT = 1.0  # [m] above a ground that boxes shall not meet

POSES = ("face_to_face", "corner", "corner_deep")

# Cubes face to face: how deep [m], and how they are turned [rad], where MuJoCo 3.10.0 thinks them 86 mm deep.
_KISS = 2e-5
_ALMOST = (3e-8, 9e-8, 3e-8), (9e-8, 6e-8, 6e-8)


def _scene(
    cubes: tuple[dict[str, Any], dict[str, Any]],
    launches: tuple[dict[str, Any], dict[str, Any]],
    ground: dict[str, float],
    gravity: float = 0.0,
    duration: float = 1.0,
) -> PairScene:
    parts = [{"cube": cube, "launch": launch} for cube, launch in zip(cubes, launches, strict=True)]
    smooth = {"damping": 0.0, "friction": 0.0, **ground}
    return from_mapping({"cubes": parts, "ground": smooth, "gravity": gravity, "duration": duration})


def _placed(place: Sequence[float], turn: Sequence[float] = (0.0, 0.0, 0.0), fall: float = 0.0) -> dict[str, Any]:
    """Return a launch from a place [m], turned [rad], that falls [m/s]."""
    return {"position": list(place), "velocity": [0.0, 0.0, -fall], "orientation": list(turn)}


def thrown(omega_h: float, h: float, phase: float) -> PairScene:
    """Return a cube that is thrown at another at rest, face to face and shifted: drake#18241.

    omega_h [1]: of a node of each flush with a face of the other, ω² = 8 S/m. h [s]: a step. phase [1]: the share of a
    step after which they touch.
    """
    stiffness = (omega_h / h) ** 2 * _CUBE["mass"] / 8
    above = HEIGHT + _CUBE["side"] + _GAP + phase * h * _SPEED
    launches = _placed((0.0, 0.0, HEIGHT)), _placed((_SHIFT, _SHIFT, above), fall=_SPEED)
    duration = 2 * _GAP / _SPEED + 2 * math.pi / (omega_h / h)
    return _scene((_CUBE, _CUBE), launches, {"stiffness": stiffness}, duration=math.ceil(duration / h) * h)


def inside(depth: float, duration: float) -> PairScene:
    """Return two cubes at rest, face to face, one a share of its side deep in the other: mujoco#3476."""
    launches = _placed((0.0, 0.0, HEIGHT)), _placed((0.0, 0.0, HEIGHT + _PRODUCT["side"] * (1 - depth)))
    return _scene((_PRODUCT, _PRODUCT), launches, {"stiffness": PRODUCT_STIFFNESS}, duration=duration)


def turned(turn: str, angle: float, depth: float = 1e-4) -> PairScene:
    """Return two boxes at rest, one so deep [m] in the other; turn: of TURNS, by an angle [rad]: mujoco#2471."""
    above = HEIGHT + _SIDES[2] - depth
    vector = [part * angle for part in TURNS[turn]]
    launches = _placed((0.0, 0.0, HEIGHT)), _placed((_BESIDE, 0.0, above), vector)
    return _scene((_SMALL, _SMALL), launches, _SMALL_GROUND | {"damping": 0.0})


def stacked(twist: float, duration: float) -> PairScene:
    """Return two boxes, one on the other, let go where they touch, on the ground: mujoco#2471.

    The upper one is turned about the vertical by an angle [rad].
    """
    height = _SIDES[2]
    launches = _placed((0.0, 0.0, height / 2)), _placed((0.0, 0.0, 1.5 * height), (0.0, 0.0, twist))
    return _scene((_SMALL, _SMALL), launches, _SMALL_GROUND, gravity=9.81, duration=duration)


def posed(pose: str) -> PairScene:
    """Return two cubes of which one is known to be how deep in the other; pose: of POSES.

    face_to_face: mujoco#3476. corner_deep: fcl#545, the small cube all in the large one; corner: less deep.
    """
    if pose == "face_to_face":
        place = (0.0, 0.0, HEIGHT + _PRODUCT["side"] - _KISS)
        launches = _placed((0.0, 0.0, HEIGHT), _ALMOST[0]), _placed(place, _ALMOST[1])
        return _scene((_PRODUCT, _PRODUCT), launches, {"stiffness": PRODUCT_STIFFNESS})
    at = {"corner": 0.55, "corner_deep": 0.4}[pose]
    launches = _placed((0.0, 0.0, HEIGHT)), _placed((at, at, HEIGHT + at))
    return _scene((_WIDE, _NARROW), launches, {"stiffness": PRODUCT_STIFFNESS})

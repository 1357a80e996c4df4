"""From what people know of a contact to a ground, and back: restitution, contact time, depth, stiffness, damping.

All are of a flat landing without gravity (`scene.flat_landing`), but for the depth at rest and the restitution with
weight (`dynamics.flat_bounce`). Depth and force depend on the speed of the landing, restitution and contact time do
not: that is why a scene takes the latter as keys, and not the former.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from stiffdice.dynamics import flat_bounce, linear_theory
from stiffdice.errors import InputError
from stiffdice.scene import flat_landing, validation
from stiffdice.scene.scene import Scene, from_mapping

# What a ground may be told by, one of each group: how it bounces, and how hard it is.
BOUNCE = {"restitution": "1", "damping": "kg/s"}
HARDNESS = {"stiffness": "kg/s²", "contact_time": "s", "depth": "m"}


@dataclass(frozen=True)
class Contact:
    """A ground under a cube that lands flat on it.

    scene: of the cube and the ground, launched at the ground with `speed` from where it touches it. restitution [1]: as
    asked, or that of the stiffness and the damping, without weight. speed [m/s]: of the landing.
    """

    scene: Scene
    restitution: float
    speed: float

    @property
    def law(self) -> str:
        """The contact law."""
        return self.scene.ground.contact

    @property
    def omega(self) -> float:
        """Frequency of the contact [rad/s]."""
        return linear_theory.contact_frequency(self.scene.ground.stiffness, self.scene.cube.mass)

    @property
    def zeta(self) -> float:
        """Damping ratio [1], on the way out."""
        ground, mass = self.scene.ground, self.scene.cube.mass
        return ground.damping / math.sqrt(ground.stiffness) / math.sqrt(mass)

    @property
    def contact_time(self) -> float:
        """For how long the ground pushes [s]."""
        return flat_landing.duration(self.law, self.zeta) / self.omega

    @property
    def depth(self) -> float:
        """The deepest penetration [m]."""
        return flat_landing.depth(self.law, self.zeta) * self.speed / self.omega

    @property
    def depth_at_rest(self) -> float:
        """How deep the cube stands in the ground at rest [m]."""
        return linear_theory.sag(self.scene)

    @property
    def peak_force(self) -> float:
        """The largest force on the cube [N]."""
        return flat_landing.peak_force(self.law, self.zeta) * self.scene.cube.mass * self.speed * self.omega

    @property
    def restitution_with_weight(self) -> float:
        """Speed up over speed down at the surface under gravity [1]; 0 where the cube stays."""
        return flat_bounce.restitution(self.scene, self.speed)

    def ground(self) -> dict[str, float | str]:
        """Return the keys of a scene's ground that has this contact, rounded as people would."""
        ground = self.scene.ground
        return {
            "stiffness": float(f"{ground.stiffness:.9g}"),
            "damping": float(f"{ground.damping:.9g}"),
            "contact": self.law,
        }

    def as_data(self) -> dict[str, Any]:
        """Return all numbers, with their units in the keys."""
        ground, cube = self.scene.ground, self.scene.cube
        return {
            "contact": self.law,
            "mass_kg": cube.mass,
            "side_m": cube.side,
            "speed_m_per_s": self.speed,
            "gravity_m_per_s2": self.scene.gravity,
            "stiffness_kg_per_s2": ground.stiffness,
            "damping_kg_per_s": ground.damping,
            "restitution": self.restitution,
            "restitution_with_weight": self.restitution_with_weight,
            "zeta": self.zeta,
            "omega_rad_per_s": self.omega,
            "contact_time_s": self.contact_time,
            "depth_m": self.depth,
            "depth_at_rest_m": self.depth_at_rest,
            "peak_force_n": self.peak_force,
        }


def designed(
    given: Mapping[str, float], *, mass: float, side: float, speed: float, gravity: float, law: str = "gated"
) -> Contact:
    """Return the contact that has what is given.

    given: one value of BOUNCE and one of HARDNESS, in SI units; damping beside a stiffness only. mass [kg] and side [m]
    of the cube, speed [m/s] of its landing, gravity [m/s²]. law: contact law.
    Raises InputError for other keys, for numbers out of range, and for a ground out of the range of doubles.
    """
    _check_groups(given)
    numbers = {name: validation.number(name, value, (BOUNCE | HARDNESS)[name]) for name, value in given.items()}
    for name in HARDNESS.keys() & numbers.keys():
        validation.number(name, numbers[name], HARDNESS[name], above=0)
    speed = validation.number("speed", speed, "m/s", above=0)
    ground: dict[str, object] = {"contact": law, "friction": 0.0, **numbers}
    if "depth" in numbers:
        validation.choice("law", law, flat_landing.CONTACT_LAWS)
        restitution = numbers["restitution"]
        if not 0 < restitution <= 1:
            raise InputError(f"restitution = {restitution:g}: allowed is a number above 0, up to 1 [1]")
        deepest = float(ground.pop("depth"))  # type: ignore[arg-type]
        ground["stiffness"] = flat_landing.stiffness_of_depth(law, restitution, deepest, speed, mass)
    scene = from_mapping(
        {
            "cube": {"side": side, "mass": mass},
            "ground": ground,
            "launch": {"position": [0.0, 0.0, side / 2], "velocity": [0.0, 0.0, -speed], "node_velocity": "rigid"},
            "gravity": gravity,
        }
    )
    if not 0 < scene.ground.stiffness < math.inf:
        raise InputError(f"stiffness = {scene.ground.stiffness:g} kg/s²: allowed is a ground in the range of doubles")
    contact = Contact(scene, 1.0, speed)
    return Contact(scene, numbers.get("restitution", math.exp(-flat_landing.loss(law, contact.zeta))), speed)


def _check_groups(given: Mapping[str, float]) -> None:
    """Raise InputError unless one of each group is given."""
    for group in (BOUNCE, HARDNESS):
        named = [name for name in given if name in group]
        if len(named) != 1:
            options = " or ".join(f"--{name.replace('_', '-')}" for name in group)
            told = " and ".join(f"--{name.replace('_', '-')}" for name in named) or "none"
            raise InputError(f"{told} given: needed is one of {options}")
    if "damping" in given and "stiffness" not in given:
        raise InputError("--damping: allowed is beside --stiffness only; give --restitution")

"""Keys that say in other words what a scene stores: a side for a radius, a restitution for a damping.

side [m]: in place of `radius`, exact to rounding. The geometry is then `exact` unless it is given here, whatever the
preset; the radius that has this side is derived and stored. restitution [1]: in place of `damping`, speed up over speed
down of a flat landing. The contact law is then `gated` unless `contact` or a preset is given: the listings' law would
brake such a cube in the air. contact_time [s]: with `restitution`, in place of `stiffness`; how long the ground pushes
in that landing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from stiffdice.errors import InputError
from stiffdice.scene import flat_landing, units, validation
from stiffdice.scene.cube import GEOMETRIES, Cube, radius_of
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.mass_distribution import checked_node_masses, checked_sides
from stiffdice.scene.rotation import rotated

# By section: a key that may be given, and the key it is given instead of.
INSTEAD: Mapping[str, Mapping[str, str]] = {
    "cube": {"side": "radius", "sides": "radius", "node_masses": "mass"},
    "ground": {"restitution": "damping", "contact_time": "stiffness"},
}

# What goes with a side, unless a geometry is given beside it; and with a restitution, unless a contact law or a preset
# is: the law of the listings would brake a cube of such a damping in the air.
GEOMETRY = "exact"
CONTACT = "gated"

# Keys as stored with their values, and what was derived, a line for each value.
Resolved = tuple[dict[str, Any], tuple[str, ...]]


def excluded(section: str, key: str) -> set[str]:
    """Return the keys of a section that say the same as one of them: giving it anew leaves them out."""
    pairs = INSTEAD.get(section, {})
    same = {stored for given, stored in pairs.items() if key in (given, stored)}
    return {part for pair in pairs.items() if pair[1] in same for part in pair} - {key}


# Keys that are stored beside those that follow from them: both may be given, if they agree.
_STORED = ("sides", "node_masses")


def _refuse_both(section: str, keys: Mapping[str, Any]) -> None:
    for key, stored in INSTEAD[section].items():
        if key in keys and stored in keys and key not in _STORED:
            raise InputError(f"{section}.{key} and {section}.{stored} are both given: allowed is one of them")


def cube(keys: Mapping[str, Any]) -> Resolved:
    """Return the keys of a cube with its radius for its side or sides, and its mass; raises InputError for both."""
    _refuse_both("cube", keys)
    if "sides" in keys and "side" in keys:
        raise InputError("cube.side and cube.sides are both given: allowed is one of them")
    if "sides" in keys or "node_masses" in keys:
        return _box(keys)
    if "side" not in keys:
        return dict(keys), ()
    geometry = validation.choice("cube.geometry", keys.get("geometry", GEOMETRY), GEOMETRIES)
    rest = dict(keys)
    side = validation.number("cube.side", rest.pop("side"), "m", above=0)
    rest["radius"] = radius_of(side, geometry)
    told = f"cube.radius = {rest['radius']:.6g} m, from cube.side = {side:g} m by the {geometry} geometry"
    return rest, (told,)


def _box(keys: Mapping[str, Any]) -> Resolved:
    """Return the keys of a box with what follows from its sides and from its nodes' masses."""
    rest, told = dict(keys), []
    if "sides" in rest:
        sides = checked_sides(rest["sides"])
        rest.setdefault("geometry", GEOMETRY)
        if "radius" not in rest:
            rest["radius"] = math.hypot(*sides) / 2
            told.append(f"cube.radius = {rest['radius']:.6g} m, half the diagonal of cube.sides = {list(sides)} m")
    if "node_masses" in rest:
        masses = checked_node_masses(rest["node_masses"])
        rest.setdefault("inertia", "corners")
        if "mass" not in rest:
            rest["mass"] = sum(masses)
            told.append(f"cube.mass = {rest['mass']:.6g} kg, the sum of cube.node_masses")
    if "side" in rest:
        rest, of_side = cube({key: value for key, value in rest.items() if key != "node_masses"})
        rest["node_masses"] = keys["node_masses"]
        told.extend(of_side)
    return rest, tuple(told)


def ground(keys: Mapping[str, Any], cube: Cube, stiffness: float) -> Resolved:
    """Return the keys of a ground with stiffness and damping for its restitution and contact time.

    These are of a flat landing without gravity under the scene's contact law (`flat_landing`). stiffness [kg/s²]: of a
    ground for which none is given. Raises InputError for
    keys that exclude each other, and for values that no ground has.
    """
    _refuse_both("ground", keys)
    if "restitution" not in keys:
        if "contact_time" in keys:
            raise InputError("ground.contact_time is given: allowed is beside ground.restitution only")
        return dict(keys), ()
    restitution = validation.number("ground.restitution", keys["restitution"], "1")
    if not 0 < restitution <= 1:
        raise InputError(f"ground.restitution = {restitution:g}: allowed is a number above 0, up to 1 [1]")
    law = validation.choice("ground.contact", keys.get("contact", CONTACT), CONTACT_LAWS)
    rest = {key: value for key, value in keys.items() if key not in INSTEAD["ground"]} | {"contact": law}
    source = f"from ground.restitution = {restitution:g}"
    told: tuple[str, ...] = ()
    if "contact_time" in keys:
        contact_time = validation.number("ground.contact_time", keys["contact_time"], "s", above=0)
        source += f" and ground.contact_time = {contact_time:g} s"
        rest["stiffness"] = flat_landing.stiffness(law, restitution, contact_time, cube.mass)
        if not 0 < rest["stiffness"] < math.inf:
            raise InputError(
                f"ground.contact_time = {contact_time:g}: double precision has no ground so stiff or so soft for "
                f"cube.mass = {cube.mass:g} kg (stiffness {rest['stiffness']:g} kg/s²)"
            )
        told = (f"ground.stiffness = {rest['stiffness']:.6g} kg/s², {source}",)
    stiffness = validation.number("ground.stiffness", rest.get("stiffness", stiffness), "kg/s²", above=0)
    rest["damping"] = flat_landing.damping(law, restitution, stiffness, cube.mass)
    told += (f"ground.damping = {rest['damping']:.6g} kg/s, {source}: a flat landing without gravity, {law}",)
    return rest, told


def launch(keys: Mapping[str, Any], cube: Cube) -> dict[str, Any]:
    """Return the keys of a launch, its angular momentum L = I ω where it is given as ω, as in `20 rad/s`."""
    if "angular_momentum" not in keys:
        return dict(keys)
    given = validation.listed(keys["angular_momentum"])
    if isinstance(given, Mapping):
        given = {key: _momentum_of_each(value, cube) for key, value in given.items()}
    elif isinstance(given, list):
        given = _momentum(given, cube, keys.get("orientation", (0.0, 0.0, 0.0)))
    return {**keys, "angular_momentum": given}


def _rates(values: list[Any]) -> list[float] | None:
    """Return angular velocities [rad/s]; None for values of which one that is not zero has another unit."""
    try:
        return [units.in_si(value, "rad/s") if value != 0 or value is False else 0.0 for value in values]
    except (TypeError, ValueError):
        return None


def _momentum_of_each(value: Any, cube: Cube) -> Any:
    """Return a component of an angular velocity as one of angular momentum; any other value as it is."""
    rates = _rates([value])
    if rates is None:
        return value
    return cube.moment_of_inertia * rates[0] if any(rates) else 0.0


def _momentum(values: list[Any], cube: Cube, orientation: object) -> list[Any]:
    """Return an angular velocity as angular momentum, of a cube turned by a rotation vector; other values as given."""
    rates = _rates(values)
    if rates is None:
        return values
    if not any(rates):
        return rates
    if cube.distribution.is_isotropic:
        return [cube.moment_of_inertia * rate for rate in rates]
    edges = rotated(np.eye(3), np.array(validation.vector("launch.orientation", orientation, "rad")))
    momentum: list[float] = (edges.T @ (cube.distribution.tensor @ (edges @ rates))).tolist()
    return momentum

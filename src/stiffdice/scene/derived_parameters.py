"""Keys that say in other words what a scene stores: a side for a radius, a restitution for a damping."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from stiffdice.errors import InputError
from stiffdice.scene import flat_landing, units, validation
from stiffdice.scene.cube import GEOMETRIES, Cube, radius_of
from stiffdice.scene.flat_landing import CONTACT_LAWS

# By section: a key that may be given, and the key it is given instead of.
INSTEAD: Mapping[str, Mapping[str, str]] = {
    "cube": {"side": "radius"},
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
    return {other for pair in pairs.items() if key in pair for other in pair if other != key}


def _refuse_both(section: str, keys: Mapping[str, Any]) -> None:
    for key, stored in INSTEAD[section].items():
        if key in keys and stored in keys:
            raise InputError(f"{section}.{key} and {section}.{stored} are both given: allowed is one of them")


def cube(keys: Mapping[str, Any]) -> Resolved:
    """Return the keys of a cube with its radius for its side; raises InputError if it has both."""
    _refuse_both("cube", keys)
    if "side" not in keys:
        return dict(keys), ()
    geometry = validation.choice("cube.geometry", keys.get("geometry", GEOMETRY), GEOMETRIES)
    rest = dict(keys)
    side = validation.number("cube.side", rest.pop("side"), "m", above=0)
    rest["radius"] = radius_of(side, geometry)
    told = f"cube.radius = {rest['radius']:.6g} m, from cube.side = {side:g} m by the {geometry} geometry"
    return rest, (told,)


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
        given = {key: _momentum([value], cube)[0] for key, value in given.items()}
    elif isinstance(given, list):
        given = _momentum(given, cube)
    return {**keys, "angular_momentum": given}


def _momentum(values: list[Any], cube: Cube) -> list[Any]:
    """Return angular velocities as angular momenta; values of which one that is not zero has another unit as given."""
    try:
        rates = [units.in_si(value, "rad/s") if value != 0 or value is False else 0.0 for value in values]
    except (TypeError, ValueError):
        return values
    return [cube.moment_of_inertia * rate for rate in rates]

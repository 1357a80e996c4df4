"""A scene as plain numbers, as the page's own kernel (assets/kernel.js) takes it."""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.scene.scene import Scene
from stiffdice.simulation.criteria.apex import default_hop_height

# Of `Physics`: the numbers that the kernel takes under the same names.
_NUMBERS = (
    *("mass", "gravity", "inertia", "stiffness", "damping", "friction", "nx", "ny", "nz", "cutoff"),
    *("node_weight", "weight", "reach", "radius", "side"),
)
MODELS = ("sliding", "tumbling")


def plain(scene: Scene, model: str) -> dict[str, Any]:
    """Return a scene and its launch as JSON-able numbers in SI units; what they are, kernel.js says.

    scene: of a body with one moment of inertia. model: sliding or tumbling. Raises InputError for others.
    """
    if model not in MODELS:
        raise InputError(f"model = {model}: the page computes {' and '.join(MODELS)}")
    physics, start = physics_of(scene), start_of(scene, model)[0]
    numbers = {name: float(getattr(physics, name)) for name in _NUMBERS}
    numbers["inertia"] = scene.cube.moment_of_inertia
    launch = {name: start[name].ravel().tolist() for name in start.dtype.names}
    return {
        "model": model,
        **numbers,
        "gated": scene.ground.contact == "gated",
        "hop_height": default_hop_height(scene),
        "duration": scene.duration,
        **launch,
    }

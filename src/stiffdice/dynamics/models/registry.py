"""Which motion is computed. A model is a module with TAG, `force`, `kick` and `drift`; one line registers it.

What turns the cube, and what the ground touches, is said in `state.py`. The force is that of a cube near the ground.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from stiffdice.dynamics import contact
from stiffdice.dynamics.compilation import by_tag, constant, njit
from stiffdice.dynamics.contact import Wrench, falling, height_of, lowest_of, reaches
from stiffdice.dynamics.inertia import rotate
from stiffdice.dynamics.models import free_flight, pair, sliding, tumbling, vertical
from stiffdice.dynamics.state import TOUCHING, TURNING, Physics
from stiffdice.dynamics.vector import norm, vector

_MODULES: dict[str, Any] = {
    "vertical": vertical,
    "sliding": sliding,
    "tumbling": tumbling,
    "flying": free_flight,
}

MODELS = {name: module.TAG for name, module in _MODULES.items()}


def _chosen(part: str) -> Callable[..., Any]:
    return by_tag({type(module.TAG): getattr(module, part) for module in (*_MODULES.values(), pair)})


# (model, physics, state, wrench, h): advance the momenta, and the nodes' spin, by h [s] under a force and torque.
kick = _chosen("kick")
# (model, physics, state, h): advance place and orientation by h [s] at the state's velocities.
drift = _chosen("drift")
# (model) -> whether the body turns; whether the ground can act on it.
turns = by_tag({type(tag): constant(name in TURNING) for name, tag in MODELS.items()})
touches = by_tag({type(tag): constant(name in TOUCHING) for name, tag in MODELS.items()})


def _force_of(module: Any, touching: bool) -> Any:
    near = module.force

    @njit
    def force(physics: Physics, state: Any) -> Wrench:
        if touching and reaches(physics, height_of(physics, state) - physics.reach):
            return near(physics, state)
        return falling(physics)

    return force


_FORCES = {type(module.TAG): _force_of(module, name in TOUCHING) for name, module in _MODULES.items()}
# (model, physics, state) -> force [N] and torque [N m] on the body in this state, or on each of two.
force = by_tag({**_FORCES, type(pair.TAG): pair.force})
# (model, new, old) -> by how much these have changed.
change = by_tag({**dict.fromkeys(_FORCES, contact.change), type(pair.TAG): pair.change})


@njit
def move(model: Any, state: Any, shift: Any) -> None:
    """Shift the place by the first three [m], and turn the body by the rotation vector of the other three [rad]."""
    for axis in range(3):
        state.position[axis] += shift[axis]
    angle = norm(vector(shift[3:]))
    if turns(model) and angle > 0.0:
        rotate(state.node_offset, shift[3] / angle, shift[4] / angle, shift[5] / angle, angle)


@njit
def extent(model: Any, physics: Physics, state: Any) -> float:
    """Return how far below the centre a node can be in a free flight from this state on [m]."""
    return physics.reach if turns(model) else lowest_of(physics, state)

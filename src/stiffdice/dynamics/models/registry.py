"""Which motion is computed. A model is a module with the functions below and TAG; one line registers it."""

from __future__ import annotations

from typing import Any

from stiffdice.dynamics.compilation import by_tag
from stiffdice.dynamics.models import free_flight, sliding, tumbling, vertical

_MODULES: dict[str, Any] = {
    "vertical": vertical,
    "sliding": sliding,
    "tumbling": tumbling,
    "flying": free_flight,
}

MODELS = {name: module.TAG for name, module in _MODULES.items()}

# (model, law, physics, state) -> force [N] and torque [N m] on the body in this state.
force = by_tag({type(module.TAG): module.force for module in _MODULES.values()})

# (model, physics, state, wrench, h): advance the momenta, and the nodes' spin, by h [s] under a force and torque.
kick = by_tag({type(module.TAG): module.kick for module in _MODULES.values()})

# (model, physics, state, h): advance place and orientation by h [s] at the state's velocities.
drift = by_tag({type(module.TAG): module.drift for module in _MODULES.values()})

# (model, physics, state) -> the velocity [m/s] and the spin [rad/s] at which place and orientation change.
motion = by_tag({type(module.TAG): module.motion for module in _MODULES.values()})

# (model, state, shift): shift place by the first three [m], and turn the body by the rotation vector of the rest [rad].
move = by_tag({type(module.TAG): module.move for module in _MODULES.values()})

# (model, physics, state, duration): turn the body at its present spin for so long [s], as in a free flight.
turn = by_tag({type(module.TAG): module.turn for module in _MODULES.values()})

# (model) -> whether the body turns.
turns = by_tag({type(module.TAG): module.turns for module in _MODULES.values()})

# (model) -> whether the ground can act on the body.
touches = by_tag({type(module.TAG): module.touches for module in _MODULES.values()})

# (model, physics, state) -> how far below the centre a node can be in a free flight from this state on [m].
extent = by_tag({type(module.TAG): module.extent for module in _MODULES.values()})

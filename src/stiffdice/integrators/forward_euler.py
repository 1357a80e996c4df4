"""Forward Euler: the paper's equations 6 to 9 read literally, all at once with the old velocity and the old spin.

First order. An undamped oscillator grows by √(1 + (ωh)²) a step, at any step; it takes a damping ratio ζ > ωh/2 to
hold it (Hairer, Nørsett and Wanner, Solving Ordinary Differential Equations I, I.7; II, IV.2). The listings use the new
velocity in equation 7, which makes all the difference: `symplectic_euler`.
"""

from __future__ import annotations

from collections import namedtuple
from typing import Any

from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.models import registry as models
from stiffdice.dynamics.state import Physics

ForwardEuler = namedtuple("ForwardEuler", ())
TAG = ForwardEuler()
FORMULA = "x += h u; nodes turned by h L/I; then u += h a; L += h torque, all of the old state"
LAG = -0.5  # the velocity of a step is the path's slope half a step after it: x_(n+1) = x_n + h u_n
OF_PAIRS = True


@njit
def step(model: Any, physics: Physics, state: Any, h: float, tolerance: float) -> int:
    """Advance `state` by one step of h [s] and return how often the force was evaluated."""
    wrench = models.force(model, physics, state)
    models.drift(model, physics, state, h)
    models.kick(model, physics, state, wrench, h)
    return 1

"""What theory predicts, to draw over every measured curve."""

from __future__ import annotations

import math

from stiffdice.scene import Scene

# Symplectic Euler without damping is linearly stable below this ωh.
STABILITY_LIMIT = 2.0

# Nodes that carry a flat landing.
BOUNCE_NODES = 4


def contact_frequency(stiffness: float, mass: float, nodes: int = BOUNCE_NODES) -> float:
    """Return ω = √(kS/m) [rad/s] of a contact mode that k nodes carry: 4 in a flat landing."""
    # Not √(kS/m): the quotient may leave the range of doubles where its root does not.
    return math.sqrt(nodes) * math.sqrt(stiffness) / math.sqrt(mass)


def omega_h(scene: Scene, steps: int) -> float:
    """Return ωh [1] of a flat landing in this scene: contact frequency times step size."""
    return contact_frequency(scene.ground.stiffness, scene.cube.mass) * (scene.duration / steps)


def steps_for(scene: Scene, target: float) -> float:
    """Return the steps, not rounded, at which a flat landing in this scene has ωh = target."""
    return contact_frequency(scene.ground.stiffness, scene.cube.mass) * scene.duration / target

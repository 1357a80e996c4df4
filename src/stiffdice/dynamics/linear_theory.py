"""What theory predicts, to draw over every measured curve."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.state import Array, turned_tensor
from stiffdice.scene.scene import Scene

STABILITY_LIMIT = 2.0  # below this ωh symplectic Euler without damping is linearly stable
BOUNCE_NODES = 4  # carry a flat landing


def contact_frequency(stiffness: float, mass: float, nodes: float = BOUNCE_NODES) -> float:
    """Return ω = √(kS/m) [rad/s] of a contact mode that k nodes carry: 4 in a flat landing."""
    # Not √(kS/m): the quotient may leave the range of doubles where its root does not.
    return math.sqrt(nodes) * math.sqrt(stiffness) / math.sqrt(mass)


def sag(scene: Scene) -> float:
    """Return how deep a cube at rest on its face sinks in [m]: m g/(4S); infinite without springs."""
    springs = BOUNCE_NODES * scene.ground.stiffness
    return scene.cube.mass * scene.gravity / springs if springs > 0 else math.inf


def omega_h(scene: Scene, steps: float) -> float:
    """Return ωh [1] of a flat landing in this scene: contact frequency times step size."""
    return contact_frequency(scene.ground.stiffness, scene.cube.mass) * (scene.duration / steps)


def steps_for(scene: Scene, target: float) -> float:
    """Return the steps, not rounded, at which a flat landing in this scene has ωh = target."""
    return contact_frequency(scene.ground.stiffness, scene.cube.mass) * scene.duration / target


def stability_limit(zeta: float) -> float:
    """Return the ωh [1] below which symplectic Euler with explicit damping is linearly stable: 2(√(1 + ζ²) − ζ).

    zeta: damping ratio ζ = c/(2mω) >= 0. One step of v' = v − h(ω²x + 2ζωv), x' = x + hv' has the characteristic
    polynomial λ² − (2 − (ωh)² − 2ζωh)λ + 1 − 2ζωh; at the limit λ = −1, so (ωh)² + 4ζωh = 4.
    """
    # The same number as documented, without its difference of two large ones.
    return 2 / (math.hypot(1, zeta) + zeta)


def growth(omega_h: float, zeta: float) -> float:
    """Return the larger modulus [1] of the roots of the polynomial in `stability_limit`: a step's growth in the end."""
    damping = 2 * zeta * omega_h
    trace, determinant = 2 - omega_h**2 - damping, 1 - damping
    discriminant = trace * trace - 4 * determinant
    if discriminant < 0:
        return math.sqrt(determinant)
    return (abs(trace) + math.sqrt(discriminant)) / 2


def magic_step(n: float) -> float:
    """Return ωh = 2 sin(π/(2n)) [1]: half a period of an undamped contact is n steps, n >= 1.

    The discrete oscillator turns by θ in a step, 2 sin(θ/2) = ωh. Here θ = π/n: with a whole n > 1, n steps later depth
    and speed have changed their signs, at whatever phase the step met the ground, and the bounce keeps its energy.
    """
    return 2 * math.sin(math.pi / (2 * n))


def magic_steps(low: float, high: float, most: int = 1000) -> dict[int, float]:
    """Return the magic steps with low <= ωh <= high by their n, from 2 to `most`."""
    steps = {n: magic_step(n) for n in range(2, most + 1)}
    return {n: step for n, step in steps.items() if low <= step <= high}


def gain_bound(omega_h: float) -> float:
    """Return what e² [1] of an undamped bounce cannot exceed, at ωh < 2: 1/(1 − (ωh)²/4); nor is it below its inverse.

    Contact keeps v² + ω²x(x − hv), x being the place after a step with velocity v. The step that meets the ground and
    the one that leaves it have x between 0 and hv, so that the second term is between −v²(ωh)²/4 and 0 at either end.
    """
    return 1 / (1 - omega_h**2 / 4)


def largest_gain(omega_h: float) -> float:
    """Return the largest e² [1] over the phases of an undamped bounce without gravity, at ωh < 2.

    The least is its inverse, a bounce run backwards being one. A node that touches the ground at a step, x_0 = 0, goes
    on with x_k = −hv sin(kθ)/sin θ and leaves in step N, the first with Nθ > π:
    e² = (x_N − x_(N−1))²/(hv)² = cos²((N − ½)θ)/cos²(θ/2). That no other phase gains more is measured, not proven
    (`experiments.bounce_map`).
    """
    angle = 2 * math.asin(omega_h / 2)
    leaving = math.floor(math.pi / angle) + 1
    return math.cos((leaving - 0.5) * angle) ** 2 * gain_bound(omega_h)


def contact_modes(scene: Scene, offsets: Array, touching: npt.NDArray[np.bool_ | np.intp]) -> Array:
    """Return ω² [rad²/s²] of the modes of a rigid cube that stands on some of its nodes, ascending, shape (4,).

    offsets: nodes relative to the centre of mass [m], shape (8, 3). touching: mask or indices of those on the ground.
    The coordinates are the displacement along the ground's normal n and the rotation vector; a node r moves along n by
    J = (1, r × n) of them, so that ω² are the eigenvalues of M⁻¹ S Σ JᵀJ, M of the mass and the tensor of inertia. A
    mode without a spring has 0. Contact shallow against the side: the torque by which a force topples a cube is left
    out.
    """
    arms = np.cross(offsets[touching], scene.ground.normal)
    if scene.cube.distribution.is_isotropic:
        levers = arms * scene.cube.moment_of_inertia**-0.5
    else:
        levers = arms @ np.linalg.cholesky(np.linalg.inv(turned_tensor(scene.cube, offsets)))
    rows = np.column_stack([np.full(len(arms), scene.cube.mass**-0.5), levers])
    squares: Array = np.linalg.eigvalsh(scene.ground.stiffness * rows.T @ rows)
    return np.maximum(squares, 0.0)  # round-off around the modes without a spring

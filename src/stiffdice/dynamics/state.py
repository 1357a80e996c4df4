"""What a kernel works on: the state of one rigid body, and the physics it moves in."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics.inertia import body_of
from stiffdice.errors import InputError
from stiffdice.scene.cube import SIGNS, Cube
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.rotation import rotated
from stiffdice.scene.scene import Scene

Array = npt.NDArray[np.float64]
States = npt.NDArray[np.void]  # of STATE


# A rigid body; kernels change it in place. position [m], velocity [m/s], angular_momentum [kg m²/s], angular_velocity
# [rad/s], the last as the nodes' velocities use it; node_offset [m]: relative to the centre (the listings' X_rel).
# One record is one state; an array of records is an ensemble or a trajectory. Records reach compiled code as bare
# pointers, where tuples of arrays would cost a reference count at every call (20 times the work of a step).
STATE = np.dtype(
    [
        ("position", np.float64, 3),
        ("velocity", np.float64, 3),
        ("angular_momentum", np.float64, 3),
        ("angular_velocity", np.float64, 3),
        ("node_offset", np.float64, (len(SIGNS), 3)),
    ]
)


# Velocity [m/s] and spin [rad/s] of a body, or what they come to in a step: a shift [m] and a rotation vector [rad].
Motion = tuple[float, float, float, float, float, float]


class Physics(NamedTuple):
    """The numbers of a scene that the forces need; SI units, the ground's constants per node."""

    mass: float
    gravity: float
    inertia: float  # [kg m²] the least moment of one whose moments differ
    stiffness: float
    damping: float
    friction: float
    onset: float  # [m] depth beyond which a node feels the ground, by its contact law
    approach_damping: float  # [1] of a flat cube, over that on the way out
    nx: float
    ny: float
    nz: float
    cutoff: float  # [m/s] of regularised friction: 1e-6 r in the listings
    node_weight: float  # [N]
    weight: float  # [N] of all nodes, summed one by one as the listings sum forces
    reach: float  # [m] no node is farther from the centre
    radius: float  # [m] the cube's nominal one
    side: float  # [m] the shortest
    body: Any  # of `inertia.py`: how it turns


def physics_of(scene: Scene) -> Physics:
    """Return the scene's numbers as a kernel takes them."""
    cube, ground, nodes = scene.cube, scene.ground, scene.cube.node_offsets()
    node_weight = cube.mass / len(nodes) * scene.gravity
    weight = 0.0
    for _ in nodes:
        weight += node_weight
    # The margin covers what rotating the nodes step by step can add in round-off.
    reach = float(np.linalg.norm(nodes, axis=1).max()) * (1 + 1e-6)
    forces = ground.stiffness, ground.damping, ground.friction, *CONTACT_LAWS[ground.contact]
    plane = *ground.normal, 1e-6 * cube.radius
    sizes = reach, cube.radius, 2 * min(cube.half_sides)
    weights = node_weight, weight
    return Physics(cube.mass, scene.gravity, cube.least_moment, *forces, *plane, *weights, *sizes, body_of(cube))


# The models that turn the cube; the others leave its spin out.
TURNING = frozenset({"tumbling", "flying"})
# The models in which the ground acts on the cube.
TOUCHING = frozenset({"vertical", "sliding", "tumbling"})


def start_of(scene: Scene, model: str) -> States:
    """Return the state at the launch, shape (1,).

    Without spin for a model that does not turn the cube; for `vertical` without horizontal velocity, too.
    Raises InputError for `vertical` on ground that is not level.
    """
    launch = scene.launch
    state = np.zeros(1, STATE)
    state["position"] = launch.position
    state["velocity"] = launch.velocity
    if model == "vertical":
        if scene.ground.normal != (0.0, 0.0, 1.0):
            normal = ", ".join(f"{part:g}" for part in scene.ground.normal)
            raise InputError(
                f"model = vertical: ground.normal = [{normal}]; allowed is level ground, [0, 0, 1], as the model moves "
                "the cube up and down only"
            )
        state["velocity"][:, :2] = 0.0
    state["node_offset"] = rotated(scene.cube.node_offsets(), np.array(launch.orientation))
    if model in TURNING:
        state["angular_momentum"] = launch.spin
        if launch.node_velocity == "rigid":
            state["angular_velocity"] = spin_of(scene.cube, state[0])
    return state


def spin_of(cube: Cube, state: Any, nodes: Array | None = None) -> Array:
    """Return the spin [rad/s] that a STATE record's angular momentum gives a cube, shape (3,).

    nodes: those by which the cube is turned, shape (8, 3); None takes the state's own.
    """
    momentum = np.asarray(state["angular_momentum"])
    if cube.distribution.is_isotropic:
        return momentum / cube.moment_of_inertia
    return np.asarray(np.linalg.solve(turned_tensor(cube, state["node_offset"] if nodes is None else nodes), momentum))


def turned_tensor(cube: Cube, nodes: Array) -> Array:
    """Return tensors of inertia [kg m²], shape (..., 3, 3), of a cube whose nodes, shape (..., 8, 3), are so turned."""
    edges = edges_of(cube, nodes)
    return np.asarray(np.einsum("...ei,ef,...fj->...ij", edges, cube.distribution.tensor, edges))


def edges_of(cube: Cube, nodes: Array) -> Array:
    """Return the directions of a cube's edges, one a row, shape (..., 3, 3), whose nodes, shape (..., 8, 3), are so."""
    return np.asarray(np.einsum("ke,...kx->...ex", SIGNS, nodes) / len(SIGNS) / np.array(cube.half_sides)[:, None])


class Ensemble(NamedTuple):
    """The launches of members, and how late [s] each enters the scene's flight; shape (member,) each."""

    launches: States
    late: Array

"""What an engine's module has: a class, of which an instance is one run."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import ClassVar

import numpy as np

from stiffdice.dynamics.state import TOUCHING, TURNING, Array, States, matrices, start_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene.scene import Scene


@dataclass(eq=False)
class Engine:
    """One run of an engine, standing at its launch or where `advance` left it.

    launch: STATE records, shape (1,). h [s]: a time step. tolerance [1]: of the error, for an engine that controls its
    own. most: force evaluations, after which such an engine ends its run; None for any number.
    """

    LAG: ClassVar[float] = 0.5  # [steps] by how many the velocity is behind the place, as schemes.LAGS
    SCHEME: ClassVar[str] = "symplectic_euler"  # what the time stepping is called in files
    PACKAGE: ClassVar[str]  # whose version is the engine's

    scene: Scene
    model: str
    launch: States
    h: float
    tolerance: float = schemes.TOLERANCE
    most: int | None = schemes.BUDGET

    def __post_init__(self) -> None:
        """Set up the engine, at the launch."""

    @classmethod
    def unfit(cls, scene: Scene, model: str) -> str | None:
        """Return in one sentence why the engine cannot represent a scene and model, or None if it can."""
        return None

    @classmethod
    def version(cls) -> str:
        """Return the engine's name and version."""
        return f"{cls.PACKAGE} {version(cls.PACKAGE)}"

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations.

        Where the run blows up, infinities and not-a-numbers from there on; never an exception.
        """
        raise NotImplementedError


class RigidBody(Engine):
    """A run of an engine of rigid bodies: its ground acts on nothing above it, and the nodes move with the cube."""

    NAME: ClassVar[str]  # for people

    def __post_init__(self) -> None:
        """Take apart what every such engine is set up from."""
        (self.start,) = self.launch.copy()
        self.turns, self.inertia = self.model in TURNING, self.scene.cube.moment_of_inertia
        # Along which the centre moves.
        self.axes = [2] if self.model == "vertical" else [0, 1, 2]

    @classmethod
    def unfit(cls, scene: Scene, model: str) -> str | None:
        """Return in one sentence why the engine cannot represent a scene and model, or None if it can.

        Without damping the contact laws are one; above the ground it does not matter how fast a node moves.
        """
        ground, launch = scene.ground, scene.launch
        if model not in TOUCHING:
            return None
        if ground.contact == "ungated" and ground.damping > 0:
            return (
                f"ground.contact = ungated, ground.damping = {ground.damping:g}: allowed is contact gated, or damping "
                f"0, as {cls.NAME}'s ground acts on nothing above it"
            )
        if model in TURNING and launch.node_velocity == "translation" and any(launch.spin) and _touches(scene, model):
            return (
                "launch.node_velocity = translation: allowed is rigid where a spinning cube is launched in the ground, "
                f"as {cls.NAME}'s nodes move with the cube"
            )
        return None

    @property
    def spin(self) -> Array:
        """The angular velocity at the launch [rad/s]."""
        return np.asarray(self.start["angular_momentum"] / self.inertia)

    def put(self, states: States, places: Array, velocities: Array, *turning: Array) -> None:
        """Make states, shape (K,), of an engine's numbers.

        places [m], velocities [m/s]: along `axes`, shape (K, axis). turning: unit quaternions (w, x, y, z), shape
        (K, 4), and spins [rad/s], shape (K, 3), of a cube that turns.
        """
        states[:] = self.start
        states["position"][:, self.axes], states["velocity"][:, self.axes] = places, velocities
        if self.turns:
            quaternions, spins = turning
            states["angular_velocity"], states["angular_momentum"] = spins, self.inertia * spins
            states["node_offset"] = self.start["node_offset"] @ np.swapaxes(matrices(quaternions), 1, 2)


def _touches(scene: Scene, model: str) -> bool:
    (state,) = start_of(scene, model)
    return bool(((state["position"] + state["node_offset"]) @ np.array(scene.ground.normal)).min() < 0)

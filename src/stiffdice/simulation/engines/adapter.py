"""What an engine's module has: a class, of which an instance is one run."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from importlib.metadata import version
from typing import ClassVar

import numpy as np

from stiffdice.dynamics.models.registry import MODELS
from stiffdice.dynamics.state import TOUCHING, TURNING, Array, States, physics_of, start_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene.rotation import along, matrices
from stiffdice.scene.scene import Scene


@dataclass(eq=False)
class Engine(ABC):
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

    @abstractmethod
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

    @abstractmethod
    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations.

        Where the run blows up, infinities and not-a-numbers from there on; never an exception.
        """


class Scheme(Engine):
    """One run of a scheme of ours, the one of SCHEME."""

    @classmethod
    def of(cls, name: str) -> type[Engine]:
        """Return the class of runs by a scheme."""
        return type(name, (cls,), {"SCHEME": name, "LAG": schemes.LAGS[name]})

    def __post_init__(self) -> None:
        self._tags = schemes.SCHEMES[self.SCHEME], MODELS[self.model]
        self._physics, self._state = physics_of(self.scene), self.launch.copy()

    @classmethod
    def unfit(cls, scene: Scene, model: str) -> str | None:
        """Return in one sentence why the scheme does not apply to a scene and model, or None if it does."""
        return schemes.unfit(cls.SCHEME, scene, model)

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations."""
        whole = np.concatenate([self._state, states])
        evaluations = schemes.advance(*self._tags, self._physics, whole, every, self.h, self.tolerance)
        states[:], self._state = whole[1:], whole[-1:]
        return int(evaluations)


class RigidBody(Engine):
    """A run of an engine of rigid bodies: its ground acts on nothing above it, and the nodes move with the cube.

    A row of its numbers is the place [m] and the velocity [m/s] along `axes`. Of a cube that turns, a unit quaternion
    (w, x, y, z) follows the place, and the spin [rad/s] the velocity.
    """

    NAME: ClassVar[str]  # for people

    def __post_init__(self) -> None:
        (self.start,) = self.launch.copy()
        self.turns, self.inertia = self.model in TURNING, self.scene.cube.moment_of_inertia
        self.spin = np.asarray(self.start["angular_momentum"] / self.inertia)  # [rad/s]
        self.axes = slice(2, 3) if self.model == "vertical" else slice(0, 3)  # along which the centre moves

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
        if model in TURNING and launch.node_velocity == "translation" and any(launch.spin):
            (state,) = start_of(scene, model)
            if along(state["position"] + state["node_offset"], ground.normal).min() < 0:
                return (
                    "launch.node_velocity = translation: allowed is rigid where a spinning cube is launched in the "
                    f"ground, as {cls.NAME}'s nodes move with the cube"
                )
        return None

    def advance(self, states: States, every: int) -> int:
        """Fill `states`, shape (K,), with the state after each `every` further steps; return the force evaluations."""
        width = len(range(3)[self.axes])
        rows = np.full((len(states), 13 if self.turns else 2 * width), np.nan)
        evaluations = sum(self._next(row, every) for row in rows)
        rows[~np.isfinite(rows).all(axis=1)] = np.nan
        states[:] = self.start
        if self.turns:
            places, quaternions, velocities, spins = np.split(rows, [3, 7, 10], axis=1)
            self._turn(states, quaternions, spins)
        else:
            places, velocities = np.split(rows, 2, axis=1)
        states["position"][:, self.axes], states["velocity"][:, self.axes] = places, velocities
        return evaluations

    @abstractmethod
    def _next(self, row: Array, every: int) -> int:
        """Take so many steps, fill a row unless the run blew up, and return the force evaluations."""

    def _turn(self, states: States, quaternions: Array, spins: Array) -> None:
        """Make what turns of states."""
        states["angular_velocity"], states["angular_momentum"] = spins, self.inertia * spins
        states["node_offset"] = self.start["node_offset"] @ np.swapaxes(matrices(quaternions), 1, 2)

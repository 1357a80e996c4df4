"""Launches at random: how a die leaves the hand, drawn from a stated distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from stiffdice.dynamics.state import Array, States, start_of, turned_tensor
from stiffdice.errors import InputError
from stiffdice.scene import validation
from stiffdice.scene.rotation import matrices
from stiffdice.scene.scene import RandomSpin, Scene

# Launches drawn by one generator: the k-th launch of a seed is the same however many are drawn.
BLOCK = 4096

ORIENTATIONS = ("uniform", "as_launched")


@dataclass(frozen=True)
class LaunchDistribution:
    """How launches differ from that of a scene.

    orientation: `uniform`, over all rotations, or `as_launched`. velocity_spread [m/s]: standard deviation of each
    component about the scene's. spin_spread [rad/s]: likewise of the angular velocity, a Gaussian about the scene's;
    None draws each component of the angular momentum as the scene's `launch.angular_momentum` says, from {seed, low,
    high}: the paper's. seed: of the generator. Raises InputError for values out of range.
    """

    orientation: str = "uniform"
    velocity_spread: float = 0.0
    spin_spread: float | None = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        validation.choice("launches.orientation", self.orientation, ORIENTATIONS)
        for key, unit in (("velocity_spread", "m/s"), ("spin_spread", "rad/s")):
            if getattr(self, key) is not None:
                value = validation.number(f"launches.{key}", getattr(self, key), unit, at_least=0)
                object.__setattr__(self, key, value)
        object.__setattr__(self, "seed", validation.count("launches.seed", self.seed, at_least=0))

    def draw(self, scene: Scene, count: int, first: int = 0) -> States:
        """Return launches number `first` to `first + count` of a scene, STATE records of shape (count,).

        Raises InputError where a node is below the ground at the launch, and for a spin that the scene does not tell.
        """
        blocks = range(first // BLOCK, -(-(first + count) // BLOCK))
        drawn = np.concatenate([self._block(scene, block) for block in blocks])
        launches = drawn[first - blocks.start * BLOCK :][:count]
        lowest = (launches["position"][:, 2:] + launches["node_offset"][:, :, 2]).min()
        if not lowest > 0:
            raise InputError(
                f"launch.position = {list(scene.launch.position)}: a launch has a node {-lowest:.3g} m below the "
                "ground; allowed is a place from which every orientation clears it"
            )
        return launches

    def _block(self, scene: Scene, block: int) -> States:
        random = np.random.default_rng([self.seed, block])
        launches = np.repeat(start_of(scene, "tumbling"), BLOCK)
        quaternions = random.standard_normal((BLOCK, 4))  # whose directions, and so rotations, are all as likely
        turns = matrices(quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True))
        if self.orientation == "uniform":
            launches["node_offset"] = np.einsum("kij,nj->kni", turns, scene.cube.node_offsets())
        launches["velocity"] += self.velocity_spread * random.standard_normal((BLOCK, 3))
        launches["angular_momentum"], launches["angular_velocity"] = self._spins(scene, launches, random)
        return launches

    def _spins(self, scene: Scene, launches: States, random: np.random.Generator) -> tuple[Array, Array]:
        """Return angular momenta [kg m²/s] and spins [rad/s], shape (launch, 3) each."""
        tensors = turned_tensor(scene.cube, launches["node_offset"])
        drawn, mean = scene.launch.angular_momentum, np.array(scene.launch.spin)
        if self.spin_spread is None:
            if not isinstance(drawn, RandomSpin):
                raise InputError("launches.spin_spread is null: state launch.angular_momentum as {seed, low, high}")
            momenta = drawn.low + (drawn.high - drawn.low) * random.random((BLOCK, 3))
            return momenta, np.asarray(np.linalg.solve(tensors, momenta[..., None])[..., 0])
        about = np.linalg.solve(turned_tensor(scene.cube, start_of(scene, "tumbling")["node_offset"][0]), mean)
        spins = about + self.spin_spread * random.standard_normal((BLOCK, 3))
        return (tensors @ spins[..., None])[..., 0], spins

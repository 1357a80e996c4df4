"""Steps of two boxes: apart, beside those of two single cubes; in contact; and a whole meeting, flights at once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.case import Case, Effort
from stiffdice.dynamics.box_contact.pair_state import Pairs, pair_physics_of, pair_start_of
from stiffdice.dynamics.models import pair, tumbling
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.integrators import registry as schemes
from stiffdice.scene.pair import PairScene, from_mapping
from stiffdice.simulation.pair.run import simulate_pair

STEPS, MEMBERS = 100_000, 64


def two_cubes(place: list[float], turn: list[float]) -> PairScene:
    """Return two cubes above the ground, the second at a place [m] from the first, turned so [rad]."""
    launch = {"position": [0, 0, 5], "velocity": [0, 0, 0], "angular_momentum": [0.1, 0.05, 0]}
    other = {"position": [place[0], place[1], 5 + place[2]], "velocity": [0, 0, -1], "orientation": turn}
    cubes = [{"cube": {"side": 1.0}, "launch": part} for part in (launch, other)]
    return from_mapping({"cubes": cubes, "ground": {"stiffness": 1e4}, "gravity": 0, "duration": 2})


def cases(effort: Effort) -> Iterator[Case]:
    """Yield the steps of a pair apart and of two cubes alone, of a pair in contact, and whole meetings."""
    scheme, apart = schemes.SCHEMES["symplectic_euler"], two_cubes([3, 0, 3], [0.5, -0.2, 0.8])
    flush = two_cubes([0.1, 0.2, 0.999], [0, 0, 0.3])
    steps = min(STEPS, 2_000 * effort.members)

    def of_pair(scene: PairScene, h: float) -> None:
        samples = np.repeat(pair_start_of(scene), 2)
        schemes.advance(scheme, pair.TAG, pair_physics_of(scene), samples, steps, h, schemes.TOLERANCE)

    def of_two() -> None:
        for part in apart.parts:
            samples = np.repeat(start_of(part, "tumbling"), 2)
            schemes.advance(scheme, tumbling.TAG, physics_of(part), samples, steps, 1e-7, schemes.TOLERANCE)

    for name, what, run in (
        ("pair_two_alone", "two cubes in the air, one after the other", of_two),
        ("pair_apart", "two cubes in the air, as a pair", lambda: of_pair(apart, 1e-7)),
        ("pair_contact", "a pair in contact, face to face, twisted", lambda: of_pair(flush, 0.0)),
    ):
        yield Case(f"{name}_step", what, "step", steps, lambda run=run: run, effort.rounds, "")  # type: ignore[misc]
    meeting, members = two_cubes([0.2, 0.1, 4], [0.5, -0.2, 0.8]), min(MEMBERS, effort.members)
    yield Case(
        "pair_meeting",
        f"{members} meetings of two cubes, 20,000 steps each, flights at once",
        "step",
        members * 20_000,
        lambda: lambda: simulate_pair(meeting, steps=20_000, launches=_spread(meeting, members)),
        effort.rounds,
        "what of a sweep is not flight",
    )


def _spread(scene: PairScene, members: int) -> Pairs:
    states = np.repeat(pair_start_of(scene), members)
    states["b"]["position"][:, 0] += np.linspace(0, 0.3, members)
    return states

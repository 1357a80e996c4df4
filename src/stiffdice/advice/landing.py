"""Steps for the faces of a die: as coarse as the distribution of faces allows, whatever becomes of the paths."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass

from stiffdice.errors import InputError
from stiffdice.integrators import linear_stability
from stiffdice.scene import validation
from stiffdice.scene.scene import Scene
from stiffdice.simulation.landing import BATCHED, MODEL, faces_of

# By total variation: the part of the linear stability limit up to which the faces' distribution is within it, with a
# margin. `make landing` found that it grows in proportion to steps, to 0.0033 at 0.4 of the limit
# (docs/explanation/dice.md).
LONGEST = {0.003: 0.3, 0.001: 0.1}


@dataclass(frozen=True)
class LandingAdvice:
    """Steps that keep the distribution of faces.

    error [1]: total variation to that of short steps. steps: to the scene's duration. omega_h [1]: of the fastest
    contact. part: of that at which the contact is linearly unstable. contact: which that is.
    """

    error: float
    scheme: str
    steps: int
    omega_h: float
    part: float
    contact: str

    def as_json(self) -> str:
        """Return it as JSON."""
        return json.dumps(asdict(self), indent=2)

    def lines(self, duration: float) -> list[str]:
        """Return what to tell of it."""
        return [
            f"scheme    {self.scheme}",
            f"steps     {self.steps} to {duration:g} s, at most: a throw ends as soon as its face is decided",
            f"error     at most {self.error:g} of total variation of the faces' distribution; single paths are lost",
            f"evidence  ωh = {self.omega_h:.2g} of the fastest contact ({self.contact}), {self.part:.0%} of its linear "
            "limit; docs/explanation/dice.md has the scan",
        ]


def advise(scene: Scene, error: float) -> LandingAdvice:
    """Return the steps at which the distribution of a die's faces is within a total variation [1].

    Raises InputError for an error below what was measured, and for ground on which nothing comes to rest.
    """
    asked = validation.number("error", error, "1", above=0)
    fitting = [bound for bound in LONGEST if bound <= asked]
    if not fitting:
        raise InputError(
            f"error = {asked:g}: allowed for a landing is a total variation of {min(LONGEST):g} or more [1]"
        )
    faces_of(scene)
    bound = max(fitting)
    hardest = linear_stability.hardest(scene, MODEL)
    if hardest.omega == 0:
        raise InputError(
            f"ground.stiffness = {scene.ground.stiffness:g}: a die comes to rest on ground above 0 [kg/s²]"
        )
    fewest = max(linear_stability.fewest_steps(scene, MODEL, BATCHED))
    steps = math.ceil(fewest / LONGEST[bound])
    omega_h = hardest.omega * scene.duration / steps
    return LandingAdvice(bound, BATCHED, steps, omega_h, LONGEST[bound], hardest.mode)

"""What `advise` returns: options, and the one to take."""

from __future__ import annotations

from dataclasses import dataclass

from stiffdice.advice.pilot import Trial
from stiffdice.scene.scene import Scene

MEASURED, EXTRAPOLATED, THEORY = "measured", "extrapolated", "theory"


@dataclass(frozen=True)
class Option:
    """One way to compute the scene.

    scheme: of the time steps. steps: their number. tolerance [1]: of a scheme that controls its own error, else None.
    error [radii]: expected; None if nothing is known. basis: `measured`, `extrapolated` or `theory` (no run says
    anything; steps are those of the stability limit, and not enough). evaluations [1]: of the force. seconds [s]:
    about, of the time loop. omega_h [1]: of the fastest contact; None for a scheme that takes its own steps. limit [1]:
    up to which omega_h the scheme is stable. keeps: whether the requested error is expected to be met. evidence: a
    sentence.
    """

    scheme: str
    steps: int
    tolerance: float | None
    error: float | None
    basis: str
    evaluations: float
    seconds: float
    omega_h: float | None
    limit: float | None
    keeps: bool
    evidence: str

    @property
    def margin(self) -> float | None:
        """How many times shorter than the stability limit its steps are; infinite without a limit, None if moot."""
        if self.omega_h is None or self.limit is None or self.omega_h == 0:
            return None
        return self.limit / self.omega_h


@dataclass(frozen=True)
class Advice:
    """What to do. `scene` ends at the horizon; errors and times are for runs that end there.

    scene: to compute. asked [radii]: the error. duration [s]: of the scene as given. horizon [s]: until when the error
    is promised. cut: why it is shorter than asked, or nothing. model: the least that is exact for the scene.
    model_reason: why. best: the option advised, None if none keeps the error. options: quickest first, those that keep
    the error before those that do not. floor [radii]: how well the path is known. paths: runs as good as exact, by the
    methods that are compared. landings: how many. growth [1]: of an error from after the first landing to the end, None
    with fewer than two. mode: the fastest contact. outside: where the scene is out of the studied range, a sentence
    each.
    """

    scene: Scene
    asked: float
    duration: float
    horizon: float
    cut: str
    model: str
    model_reason: str
    best: Option | None
    options: tuple[Option, ...]
    floor: float
    paths: tuple[Trial, ...]
    landings: int
    growth: float | None
    mode: str
    outside: tuple[str, ...]

    @property
    def growth_per_landing(self) -> float | None:
        """By how much a landing multiplies an error [1], on average."""
        return None if self.growth is None else self.growth ** (1 / (self.landings - 1))

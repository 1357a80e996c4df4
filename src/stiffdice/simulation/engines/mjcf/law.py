"""The law of a MuJoCo contact along its normal, and what the scheme makes of one bounce on it.

From MuJoCo's documentation, "Computation: solver parameters". A contact at the clearance r < 0 that opens at the rate v
asks for the acceleration a_ref = −b·v − K·d(r)·r. A force f >= 0 gives it A·f, and a regulariser R resists:
(A + R)·f = a_ref − a_0, where a_0 is the acceleration without the force. With the pull p = −a_0 towards the ground,

    r'' = −p + d_eff·max(0, p − b·v − K·d·r),    d_eff = A/(A + R).

- `solref` = (timeconst, dampratio): b = 2/(d_max·timeconst), K = 1/(d_max·timeconst·dampratio)²; and with two numbers
  below zero (−stiffness, −damping): b = damping/d_max, K = stiffness/d_max². Unless `refsafe` is off, timeconst is at
  least two time steps.
- `solimp` = (d_min, d_max, width, midpoint, power): the impedance d(r).
- R = W·(1 − d)/d. W is the compiler's guess of A from `body_invweight0`, not A; and of a friction pyramid of 2(n − 1)
  edges, all with the same force in a landing straight down, W is multiplied by (1 + µ²)·µ²/(impratio·(n − 1)).

So ω² = d_eff·K·d and 2ζω = d_eff·b, and at constant d the contact is the damped spring that cannot pull of
`scene.flat_landing`, which has its restitution in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

from stiffdice.scene import flat_landing

# Of impedances, and of their sigmoid's midpoint: mjMINIMP, mjMAXIMP.
LEAST, MOST = 1e-4, 0.9999
# What a bounce may take, in durations of its linear contact and in steps; a body that is still down then rests.
DURATIONS, STEPS = 6.0, 50
# Of the speed of a landing: a body that opens its contact as slowly as this, and ever more slowly, stays down.
STILL = 1e-3


@dataclass(frozen=True)
class Law:
    """One contact's law, or that of several alike that share the load.

    solref [s, 1] or [1/s², 1/s]; solimp [1, 1, m, 1, 1]; softness [1]: W/A; pull [m/s²]: p; mass [kg]: effective, 1/A;
    refsafe: whether timeconst is at least two steps; timestep [s]; rk4: whether the scheme is RK4, else it is
    semi-implicit Euler as far as contacts go.
    """

    solref: tuple[float, float]
    solimp: tuple[float, float, float, float, float]
    softness: float
    pull: float
    mass: float
    refsafe: bool
    timestep: float
    rk4: bool = False

    def at(self, timestep: float) -> Law:
        """Return the law at another time step [s]."""
        return replace(self, timestep=timestep)

    @property
    def timeconst(self) -> float:
        """The time constant [s] that counts; infinite where `solref` is direct."""
        if not self.solref[0] > 0:
            return math.inf
        return max(self.solref[0], 2 * self.timestep) if self.refsafe else self.solref[0]

    @property
    def is_slowed(self) -> bool:
        """Whether the time step, by `refsafe`, makes the contact softer than it is written."""
        return self.solref[0] > 0 and self.timeconst > self.solref[0]

    @cached_property
    def reference(self) -> tuple[float, float]:
        """The numbers K [1/s²] and b [1/s]."""
        most = _within(self.solimp[1])
        if self.solref[0] > 0:
            return (most * self.timeconst * self.solref[1]) ** -2, 2 / (most * self.timeconst)
        return -self.solref[0] / most**2, -self.solref[1] / most

    def impedance(self, depth: float) -> float:
        """Return d [1] at a depth [m]."""
        low, high, width, middle, power = self.solimp
        low, high, middle, power = _within(low), _within(high), _within(middle), max(1.0, power)
        if low == high or width <= 1e-15:
            return (low + high) / 2
        x = min(1.0, abs(depth) / width)
        y = x**power / middle ** (power - 1) if x <= middle else 1 - (1 - x) ** power / (1 - middle) ** (power - 1)
        return low + y * (high - low)

    @property
    def is_constant(self) -> bool:
        """Whether d is the same at all depths."""
        return _within(self.solimp[0]) == _within(self.solimp[1]) or self.solimp[2] <= 1e-15

    def share(self, impedance: float) -> float:
        """Return d_eff [1] at an impedance d [1]."""
        return 1 / (1 + self.softness * (1 - impedance) / impedance)

    def frequency(self, depth: float) -> float:
        """Return ω [1/s] at a depth [m]."""
        d = self.impedance(depth)
        return math.sqrt(self.share(d) * self.reference[0] * d)

    def damping_ratio(self, depth: float) -> float:
        """Return ζ [1] at a depth [m]; infinite without stiffness."""
        omega = self.frequency(depth)
        twice = self.share(self.impedance(depth)) * self.reference[1]
        return twice / (2 * omega) if omega > 0 else math.inf

    def stiffness(self, depth: float) -> float:
        """Return the effective stiffness [N/m] at a depth [m]."""
        return self.mass * self.frequency(depth) ** 2

    def damping(self, depth: float) -> float:
        """Return the effective damping [N s/m] at a depth [m]."""
        return self.mass * self.share(self.impedance(depth)) * self.reference[1]

    def restitution(self, depth: float) -> float:
        """Return e [1] of a landing without gravity, as steps become short, by the spring at a depth [m]."""
        zeta = self.damping_ratio(depth)
        return math.exp(-flat_landing.loss("gated", zeta)) if math.isfinite(zeta) else 0.0

    def duration(self, depth: float) -> float:
        """Return how long a contact lasts [s], by the spring at a depth [m]; infinite without one."""
        omega = self.frequency(depth)
        return flat_landing.duration("gated", self.damping_ratio(depth)) / omega if omega > 0 else math.inf

    def rest_depth(self) -> float:
        """Return how deep the body rests [m], where d_eff·K·d·depth = (1 − d_eff)·p; infinite without a spring."""
        if self.pull <= 0:
            return 0.0
        if not self.reference[0] > 0:
            return math.inf
        low, high = 0.0, 1.0
        while self._lift(high) < self.pull:
            low, high = high, 2 * high
        for _ in range(100):
            middle = (low + high) / 2
            low, high = (middle, high) if self._lift(middle) < self.pull else (low, middle)
        return high

    def _lift(self, depth: float) -> float:
        """Return the acceleration [m/s²] by the contact of a body that stands still at a depth [m]."""
        return self._acceleration(-depth, 0.0) + self.pull

    def _acceleration(self, clearance: float, rate: float) -> float:
        """Return r'' [m/s²]. clearance [m]: r; rate [m/s]: v."""
        if clearance >= 0:
            return -self.pull
        d = self.impedance(clearance)
        stiffness, damping = self.reference
        return self.share(d) * max(0.0, self.pull - damping * rate - stiffness * d * clearance) - self.pull

    def step(self, clearance: float, rate: float) -> tuple[float, float]:
        """Return clearance [m] and rate [m/s] a time step later, by the model's scheme."""
        h, a = self.timestep, self._acceleration
        if not self.rk4:
            rate += h * a(clearance, rate)
            return clearance + h * rate, rate
        v1, a1 = rate, a(clearance, rate)
        v2, a2 = rate + h / 2 * a1, a(clearance + h / 2 * v1, rate + h / 2 * a1)
        v3, a3 = rate + h / 2 * a2, a(clearance + h / 2 * v2, rate + h / 2 * a2)
        v4, a4 = rate + h * a3, a(clearance + h * v3, rate + h * a3)
        return clearance + h / 6 * (v1 + 2 * v2 + 2 * v3 + v4), rate + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)

    @property
    def lag(self) -> float:
        """How much [s] a velocity of the scheme lags its place: in flight v²/2 + p·(r − lag·v) is kept."""
        return 0.0 if self.rk4 else self.timestep / 2

    def square_of_speed(self, clearance: float, rate: float) -> float:
        """Return the square of the speed [m²/s²] that a flight has at the surface."""
        return rate * rate + 2 * self.pull * (clearance - self.lag * rate)

    def longest(self, depth: float) -> int:
        """Return the steps after which a body that still touches is taken to rest."""
        duration = self.duration(depth)
        return STEPS + math.ceil(min(DURATIONS * duration / self.timestep, 1e5)) if duration < math.inf else STEPS

    def bounce(self, speed: float, clearance: float, depth: float = 0.0) -> tuple[float, float]:
        """Return e [1] and the greatest depth [m] of one landing, step by step; e = 0 if it stays down.

        speed [m/s]: downwards at the launch; clearance [m] there; depth [m]: at which its duration is estimated.
        """
        r, v, deepest, arriving = clearance, -speed, 0.0, self.square_of_speed(clearance, -speed)
        for _ in range(self.longest(depth) + math.ceil(clearance / (speed * self.timestep))):
            former, (r, v) = v, self.step(r, v)
            deepest = max(deepest, -r)
            if not (math.isfinite(r) and math.isfinite(v)):
                return math.inf, math.inf
            if r >= 0 and v > 0:
                return math.sqrt(max(0.0, self.square_of_speed(r, v)) / arriving), deepest
            if 0 < v < min(former, STILL * speed):
                break
        return 0.0, deepest


def _within(value: float) -> float:
    return min(MOST, max(LEAST, value))

"""The scheme `exact` against 40 digits, SciPy, the paper's scheme, and itself."""

from __future__ import annotations

import dataclasses
import itertools
import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mpmath import mpf
from scipy.integrate import solve_ivp

from stiffdice.dynamics import flat_bounce
from stiffdice.dynamics.energy import energies
from stiffdice.dynamics.state import physics_of, start_of
from stiffdice.errors import InputError
from stiffdice.integrators import registry as schemes
from stiffdice.integrators.exact import oscillator
from stiffdice.integrators.exact.oscillator import Oscillator, after, first_zero, response
from stiffdice.scene.cube import Cube
from stiffdice.scene.flat_landing import CONTACT_LAWS
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation import energy_budget
from stiffdice.simulation.run import simulate

HALF = Cube().side / 2
TILTED = (0.3, 0.5, 0.2)  # eight nodes at eight levels


def scene_of(
    contact="gated", stiffness=1e4, damping=0.2, friction=0.0, duration=10.0, gravity=9.8, normal=(0, 0, 1), **launch
):
    ground = {
        "stiffness": stiffness,
        "damping": damping,
        "friction": friction,
        "contact": contact,
        "normal": list(normal),
    }
    launch = {key: list(value) for key, value in launch.items()}
    return from_mapping({"ground": ground, "launch": launch, "gravity": gravity, "duration": duration})


def end_of(scene, steps=1, scheme="exact"):
    """Place and velocity at the end, shape (6,); every step taken one by one."""
    state = simulate(scene, model="sliding", scheme=scheme, steps=steps, every=steps).trajectory.state[-1]
    return np.concatenate([state["position"], state["velocity"]])


def growth_of(scene):
    """By how much the end moves for a launch that is higher, and one that is faster, by a little."""
    launch, end, nudge = scene.launch, end_of(scene), 1e-9
    higher = dataclasses.replace(launch, position=(*launch.position[:2], launch.position[2] + nudge))
    faster = dataclasses.replace(launch, velocity=(*launch.velocity[:2], launch.velocity[2] + nudge))
    moved = [np.abs(end_of(dataclasses.replace(scene, launch=other)) - end).max() for other in (higher, faster)]
    return max(1.0, *(move / nudge for move in moved))


class Reference:
    """The motion along the normal and along the ground in 40 digits, from the contact law of each node alone."""

    def __init__(self, scene):
        ground, state, physics = scene.ground, start_of(scene, "sliding")[0], physics_of(scene)
        self.normal = [mpf(part) for part in ground.normal]
        self.heights = [self.along(node) for node in state["node_offset"]]
        self.mass, self.stiffness, self.damping = mpf(scene.cube.mass), mpf(ground.stiffness), mpf(ground.damping)
        self.gravity, self.friction, self.cutoff = mpf(scene.gravity), mpf(ground.friction), mpf(physics.cutoff)
        self.pull, self.ungated = self.gravity * self.normal[2], ground.contact == "ungated"
        self.height, self.speed = self.along(state["position"]), self.along(state["velocity"])
        self.place = [mpf(float(x)) - self.height * n for x, n in zip(state["position"], self.normal, strict=True)]
        self.slide = [mpf(float(x)) - self.speed * n for x, n in zip(state["velocity"], self.normal, strict=True)]
        self.first = self.slip = mpmath.sqrt(sum(x * x for x in self.slide))
        self.time = self.way = mpf(0)

    def along(self, vector):
        return sum(n * mpf(float(x)) for n, x in zip(self.normal, vector, strict=True))

    def feel(self, height, speed):
        """What each node feels: its spring and damping (2), damping alone (1), or nothing (0)."""
        depths = [-(height + low) for low in self.heights]
        drag = 1 if self.ungated and speed < 0 else 0
        return [2 * (self.stiffness * d > self.damping * speed) if d > 0 else drag for d in depths]

    def motion(self, felt):
        """The solution of a linear equation, by its roots in the complex plane."""
        height, speed = self.height, self.speed
        square, rate = self.stiffness * felt.count(2) / self.mass, self.damping * sum(map(bool, felt)) / self.mass
        below = sum(low for low, feels in zip(self.heights, felt, strict=True) if feels == 2)
        push = -self.pull - self.stiffness * below / self.mass
        if square == 0 and rate == 0:
            return lambda t: (height + speed * t + push * t * t / 2, speed + push * t)
        if square == 0:
            last = push / rate
            return lambda t: (
                height + last * t - (speed - last) * mpmath.expm1(-rate * t) / rate,
                last + (speed - last) * mpmath.exp(-rate * t),
            )
        root = mpmath.sqrt(mpmath.mpc(rate * rate / 4 - square))
        one, two, rest = -rate / 2 + root, -rate / 2 - root, push / square
        first = (speed - two * (height - rest)) / (one - two)
        second = height - rest - first

        def at(t):
            terms = first * mpmath.exp(one * t), second * mpmath.exp(two * t)
            return mpmath.re(sum(terms)) + rest, mpmath.re(one * terms[0] + two * terms[1])

        return at

    def run(self, until):
        """Look for a change of what the nodes feel in short steps, bisect it, and go on from there."""
        until, fast = mpf(until), 1 + mpmath.sqrt(8 * self.stiffness / self.mass)
        past = mpf(10) ** -30 / (fast + 8 * self.damping / self.mass)
        while self.time < until:
            felt = self.feel(self.height, self.speed)
            for _ in range(3):  # what it feels just after the last change
                at = self.motion(felt)
                felt, before = self.feel(*at(past)), felt
                if felt == before:
                    break
            low, step, left = past, 1 / fast / 100, until - self.time
            while low < left:
                high = min(left, low + step)
                if self.feel(*at(high)) != felt:
                    while high - low > past / 100:
                        middle = (low + high) / 2
                        low, high = (low, middle) if self.feel(*at(middle)) != felt else (middle, high)
                    break
                low, step = high, min(1.5 * step, 0.3 / fast if 2 in felt else mpf("0.02"))
            taken = min(high, left)
            self.slip_on(at, taken, any(felt))
            self.height, self.speed = at(taken)
            self.time += taken
        return self

    def slip_on(self, at, taken, pressed):
        if self.friction == 0 or self.slip == 0 or not pressed:
            self.way += self.slip * taken
            return
        slip, start = self.slip, self.speed

        def loss(t):
            return self.friction * (at(t)[1] - start + self.pull * t)

        def left(t):
            both = mpmath.log(slip / self.cutoff) + (slip - loss(t)) / self.cutoff
            x = mpmath.log(both - mpmath.log(both)) if both > 2 else min(both, (both - 1) / 2)
            for _ in range(30):
                step = (mpmath.exp(x) + x - both) / (mpmath.exp(x) + 1)
                x -= step
                if abs(step) < mpf(10) ** -22 * (1 + abs(x)):
                    break
            return self.cutoff * mpmath.exp(x)

        low, high = mpf(0), taken
        while high - low > mpf(10) ** -20 * taken:  # where it would stop without the cutoff
            middle = (low + high) / 2
            low, high = (middle, high) if loss(middle) < slip else (low, middle)
        closer = [mpf(2) ** -k for k in range(45)]
        points = {0, taken, *(taken * near for near in closer[:12])}
        points |= {end for near in closer for end in (high - high * near, high + (taken - high) * near)}
        with mpmath.workdps(20):
            self.way += mpmath.quad(left, sorted(points), method="gauss-legendre", maxdegree=3)
        self.slip = left(taken)

    def end(self):
        share, time = (self.slip / self.first, self.way / self.first) if self.first else (1, self.time)
        slope = [self.pull * n for n in self.normal]
        slope[2] -= self.gravity
        place = [
            p + s * time + g * self.time**2 / 2 + self.height * n
            for p, s, g, n in zip(self.place, self.slide, slope, self.normal, strict=True)
        ]
        velocity = [
            s * share + g * self.time + self.speed * n for s, g, n in zip(self.slide, slope, self.normal, strict=True)
        ]
        return [*place, *velocity]


def error_of(scene):
    with mpmath.workdps(40):
        expected = Reference(scene).run(scene.duration).end()
        return np.abs([float(mpf(float(found)) - value) for found, value in zip(end_of(scene), expected, strict=True)])


# Ends in flight, and in contact, where that lasts.
FALLS = [
    *[({"stiffness": S, "damping": 0.2}, 4.0) for S in (1e2, 1e4, 1e8, 1e12)],
    ({"stiffness": 1e12, "damping": 3e5}, 1.9),
    ({"stiffness": 1e4, "damping": 60.0}, 1.9),
    ({"stiffness": 1e3, "damping": 20.0}, 1.9),  # a face lets go below the ground, and presses again
    ({"stiffness": 1e4, "damping": 500.0}, 1.6),
    ({"stiffness": 1e2, "damping": 30.0}, 1.8),
    ({"stiffness": 1e4, "damping": 0.2}, 9.7),
    *[({"stiffness": S, "damping": 0.2, "orientation": TILTED}, 3.0) for S in (1e2, 1e4, 1e12)],
    ({"stiffness": 1e4, "damping": 60.0, "orientation": TILTED}, 3.0),
    ({"stiffness": 30.0, "damping": 12.0, "orientation": TILTED}, 3.0),  # all eight levels, and back
    ({"stiffness": 1e3, "damping": 1.0, "orientation": TILTED, "normal": (0.2, -0.1, 1)}, 3.0),
    ({"stiffness": 1e2, "damping": 0.3, "position": (0, 0, HALF), "velocity": (0, 0, 0)}, 2.0),  # settles
]


@pytest.mark.parametrize(("given", "duration"), FALLS)
@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.long
def test_the_motion_against_40_digits(contact, given, duration):
    """Speeds up to 10 m/s: units in the last place of 1e-15, which each bounce makes larger as it does a launch's.

    After 9.7 s and up to 36 bounces they add up.
    """
    scene = scene_of(contact, duration=duration, **given)
    assert error_of(scene).max() < (5e-15 if duration < 5 else 2e-14) * growth_of(scene)


SLIDES = [
    ({"stiffness": 1e4, "friction": 0.075}, (5, 0, 5), 4.0),
    ({"stiffness": 1e4, "friction": 0.3}, (0.6, 0.8, 5), 2.5),  # stops in the first bounce, and sticks
    ({"stiffness": 1e12, "friction": 0.3}, (1, 0, 5), 2.5),
    ({"stiffness": 1e4, "damping": 60.0, "friction": 0.3}, (5, 0, 5), 1.9),
    ({"stiffness": 1e4, "friction": 0.3}, (1e-7, 0, 5), 1.57),  # stuck from the beginning, which ends in contact
]


@pytest.mark.parametrize(("given", "velocity", "duration"), SLIDES)
@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.long
def test_a_slide_against_40_digits(contact, given, velocity, duration):
    scene = scene_of(contact, velocity=velocity, duration=duration, **given)
    error, path = error_of(scene), np.abs(end_of(scene)[:2]).max()
    assert error[[0, 1, 3, 4]].max() < 1e-14 * max(path, velocity[0])
    assert error.max() < 5e-15 * growth_of(scene)


TWO_LAWS_TWO_BRANCHES = list(itertools.product(CONTACT_LAWS, [1e3, 1e6, 1e12], [0.0, 0.01, 0.3, 0.999, 1.5, 5.0]))


@pytest.mark.parametrize(("contact", "stiffness", "zeta"), TWO_LAWS_TWO_BRANCHES)
def test_a_flat_bounce_has_the_exact_restitution(contact, stiffness, zeta):
    """From the surface at 10 m/s; until it has left, when its energy says how fast it left."""
    speed, damping = 10.0, zeta * math.sqrt(stiffness)
    scene = scene_of(contact, stiffness, damping, position=(0, 0, HALF), velocity=(0, 0, -speed))
    expected = flat_bounce.restitution(scene, speed)
    for duration in np.geomspace(1.5, 100, 30) / math.sqrt(4 * stiffness):
        end = end_of(dataclasses.replace(scene, duration=duration))
        clearance = end[2] - HALF
        if clearance > 0:
            break
    assert (clearance > 0) == (expected > 0)
    if expected > 0:
        assert math.sqrt(end[5] ** 2 + 2 * 9.8 * clearance) / speed == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(
    ("given", "most"),
    [
        ({"stiffness": 1e2, "friction": 0.075}, 1e-14),
        ({"stiffness": 1e4, "orientation": TILTED}, 1e-14),
        ({"stiffness": 1e4, "damping": 0.0}, 1e-14),
        # A place in contact, stored to half a unit in its last place, is as much as ω times that in the speed.
        ({"stiffness": 1e12, "orientation": TILTED}, 1e-10),
        ({"stiffness": 1e12, "damping": 3e5, "friction": 0.3}, 1e-10),
    ],
)
@pytest.mark.parametrize("contact", CONTACT_LAWS)
def test_how_the_time_is_split_changes_nothing(contact, given, most):
    """But for a rounding in each step, of numbers up to 20."""
    scene = scene_of(contact, duration=4.0, **given)
    whole, growth = end_of(scene), growth_of(scene)
    for steps in (7, 1_000, 50_000):
        np.testing.assert_allclose(end_of(scene, steps), whole, rtol=0, atol=(most + 2e-15 * steps) * growth)


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.long
def test_tiny_steps_through_a_contact(contact):
    """A hundred thousand steps of 1e-11 s on ground of 1e12 kg/s²: 2 radians in its spring."""
    deep = {"position": (0, 0, HALF - 1e-7), "velocity": (1, 0, -1)}
    scene = scene_of(contact, 1e12, 1e5, 0.3, duration=1e-6, **deep)
    end = end_of(scene, 100_000)
    np.testing.assert_allclose(end, end_of(scene), rtol=0, atol=2e6 * 1e-16 * 100_000**0.5)  # ω, half a unit, √steps


@pytest.mark.parametrize("contact", CONTACT_LAWS)
def test_swings_of_a_cube_that_rests_are_taken_at_once(contact):
    """Against a hundred thousand steps of a few swings each."""
    near = scene_of(contact, 1e8, 5.0, position=(0, 0, HALF - 3e-8), velocity=(0, 0, 0), duration=1.0)
    run = simulate(near, model="sliding", scheme="exact", steps=1)
    assert run.evaluations[0] < 30
    assert np.abs(end_of(near, 1000)[2] - end_of(near)[2]) < 3e-16
    assert end_of(near)[2] - HALF == pytest.approx(-9.8 / 4e8, rel=1e-7)
    forever = dataclasses.replace(near.with_ground(stiffness=1e300), duration=10.0)
    laid = dataclasses.replace(forever, launch=dataclasses.replace(near.launch, position=(0, 0, HALF)))
    assert simulate(laid, model="sliding", scheme="exact", steps=1).evaluations[0] < 100


def test_swings_of_a_cube_that_slides_are_taken_at_once():
    """3·10⁴ swings about the height of rest; in quarters all of them are computed, and each rounds, alike."""
    near = {"position": (0, 0, HALF - 9.8 / 4e12 - 1e-12), "velocity": (100, 0, 0)}
    scene = scene_of("gated", 1e12, 0.0, 0.075, duration=0.1, **near)
    once = simulate(scene, model="sliding", scheme="exact", steps=1)
    each = simulate(scene, model="sliding", scheme="exact", steps=4)
    assert once.evaluations[0] < 30
    assert each.evaluations[0] > 60_000
    np.testing.assert_allclose(once.end["position"][0, 0], each.end["position"][0, 0], rtol=1e-12)
    np.testing.assert_allclose(once.end["velocity"][0, 0], each.end["velocity"][0, 0], rtol=1e-12)


@pytest.mark.parametrize("contact", CONTACT_LAWS)
def test_energy_is_lost_to_damping_drag_and_friction_alone(contact):
    """The works that the ledger adds up along the exact path are its loss of energy, but for steps of a touch-down."""
    scene = scene_of(contact, 1e3, 0.2, 0.1, duration=4.0, orientation=TILTED)
    for steps in (10_000, 100_000):
        run = energy_budget.ledger(scene, model="sliding", scheme="exact", steps=steps).data_vars
        assert sum(run[name].values for name in ("damping_work", "drag_work", "friction_work")) < -10
        assert abs(run["scheme_work"].values) < 40 * 4.0 / steps


@pytest.mark.parametrize("contact", CONTACT_LAWS)
def test_scipy_agrees(contact):
    """DOP853 on the sum of the node forces, over two sliding bounces."""
    scene = scene_of(contact, 1e3, 0.5, 0.1, velocity=(5, 1, 2), duration=3.0)
    physics, offsets = physics_of(scene), start_of(scene, "sliding")["node_offset"][0]

    def rate(_, y):
        depth, speed = -(y[2] + offsets[:, 2]), y[5]
        push = np.maximum(0, 1e3 * np.maximum(0, depth) - 0.5 * speed)
        push = push.sum() if contact == "ungated" else push[depth > 0].sum()
        grip = 0.1 * push / (math.hypot(y[3], y[4]) + physics.cutoff)
        return [*y[3:], -grip * y[3], -grip * y[4], push - 9.8]

    start = [*scene.launch.position, *scene.launch.velocity]
    found = solve_ivp(rate, (0, 3.0), start, method="DOP853", rtol=1e-12, atol=1e-13, max_step=2e-3).y[:, -1]
    assert math.hypot(*end_of(scene)[3:5]) > 0.5
    np.testing.assert_allclose(end_of(scene), found, rtol=0, atol=2e-9)


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.long
def test_the_papers_scheme_converges_to_it(contact):
    scene = scene_of(contact, 1e4, 0.2, 0.075, duration=2.5)
    expected = end_of(scene)

    def error(steps):  # on average over the phase of the touch-downs
        each = [end_of(scene, int(steps * more), "symplectic_euler") for more in np.linspace(1, 1.1, 12)]
        return np.mean([np.abs(end - expected)[[0, 2]].max() for end in each])

    assert math.log10(error(10_000) / error(100_000)) == pytest.approx(1, abs=0.15)
    assert error(100_000) < 1e-3


@pytest.mark.long
def test_the_oscillator_on_all_sides_of_the_critical_damping():
    with mpmath.workdps(40):
        for omega, ratio, t in itertools.product(
            [1e-3, 1.0, 1e6], [0, 1e-9, 0.1, 0.9999, 1, 1 + 1e-12, 1.1, 1e3, 1e9], [1e-9, 0.1, 0.3, 0.7, 3.0, 30.0]
        ):
            beta, time = ratio * omega, t / omega
            b, w, s = mpf(beta), mpf(omega), mpf(time)
            root = mpmath.sqrt(mpmath.mpc(b * b - w * w))
            one = mpmath.re(mpmath.exp(-b * s) * (mpmath.sinh(root * s) / root if root else s))
            slope = mpmath.re(mpmath.exp(-b * s) * mpmath.cosh(root * s)) - b * one
            both = (1 - slope - 2 * b * one) / w**2
            found = response(omega, beta, time)
            assert found[0] == pytest.approx(float(one), rel=1e-14, abs=2e-16 * t * min(time, 1 / omega))
            assert found[1] == pytest.approx(float(both), rel=2e-15, abs=3e-16 * max(0, t - 1) / omega**2)
            assert found[2] == pytest.approx(float(slope), rel=1e-14, abs=4e-16 * (1 + t))


# Below the normal doubles there are no twelve digits.
NUMBERS = st.floats(-1, 1).map(lambda x: x if abs(x) > 1e-280 else 0.0)


@given(
    st.floats(-3, 3).map(lambda x: 10**x),
    st.one_of(st.just(0.0), st.floats(-3, 3).map(lambda x: 10**x)),
    NUMBERS,
    NUMBERS,
)
def test_the_first_zero_of_the_speed_is_one_and_the_first(omega, beta, speed, pace):
    push = pace + 2 * beta * speed
    motion, t = Oscillator(omega, beta, push, speed), first_zero(omega, beta, speed, pace)
    assert t >= 0
    scale = abs(speed) + abs(push) / (omega + beta)
    if t < math.inf:
        assert abs(after(motion, t)[1]) <= 1e-12 * scale
    for part in np.linspace(0.01, 0.99, 12):
        then = after(motion, part * min(t, 10 / omega))[1]
        sign = speed if speed else pace
        assert then * sign >= -1e-12 * scale


@pytest.mark.parametrize("speed", [1e-12, 1e-7, 1e-6, 3e-4, 5.0])
@pytest.mark.parametrize("part", [1e-9, 0.1, 0.49, 0.51, 0.999999, 1.0, 1.00001, 2.0])
def test_friction_slows_as_lamberts_function_says(speed, part):
    cutoff = 1e-6
    loss = part * (speed + cutoff)
    with mpmath.workdps(40):
        ratio = mpf(speed) / mpf(cutoff)
        left = mpf(cutoff) * mpmath.lambertw(ratio * mpmath.exp((mpf(speed) - mpf(loss)) / mpf(cutoff))).real
        z = float(mpmath.log(mpf(speed) / left))
    # What rounding the loss does to it.
    close = 4e-16 * (1 + z + loss / (float(left) + cutoff))
    assert oscillator.slowed(speed, cutoff, loss) == pytest.approx(z, rel=4e-16, abs=close if part > 1e-3 else 0)


def test_a_stuck_cube_ends_at_rest():
    assert oscillator.slowed(5.0, 1e-6, 1e9) == pytest.approx(1e15, rel=1e-8)
    assert oscillator.evenly(5.0, 1e-6, 0.7, 1e9)[0] == 0.0
    assert oscillator.evenly(5.0, 1e-6, 0.7, 1e9)[1] == pytest.approx(25 / 1.4, rel=1e-6)


sizes = st.one_of(st.just(0.0), st.floats(-4, 14).map(lambda exponent: 10**exponent))
vectors = st.tuples(*[st.floats(-5, 5)] * 3)


@settings(max_examples=150)
@given(
    st.sampled_from(list(CONTACT_LAWS)),
    sizes,
    st.one_of(st.just(0.0), st.floats(-4, 8).map(lambda exponent: 10**exponent)),
    st.floats(0, 2),
    st.one_of(st.just((0, 0, 1)), vectors.filter(lambda normal: max(map(abs, normal)) > 0.1)),
    st.one_of(st.just((0, 0, 0)), vectors),
    vectors,
    st.floats(0.6, 3),
    st.floats(0, 30),
    st.floats(-6, 1).map(lambda exponent: 10**exponent),
)
def test_any_cube_keeps_going_and_gains_no_energy(
    contact, stiffness, damping, friction, normal, orientation, velocity, height, gravity, duration
):
    if normal != (0, 0, 1):
        friction = 0.0
    given = {"velocity": velocity, "position": (0, 0, height), "orientation": orientation}
    scene = scene_of(contact, stiffness, damping, friction, duration, gravity, normal, **given)
    run = simulate(scene, model="sliding", scheme="exact", steps=3, every=1)
    energy = sum(energies(physics_of(scene), run.trajectory.state))
    assert np.isfinite(energy).all()
    kinetic = run.trajectory.kinetic_energy.max()
    assert (np.diff(energy) <= 1e-12 * (1 + np.abs(energy[:-1]) + kinetic + 10 * gravity)).all()


@pytest.mark.parametrize("contact", CONTACT_LAWS)
@pytest.mark.parametrize(
    ("stiffness", "damping"), [(0, 0), (0, 1e300), (1e300, 0), (1e300, 1e300), (1e-300, 1e-3), (1e70, 1e170)]
)
@pytest.mark.parametrize("normal", [(0, 0, 1), (1, 0, 1), (1, 0, -0.1)])
def test_the_ends_of_the_range_of_doubles(contact, stiffness, damping, normal):
    """Gravity along the normal may even point away from the ground."""
    for gravity in (0.0, 9.8):
        for velocity in ((5, 0, 5), (-6, 0, -3), (0, 0, 0)):
            scene = scene_of(
                contact,
                stiffness,
                damping,
                duration=10.0,
                gravity=gravity,
                normal=normal,
                velocity=velocity,
                orientation=TILTED,
            )
            assert np.isfinite(end_of(scene)).all()


def test_round_off_takes_no_pieces():
    """A cube laid on stiff ground to a unit in the last place, and one whose huge forces cancel as it is let go."""
    laid = scene_of("ungated", 1e16, 0.2, position=(0, 0, np.nextafter(HALF, 1)), velocity=(0, 0, 0))
    normal = (0.5945496603283448, 0.04407802687850314, 0.04451823882945277)
    given = {"gravity": 0.39138431857361156, "duration": 0.04691705867068967, "normal": normal}
    given |= {"position": (0, 0, 0.5176380902050415), "velocity": (0, 0, -7.815327396051863)}
    stuck = scene_of("gated", 866978098210015.1, 3.8175137592110864e149, **given)
    for scene in (laid, stuck):
        run = simulate(scene, model="sliding", scheme="exact", steps=1)
        assert run.evaluations[0] < 100
        assert np.isfinite(run.end["position"]).all()


@pytest.mark.parametrize(
    ("changes", "model", "told"),
    [
        ({}, "tumbling", r"scheme = exact, model = tumbling: allowed is a model that does not turn.* event"),
        (
            {"friction": 0.3, "normal": (1, 0, 2)},
            "sliding",
            r"ground.friction = 0.3, ground.normal = \[0.447214, 0, 0.894427\]: allowed is friction 0, or .* event",
        ),
    ],
)
def test_it_says_what_it_is_not_for(changes, model, told):
    scene = scene_of(**changes)
    for refuse in (simulate, energy_budget.ledger):
        with pytest.raises(InputError, match=told):
            refuse(scene, model=model, scheme="exact", steps=10)
    assert schemes.unfit("exact", scene, model)
    assert schemes.unfit("symplectic_euler", scene, model) is None
    assert schemes.unfit("exact", scene_of(friction=0.3, normal=(1, 0, 2), gravity=0), "sliding") is None

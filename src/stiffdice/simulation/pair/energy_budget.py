"""Where the energy of two boxes goes, body by body: into weight, ground, and the springs, damping, friction of contact.

Each step of symplectic Euler kicks both bodies by the forces before it, an impulse h f, and that changes the kinetic
energy by h f·ū exactly, ū being the mean of the velocities stored before and after the step; so does the impulse of a
torque that of a cube, whose spin is L/I however it is turned. So the works of all forces on a cube add up to what its
kinetic energy gains, to round-off. What is left, `kick_defect`, is that round-off; for a box of unequal moments it also
has the error of its free turning. Other schemes have no such sum of forces that are known before and after a step.

Both together: kinetic energy (of the velocity at the stored place, u − g h/2 ẑ), potential energy, and that in the
springs of the ground and between the boxes change by the works of damping and friction, and by the scheme's: what the
springs' force worked less what the springs gave up, the same of gravity, and the kick's defect.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from stiffdice.dynamics import energy
from stiffdice.dynamics.box_contact import law
from stiffdice.dynamics.box_contact.overlap import CONTACT, MOST
from stiffdice.dynamics.box_contact.pair_state import PairPhysics, Pairs, are_near, pair_physics_of, pair_start_of
from stiffdice.dynamics.compilation import njit
from stiffdice.dynamics.contact import Wrench
from stiffdice.dynamics.inertia import spin_of
from stiffdice.dynamics.models.pair import TAG as PAIR_TAG
from stiffdice.dynamics.state import Array, Physics
from stiffdice.dynamics.vector import vector
from stiffdice.integrators.symplectic_euler import LAG, TAG, step
from stiffdice.io.plain_dataset import PlainDataset, PlainVariable
from stiffdice.scene import validation
from stiffdice.scene.pair import PairScene
from stiffdice.simulation import energy_budget
from stiffdice.simulation.pair.flight import fly

BOOKED = "symplectic_euler"

# Forces on a body, with what their works are; and what is left of the kinetic energy that it gained.
WORKS = {
    "gravity_work": "work of the weight",
    "ground_spring_work": "work of the springs of the ground",
    "ground_damping_work": "work of the damping of the ground",
    "ground_friction_work": "work of the friction of the ground",
    "contact_spring_work": "work of the springs between the cubes",
    "contact_damping_work": "work of the damping between the cubes",
    "contact_friction_work": "work of the friction between the cubes",
    "kick_defect": "kinetic energy gained less all these works: the scheme's",
}
_WEIGHT, _GROUND, _CONTACT, _KICK = 0, 1, 4, 7

# Of both bodies: what the ledger of one body tells of it, too. The sum of the last three is `scheme_work`.
TOTALS = {
    "damping_work": "work of all damping",
    "friction_work": "work of all friction",
    "spring_defect": "work of the springs' force less the energy that the springs gave up",
    "gravity_defect": "work of the weight less the potential energy given up, with what the velocity's lag makes of it",
    "kick_defect": "kinetic energy gained less the work of all forces",
}

# A pair as the ledger sees it. Of each body: force [N] and torque [N m] of each kind, motion: velocity [m/s] and L/I
# [rad/s], kinetic energy [J]. Of both [J]: potential energy; springs, of the ground and between them; lag: kinetic
# energy less that of the velocity at the stored place.
_VIEW = np.dtype(
    [
        ("forces", np.float64, (2, 7, 6)),
        ("motion", np.float64, (2, 6)),
        ("kinetic", np.float64, 2),
        *((name, np.float64) for name in ("potential", "springs", "lag")),
    ]
)


def ledger(scene: PairScene, *, steps: int = 10_000, every: int = 1, done: int | None = None) -> PlainDataset:
    """Run the scene's own launch by symplectic Euler and return where its energy went, as variables of a run's file.

    By time, after every K-th step as in the trajectory, sums since the launch: the WORKS on either body, dimensions
    time and cube, with its kinetic energy `body_kinetic_energy`; the TOTALS of both, with `scheme_work`, and
    `booked_energy`, which changes by damping_work + friction_work + scheme_work.

    done: how many steps the run made, where it ended early. Raises InputError for values out of range.
    """
    validation.count("steps", steps)
    every = validation.count("every", every, at_most=steps)
    count = steps if done is None else done
    physics = pair_physics_of(scene)
    views = np.zeros(count // every + 1, _VIEW)
    works = np.zeros((len(views), 2, len(WORKS)))
    defects = np.zeros((len(views), 2))
    pair = pair_start_of(scene)
    bare = physics._replace(a=physics.a._replace(node_weight=0.0), b=physics.b._replace(node_weight=0.0))
    _book((physics, bare), pair, (count, every), scene.duration / steps, (views, works, defects))
    return PlainDataset(_variables(views, works, defects), {}, {})


def _variables(views: npt.NDArray[np.void], works: Array, defects: Array) -> dict[str, PlainVariable]:
    both = works.sum(axis=1)
    kick = both[:, _KICK]
    damping, friction = (both[:, _GROUND + k] + both[:, _CONTACT + k] for k in (1, 2))
    totals = dict(zip(TOTALS, (damping, friction, defects[:, 0], defects[:, 1], kick), strict=True))
    whole = views["kinetic"].sum(axis=1) - views["lag"] + views["potential"] + views["springs"]
    by_body, by_time = ("time", "cube"), ("time",)
    described: dict[str, tuple[tuple[str, ...], Array, str]] = {
        f"body_{name}": (by_body, works[:, :, k], f"{text}, since the launch")
        for k, (name, text) in enumerate(WORKS.items())
    }
    described["body_kinetic_energy"] = by_body, views["kinetic"], "kinetic energy of a cube"
    described |= {name: (by_time, totals[name], f"{text}, since the launch") for name, text in TOTALS.items()}
    made = "energy that the scheme made, the sum of its defects, since the launch"
    described["scheme_work"] = by_time, defects.sum(axis=1) + kick, made
    told = "kinetic (of the velocity at the stored place), potential and elastic energy of both"
    described["booked_energy"] = by_time, whole, told
    return {
        name: PlainVariable(dimensions, values, {"long_name": text, "units": "J"})
        for name, (dimensions, values, text) in described.items()
    }


@njit(cache=True)
def _book(
    both_physics: tuple[PairPhysics, PairPhysics],
    pairs: Pairs,
    counts: tuple[int, int],
    h: float,
    books: tuple[npt.NDArray[np.void], Array, Array],
) -> None:
    """Take steps, and keep the view and the sums so far of every K-th.

    both_physics: to step in, and the same without the nodes' weight, by which forces are the ground's. counts: steps
    and K. books: views, works and defects.
    """
    (physics, bare), (steps, every), (views, works, defects) = both_physics, counts, books
    both = np.zeros(2, _VIEW)
    contacts = np.empty(2 * MOST, CONTACT)
    pair, work, defect = pairs[0], np.zeros(works.shape[1:]), np.zeros(2)
    _look(bare, pair, LAG * h, contacts, both[0])
    views[0] = both[0]
    done = looks = 0
    while done < steps:
        before, after = both[looks % 2], both[(looks + 1) % 2]
        taken = fly(TAG, physics, pair, h, min(every - done % every, steps - done))  # as the run does
        if taken == 0:
            taken = step(PAIR_TAG, physics, pair, h, 0.0)
        _look(bare, pair, LAG * h, contacts, after)
        _add(before, after, taken * h, work, defect)
        done, looks = done + taken, looks + 1
        if done % every == 0:
            k = done // every
            views[k], works[k], defects[k] = after, work, defect


@njit
def _look(physics: PairPhysics, pair: Any, late: float, contacts: Any, view: Any) -> None:
    """View a pair whose velocities are `late` [s]."""
    view.forces[:] = 0.0
    view.potential = view.springs = view.lag = 0.0
    _look_at(physics.a, pair.a, late, view, 0)
    _look_at(physics.b, pair.b, late, view, 1)
    if not are_near(physics, pair):
        return
    frame, least = law.overlap(physics, pair, contacts)
    if least.number == 0:
        return
    view.springs += 0.5 * physics.stiffness * least.square
    loads = law.loads_of(physics, pair, contacts, frame, least)
    _set(view.forces, _CONTACT, law.wrenches_of(pair, loads.spring, frame, least.box))
    _set(view.forces, _CONTACT + 1, law.wrenches_of(pair, loads.damping, frame, least.box))
    _set(view.forces, _CONTACT + 2, law.wrenches_of(pair, loads.friction, frame, least.box))


@njit
def _look_at(physics: Physics, state: Any, late: float, view: Any, body: int) -> None:
    """View one of the two bodies, and the ground's forces on it."""
    spin = spin_of(physics.body, physics, state, vector(state.angular_momentum))
    for axis in range(3):
        view.motion[body, axis], view.motion[body, 3 + axis] = state.velocity[axis], spin[axis]
    fall = physics.gravity * late
    view.kinetic[body] = energy.kinetic(physics, state)
    view.potential += energy.potential(physics, state)
    view.springs += energy.elastic(physics, state)
    view.lag += physics.mass * fall * (state.velocity[2] - 0.5 * fall)
    view.forces[body, _WEIGHT, 2] = -physics.weight
    ground = np.zeros((4, 6))
    energy_budget.feel(physics, state, ground)
    view.forces[body, _GROUND] = ground[energy_budget.SPRING]
    view.forces[body, _GROUND + 1] = ground[energy_budget.DAMPING]
    view.forces[body, _GROUND + 2] = ground[energy_budget.FRICTION]


@njit
def _set(forces: Any, kind: int, wrenches: tuple[Wrench, Wrench]) -> None:
    for axis in range(6):
        forces[0, kind, axis], forces[1, kind, axis] = wrenches[0][axis], wrenches[1][axis]


@njit
def _add(before: Any, after: Any, h: float, work: Array, defect: Array) -> None:
    """Add what happened in h [s] between two views: a step, or a flight under constant weight."""
    springs, gravity = 0.0, 0.0
    for body in range(2):
        gained = after.kinetic[body] - before.kinetic[body]
        for kind in range(_KICK):
            worked = 0.0
            for axis in range(6):
                mean = 0.5 * (before.motion[body, axis] + after.motion[body, axis])
                worked += h * before.forces[body, kind, axis] * mean
            work[body, kind] += worked
            gained -= worked
            if kind == _WEIGHT:
                gravity += worked
            elif kind in (_GROUND, _CONTACT):
                springs += worked
        work[body, _KICK] += gained
    defect[0] += springs - (before.springs - after.springs)
    defect[1] += gravity - (before.potential - after.potential) - (after.lag - before.lag)

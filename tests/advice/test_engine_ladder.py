"""An engine over a ladder of timesteps: measured as predicted, and the longest timestep that keeps what is asked."""

from __future__ import annotations

from functools import cache

import pytest

from stiffdice.advice import contact_design, engine_ladder
from stiffdice.advice.engine_ladder import Column, Ladder, Rung, climbed, timesteps
from stiffdice.errors import NotInstalledError
from stiffdice.simulation.engines import registry


def contact(restitution):
    given = {"restitution": restitution, "stiffness": 2000.0}
    return contact_design.designed(given, mass=0.005, side=0.016, speed=1.5, gravity=9.8)


def test_timesteps_are_round_and_one_may_be_added():
    found = timesteps(contact(0.5), 3.3e-5)
    assert found == sorted(found)
    assert {1e-5, 2e-5, 3.3e-5, 5e-5} <= set(found)
    assert all(0.003 <= 1264.9 * h <= 2 for h in found)


@pytest.mark.parametrize("restitution", [0.3, 0.9])
def test_mujoco_bounces_as_predicted_at_every_timestep(restitution):
    pytest.importorskip("mujoco")
    ladder = climbed("mujoco", contact(restitution))
    for rung in ladder.rungs:
        predicted, measured = (rung.found[Column(engine_ladder.PASTED, kind)] for kind in ("predicted", "measured"))
        assert measured == pytest.approx(predicted, rel=1e-5)


@cache
def lively(engine):
    """Return the ladder of an engine on a contact of restitution 0.9."""
    return climbed(engine, contact(0.9))


@pytest.mark.long
@pytest.mark.parametrize("engine", ["pybullet", "drake"])
def test_less_damping_makes_up_for_implicit_steps(engine):
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    wanted, ladder = contact(0.9), lively(engine)
    plain, less = (
        ladder.longest(Column(way, "measured"), "restitution_1", wanted.restitution)
        for way in (engine_ladder.DAMPING, engine_ladder.LESS)
    )
    assert less >= 5 * plain
    assert ladder.recommended(wanted) == less


@pytest.mark.long
def test_bullets_own_restitution_is_not_what_a_box_has():
    pytest.importorskip("pybullet")
    assert lively("pybullet").longest(Column(engine_ladder.RESTITUTION, "measured"), "restitution_5", 0.9) is None


def test_the_longest_timestep_is_below_the_first_that_fails():
    column = Column("a way", "measured")
    spreads = {1e-6: (0.5, 0.5), 2e-6: (0.49, 0.51), 5e-6: (0.4, 0.5), 1e-5: (0.5, 0.5), 2e-5: (0.0, 1.2)}
    ladder = Ladder("drake", "", True, [Rung(h, 0.0, {column: spread}) for h, spread in spreads.items()])
    assert ladder.longest(column, "restitution_5", 0.5) == 2e-6
    assert ladder.longest(column, "restitution_1", 0.5) == 1e-6
    assert ladder.longest(column, "energy", 0.5) == 1e-5
    assert ladder.longest(column, "restitution_1", 0.6) is None


def test_an_engine_that_is_not_installed_is_predicted_only(monkeypatch):
    def missing(method, key="simulator"):
        if method == "drake":
            raise NotInstalledError("simulator = drake: needs the package drake, which is not installed")
        return adapter_of(method, key)

    adapter_of = registry.adapter_of
    monkeypatch.setattr(registry, "adapter_of", missing)
    ladder = climbed("drake", contact(0.5))
    assert not ladder.installed
    assert "not installed" in ladder.version
    assert {column.kind for column in ladder.columns} == {"predicted"}
    assert ladder.recommended(contact(0.5)) > 0

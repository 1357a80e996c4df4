from __future__ import annotations

import csv
import io

import numpy as np
import pytest

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments import engines as experiments
from stiffdice.experiments.engines import OUTCOMES
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.writer import write_dataset
from stiffdice.report.tables import methods as tables
from stiffdice.scene.scene import from_mapping

SCENE = from_mapping(
    {"ground": {"damping": 0.1, "friction": 0.1}, "launch": {"angular_momentum": [0.3, 0.5, 0.2]}}, "as_written"
)
UNDAMPED = SCENE.with_ground(stiffness=1e6, damping=0.0)
METHODS = list(experiments.METHODS)


@pytest.fixture(scope="module")
def limits():
    return experiments.limits(UNDAMPED, omega_h=[0.02, 12.0], count=10, phases=4)


@pytest.fixture(scope="module")
def contact():
    return experiments.contact(SCENE, stiffness=[1e6], damping=[0.0, 10.0], phases=2)


@pytest.fixture(scope="module")
def throw():
    scene = from_mapping(SCENE.as_mapping() | {"duration": 2.0})
    return experiments.throw(scene, methods=["symplectic_euler", "numpy"], steps=4e5, samples=20)


@pytest.fixture(scope="module")
def speed():
    return experiments.speed(SCENE, methods=["symplectic_euler", "scipy", "numpy"], steps=600, rounds=1)


def of(found, method):
    return found.isel(method=meanings_of(found.method).index(method))


@pytest.mark.long
def test_numpy_and_we_fail_alike_and_scipy_does_not(limits):
    ours, theirs = of(limits, "symplectic_euler"), of(limits, "numpy")
    np.testing.assert_allclose(theirs.restitution, ours.restitution, rtol=1e-6)
    np.testing.assert_allclose(of(limits, "scipy").restitution, 1, atol=1e-6)
    worst = float(ours.restitution.sel(omega_h=3**0.5, method="nearest").max()) ** 2
    assert worst == pytest.approx(linear_theory.largest_gain(3**0.5), rel=0.01)


def test_the_scan_has_the_magic_steps_and_those_half_way(limits):
    for n in (1.5, 2, 2.5, 3):
        assert np.isclose(limits.omega_h, linear_theory.magic_step(n), rtol=1e-12).any()


def test_implicit_euler_loses_ever_more_and_then_keeps_the_cube(limits):
    found = of(limits, "implicit_euler")
    assert (np.diff(found.restitution.isel(phase=0).dropna("omega_h")) < 0).all()
    assert (found.outcome.isel(omega_h=-1) == OUTCOMES.index("stays")).all()
    short = found.isel(omega_h=0)
    np.testing.assert_allclose(short.restitution, np.exp(-np.pi * short.omega_h / 2), rtol=1e-3)


def test_a_cube_at_rest_is_shaken_off_beyond_the_limit_of_stability(limits):
    growth = of(limits, "symplectic_euler").rest_growth
    assert (growth[limits.omega_h < 1.9] < 10).all()
    assert (growth[limits.omega_h > 2.1] > 1000).all()
    assert (of(limits, "implicit_euler").rest_growth <= 1.01).all()


def test_our_own_contact_is_exact_but_for_the_step(contact):
    found = of(contact, "symplectic_euler")
    for name in experiments.RATIOS:
        np.testing.assert_allclose(found[name].isel(omega_h=1), 1, atol=2e-4, err_msg=name)
    for name in ("rest_depth", "rough_restitution"):
        np.testing.assert_allclose(of(contact, "scipy")[name], 1, atol=1e-6, err_msg=name)


def test_what_implicit_euler_loses_falls_with_the_step(contact):
    lost = 1 - of(contact, "implicit_euler").restitution.sel(damping=0.0)
    np.testing.assert_allclose(lost.isel(stiffness=0), 1 - np.exp(-np.pi * contact.omega_h / 2), rtol=0.02)


def test_a_cube_that_friction_stops_in_the_bounce_is_refused():
    with pytest.raises(InputError, match="4 mu"):
        experiments.contact(SCENE.with_ground(friction=0.2), methods=["symplectic_euler"], phases=1)


@pytest.mark.parametrize("engine", ["mujoco", "pybullet", "drake"])
def test_the_contact_of_an_engine_is_the_laws_but_for_the_step(engine):
    pytest.importorskip({"drake": "pydrake"}.get(engine, engine))
    found = experiments.contact(SCENE, methods=[engine], stiffness=[1e6], damping=[0.0], omega_h=[0.02], phases=1)
    found = found.squeeze()
    assert float(found.rest_depth) == pytest.approx(1, abs=1e-6)
    assert float(found.friction) == pytest.approx(1, abs=1e-6)
    assert float(found.contact_time) == pytest.approx(1, abs=1e-3)
    lost = 0.0 if engine == "mujoco" else np.pi * 0.02 / 2
    assert float(found.restitution) == pytest.approx(1 - lost, abs=2e-3)


@pytest.mark.long  # compiles the reference
def test_a_throw_comes_closer_with_the_step_and_numpy_is_as_far_as_we_are(throw):
    ours, theirs = of(throw, "symplectic_euler"), of(throw, "numpy")
    assert (ours.distance.isel(time=-1).values[:-1] > 2 * ours.distance.isel(time=-1).values[1:]).all()
    assert int(theirs.steps[-1]) * 500 == pytest.approx(int(ours.steps[-1]), rel=0.1)
    # Of first order in the step, both.
    scaled = [float(part.distance.isel(effort=-1, time=-1) * part.steps[-1]) for part in (ours, theirs)]
    assert scaled[0] == pytest.approx(scaled[1], rel=0.5)
    assert float(throw.reference_error.max()) < 1e-6
    away = throw.position.values - throw.reference_position.values
    np.testing.assert_allclose(throw.distance, np.sqrt((away**2).sum(axis=-1)), rtol=1e-12)


@pytest.mark.long
def test_steps_and_evaluations_are_counted(speed):
    assert of(speed, "numpy").taken.values.tolist() == [600, 600]
    assert (of(speed, "scipy").taken != 600).all()


@pytest.mark.long
def test_files_say_of_which_versions_engines_were(limits, contact, speed, tmp_path):
    for k, found in enumerate((limits, contact, speed)):
        assert f"numpy {np.__version__}" in found.attrs["engine_versions"]
        write_dataset(found, tmp_path / f"{k}.h5")


def test_limits_are_told_with_how_a_method_fails(limits):
    told = tables.engine_limits({"limits": limits}, "A title")
    rows = {row["method"]: row for row in csv.DictReader(io.StringIO(told.csv))}
    ours, implicit, scipy = (rows[name] for name in ("symplectic euler", "implicit euler", "SciPy LSODA"))
    (at_two,) = (name for name in ours if name.startswith("e at ωh = ") and float(name.split()[-1]) < 3)
    low, high = map(float, ours[at_two].split(" … "))
    assert low < 0.9
    assert high > 1.1
    assert float(implicit[at_two].split(" … ")[1]) < 0.5
    assert scipy[at_two] == "1 … 1"
    assert ours["leaves the ground"] == scipy["leaves the ground"] == "≥ 12"
    assert float(implicit["leaves the ground"]) < 12
    assert "Left out or not installed: MuJoCo, PyBullet, Drake, DART, GNU Octave." in told.markdown


def test_a_limit_is_the_last_before_the_first_failure():
    omega_h = np.array([0.1, 0.2, 0.4, 0.8])
    assert tables.limit_of(omega_h, np.array([True, True, False, True])) == (0.2, 0.4)
    assert str(tables.limit_of(omega_h, np.array([False, True, True, True]))) == "< 0.1"
    assert str(tables.limit_of(omega_h, np.ones(4, bool))) == "≥ 0.8"


def test_the_table_of_contacts_has_what_is_off_at_each_step(contact):
    told = csv.DictReader(io.StringIO(tables.engine_contact({"contact": contact}, "A title").csv))
    said = {(row["method"], row["D [kg/s]"]): row["restitution"].split(", ") for row in told}
    assert [abs(float(part.rstrip(" %"))) < 0.1 for part in said["symplectic euler", "0"]] == [True, True]
    shorter, longer = said["implicit euler", "0"]
    assert (shorter, longer[:3]) == ("−3.1 %", "−15")


def test_the_table_of_speeds_has_ratios_to_ours(speed):
    told = tables.engine_speed({"speed": speed}, "A title").markdown
    ours = next(line for line in told.splitlines() if line.startswith("| symplectic euler"))
    assert ours.count("| 1 |") == 2
    assert "force evaluations" in next(line for line in told.splitlines() if line.startswith("| SciPy"))

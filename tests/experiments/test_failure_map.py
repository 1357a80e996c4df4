from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.errors import InputError
from stiffdice.experiments import failure_map
from stiffdice.experiments.placement import clearance
from stiffdice.io.cf_enums import meanings_of
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import Scene
from stiffdice.simulation.outcome import BLOW_UP, Verdict
from stiffdice.simulation.run import simulate

BASE = Scene().with_ground(friction=0.0)
STEPS = [1.0, 10.0, 3_000.0, 100_000.0, 1e9]
# A few values of each axis.
VALUES = {
    "stiffness": [0.0, 1e-6, 1.0, 1e4, 1e8, 1e16],
    "damping": [0.0, 1.0, 1e3, 1e6],
    "friction": [0.0, 0.1, 10.0, 1e3],
    "mass": [1e-9, 1e-3, 1.0, 1e9],
    "radius": [1e-9, 1.0, 1e9],
    "spin": [0.0, 10.0, 1e6],
    "start": [],
}


def measured(axis, budget=200_000, **options):
    scene = Scene() if axis in ("friction", "spin") else BASE
    model = "tumbling" if axis == "spin" else "sliding"
    return failure_map.measure(
        scene, axis=axis, model=model, **({"values": VALUES[axis], "steps": STEPS, "budget": budget} | options)
    )


@pytest.fixture(scope="module", params=VALUES)
def found(request):
    return measured(request.param)


def named(dataset):
    names = np.array(meanings_of(dataset.verdict))
    return dataset.assign_coords(contact=meanings_of(dataset.contact)).verdict.copy(
        data=names[dataset.verdict.values].astype(object)
    )


def test_every_run_has_a_verdict_from_the_list(found):
    assert found.verdict.dims == ("contact", "value", "steps")
    assert meanings_of(found.verdict) == [verdict.name.lower() for verdict in Verdict]
    assert set(np.unique(found.verdict)) <= set(Verdict)


@pytest.mark.long
def test_verdicts_are_those_of_stepping(found):
    axis = found.attrs["axis"]
    chosen = failure_map.AXES[axis]
    for (c, v, s), verdict in np.ndenumerate(found.verdict.values):
        steps = int(found.steps[s])
        if steps > 100_000 or verdict == Verdict.UNDECIDED:
            continue
        law = meanings_of(found.contact)[c]
        base = Scene() if axis in ("friction", "spin") else BASE
        value = (VALUES[axis] or chosen.values)[v]
        ground = base.with_ground(contact=law)
        scene = chosen.placed(ground, value) if chosen.placed else ground.with_ground(**{axis: value})
        stepped = simulate(scene, model=found.attrs["model"], steps=steps, every=steps, stop={"energy": BLOW_UP - 1})
        assert verdict == stepped.verdict[0], (law, value, steps)


def test_a_ground_without_springs_is_sunk_into_and_one_too_stiff_for_the_steps_throws():
    verdicts = named(measured("stiffness"))
    assert (verdicts.sel(value=0.0, steps=[1, 3000, 100_000, 10**9]) == "sank").all()
    assert (verdicts.sel(value=1e4, steps=10) == "blew_up").all()
    assert (verdicts.sel(value=1e8, steps=3000) == "blew_up").all()
    assert (verdicts.sel(value=1e16, steps=100_000) == "blew_up").all()
    assert (verdicts.sel(value=1e4, steps=[100_000, 10**9]) == "passed").all()
    assert (verdicts.sel(value=1e8, steps=10**9) == "passed").all()


@pytest.mark.parametrize("axis", ["stiffness", "damping", "mass"])
def test_nothing_passes_with_fewer_steps_than_theory_asks(axis):
    dataset = measured(axis)
    passed = dataset.verdict.values == Verdict.PASSED
    fewest = np.nan_to_num(dataset.limit_steps.values[0])[:, :, None]
    assert not (passed & (dataset.steps.values < fewest)).any()
    assert passed.any()


@pytest.mark.parametrize(("law", "nodes"), [("gated", 4), ("ungated", 8)])
def test_explicit_damping_goes_unstable_beyond_two(law, nodes):
    """Far over-damped, c h/m = 2 is the whole of the limit: on four nodes in contact, on eight in mid-air."""
    damping = 1e4
    limit = nodes * damping * 10 / 2
    steps = [0.1 * limit, 0.5 * limit, 1.05 * limit, 3 * limit]
    dataset = measured("damping", values=[damping], steps=[round(part) for part in steps], budget=10_000_000)
    row = meanings_of(dataset.contact).index(law)
    kind = meanings_of(dataset.limit).index("contact" if law == "gated" else "drag")
    assert float(dataset.limit_steps[kind, row, 0]) == pytest.approx(limit, rel=0.01)
    verdicts = list(named(dataset).values[row, 0])
    assert verdicts[2:] == ["passed", "passed"]
    assert not {"passed"} & set(verdicts[:2])
    if law == "gated":  # in mid-air it is kicked up a little at each fall, for ever
        assert verdicts[0] == "energy_grew"


def test_limits_of_theory():
    """A solid cube that turns rocks at ω² = 6 S/m; in mid-air eight nodes brake its spin by 12 D/m, its fall by 8."""
    dataset = measured("spin", values=[3.0], steps=[1.0])
    contact, drag, turn, stall = (dataset.limit_steps.values[k, :, 0] for k in range(4))
    omega = linear_theory.contact_frequency(1e4, 1.0, 6)
    np.testing.assert_allclose(contact, 10 * omega / linear_theory.stability_limit(6 * 0.2 / (2 * omega)))
    np.testing.assert_allclose(drag, [12 * 0.2 * 10 / 2, np.nan])
    np.testing.assert_allclose(turn, 30 / np.pi)
    np.testing.assert_allclose(stall, 2 * 5 * 10 / np.spacing(3.0))


def test_friction_that_only_takes_leaves_the_verdict_of_the_twin_without():
    dataset = measured("friction", budget=20_000)
    assert (dataset.verdict.sel(steps=10**9) == Verdict.PASSED).all()
    # and friction that gives is run itself: a kick in a step beyond the sliding speed turns it around
    named_verdicts = named(measured("friction", values=[1e3], steps=[10_000.0]))
    assert (named_verdicts == "energy_grew").sel(contact="gated").all()


def test_a_pass_with_steps_too_long_is_unresolved():
    spin = named(measured("spin", values=[1e6], steps=[1e5]))
    assert (spin == "unresolved").all()
    assert (named(measured("start", values=[], steps=[1.0])).isel(value=1) == "unresolved").all()


def test_a_radius_keeps_the_launch_clear_of_the_ground():
    for radius in (1e-9, 1e3):
        scene = failure_map.AXES["radius"].placed(Scene(), radius)
        assert scene.cube.geometry == "exact"
        assert clearance(scene) == pytest.approx(3 - Scene().cube.side / 2)


def test_everything_is_named_has_units_and_survives_a_file(found, tmp_path):
    for name, variable in found.variables.items():
        assert variable.attrs["units"], name
        assert variable.attrs["long_name"], name
    write_dataset(found, tmp_path / "extremes.h5")
    with xr.open_dataset(tmp_path / "extremes.h5", engine="h5netcdf") as stored:
        xr.testing.assert_equal(stored.load(), found)


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"axis": "colour"}, "axis = colour"),
        ({"axis": "spin"}, "model = sliding: allowed for axis spin is tumbling"),
        ({"axis": "start", "values": [1.0]}, "values: not for axis start"),
        ({"axis": "mass", "values": [0.0]}, "cube.mass = 0"),
        ({"steps": [0.5]}, "steps = 0.5"),
        ({"budget": 0}, "budget = 0"),
    ],
)
def test_what_cannot_be_measured_is_said(options, told):
    with pytest.raises(InputError, match=told):
        failure_map.measure(BASE, **options)

from __future__ import annotations

import csv
import io

import numpy as np
import pytest
from tests.report.figures.drawing import check_equal_files, check_units, drawn, lines_of

from stiffdice.experiments.pair import peers
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.tables import pair_peers
from stiffdice.scene.scene import Scene

FEW = {"omega_h": (0.1, 8.0), "count": 3, "phases": 2, "depth": [0.1, 0.4, 0.6], "angle": [1e-9, 1e-3], "duration": 0.1}


@pytest.fixture(scope="module")
def found():
    ours = peers.measure(Scene(), **FEW)
    # Another method's numbers: twice the speeds, half of the depths, and never thrown.
    other = ours.assign(exit_speed=2 * ours.exit_speed, depth_ratio=ours.depth_ratio / 2)
    other = other.assign(energy_ratio=np.nan * other.energy_ratio)
    both = {name: data for name, data in ours.data_vars.items() if "method" not in data.dims}
    for name in set(ours.data_vars) - set(both):
        values = np.concatenate([ours[name].values, other[name].values])
        both[name] = (ours[name].dims, values, ours[name].attrs)
    words = {"flag_values": np.array([0, 1], np.int8), "flag_meanings": "symplectic_euler mujoco"}
    coords = {name: part for name, part in ours.coords.items() if name != "method"}
    told = ours.drop_vars([*ours.data_vars, "method"]).assign_coords(coords).assign(both)
    return told.assign_coords(method=("method", np.array([0, 1], np.int8), ours.method.attrs | words))


def test_the_figure_has_four_panels_with_units(found):
    figure = drawn("pair-peers", {"peers": found})
    assert len(figure.axes) == 4
    check_units(figure)


def test_each_method_has_its_line_if_it_was_asked(found):
    energy, speed, turn, depth = drawn("pair-peers", {"peers": found}).axes
    assert "mujoco" not in lines_of(energy)
    assert lines_of(energy)["symplectic_euler"][:, 1].max() <= 1e3
    np.testing.assert_array_equal(lines_of(speed)["mujoco"][:, 1], found.exit_speed[1])
    sizes, most = pair_peers.changes(found.isel(method=0), "force_change")
    np.testing.assert_array_equal(lines_of(turn)["symplectic_euler force_change"], np.stack([sizes, most], axis=1))
    np.testing.assert_allclose(lines_of(depth)["corner in corner"][:, 0], [1.0, 0.5])


@pytest.mark.broad
def test_the_same_data_give_the_same_files(found, tmp_path):
    check_equal_files("pair-peers", {"peers": found}, tmp_path)


def test_the_table_has_a_row_for_each_method_and_empty_cells_for_what_was_not_asked(found):
    told = pair_peers.table({"peers": found}, "A title")
    heading, ours, other = csv.reader(io.StringIO(told.csv))
    assert meanings_of(found.method) == ["symplectic_euler", "mujoco"]
    assert (ours[0], other[0]) == ("stiffdice", "MuJoCo, our springs")
    cells = dict(zip(heading, zip(ours, other, strict=True), strict=True))
    assert cells["energy within 5 % up to ωh [1]"] == ("0.1", "")
    assert cells["out of the deepest [1]"] == ("1", "2")
    assert cells["depth over the depth, at most [1]"] == ("1", "0.5")
    assert float(cells["jump of the torque [1]"][0]) < 4e-3
    assert "a turn by 10⁻⁹ rad" in told.markdown


@pytest.mark.parametrize(
    ("energies", "longest"), [([1, 1, 2], "0.894"), ([1, 2, 1], "0.1"), ([1, 1, 1], "8"), ([0.5, 1, 9], "0.894")]
)
def test_energy_is_kept_up_to_the_last_omega_h_before_it_grows(found, energies, longest):
    values = np.broadcast_to(np.array(energies, float)[:, None], found.energy_ratio.shape)
    told = pair_peers.table({"peers": found.assign(energy_ratio=(found.energy_ratio.dims, values))}, "A title")
    assert list(csv.reader(io.StringIO(told.csv)))[1][1] == longest

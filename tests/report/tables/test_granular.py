"""The tables of granular codes' rules."""

from __future__ import annotations

import csv
import io

from stiffdice.experiments import granular
from stiffdice.experiments.measuring import mapped, result
from stiffdice.report.tables import granular as tables
from stiffdice.scene.scene import Scene


def rows_of(table):
    return list(csv.DictReader(io.StringIO(table.csv)))


def test_packings_are_told_with_how_far_exadems_rule_is_beyond():
    found = mapped(lambda name, force: [1.0], {"measured": ("", "1")}, packing=granular.PACKINGS, force=granular.FORCES)
    found |= mapped(
        lambda name: [0.5, 0.4, 3.0],
        {"theory": ("", "1"), "yade": ("", "1"), "exadem": ("", "1")},
        packing=granular.PACKINGS,
    )
    rows = rows_of(tables.steps({"steps": result(found, "", Scene(), "case", "", "stiffdice.errors")}, "Steps"))
    assert [row["packing"] for row in rows] == [name.replace("_", " ") for name in granular.PACKINGS]
    assert {row["exaDEM over 2/ω"] for row in rows} == {"6.00"}


def test_beads_are_told_for_each_modulus_and_speed():
    rows = rows_of(tables.beads({"beads": granular.beads(Scene(), young=[5e6, 7e10], speed=[1.0])}, "Beads"))
    assert [row["E [Pa]"] for row in rows] == ["5×10⁶", "7×10¹⁰"]
    assert {row["stable over Hertz"] for row in rows} == {"0.25"}

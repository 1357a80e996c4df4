"""The table of what double precision itself cannot do: by formula, and found in this code."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from stiffdice.dynamics import linear_theory
from stiffdice.io.cf_enums import meanings_of
from stiffdice.report.markdown_table import Table, rendered
from stiffdice.report.number_format import readable, scene_of
from stiffdice.scene import scene as scenes

# By limit: what happens, the formula, and the unit. ulp: a unit in the last place; a sum loses half of it.
_ROWS: dict[str, tuple[str, str, str]] = {
    "spring_at_rest": (
        "the springs' energy at rest drowns in m g z: lost from S =",
        "(m g)²/(4 ulp(m g s/2))",
        "kg/s²",
    ),
    "sag_in_height": ("the sag at rest is lost in z: from S =", "m g/(2 ulp(s/2))", "kg/s²"),
    "spring_at_deepest": (
        "at the deepest point of the landing it does not: its size, on any stiffness",
        "(m v²/2 + m g d)/ulp(m g z)",
        "units in the last place of m g z",
    ),
    "way_in_place": ("z + h u = z, a step at the launch's speed: up to h =", "ulp(z)/(2u)", "s"),
    "pull_in_speed": ("u − g h = u at the launch: up to h =", "ulp(u)/(2g)", "s"),
    "first_fall": ("z − g h² = z, a cube let go from rest: up to h =", "√(ulp(z)/(2g))", "s"),
    "growth": (
        "a bounce multiplies round-off in z by",
        "(v ω² h/g) (2(1 − κ))^κ (2κ)^(1 − κ), κ = frac(π/θ), 2 sin(θ/2) = ωh",
        "1",
    ),
    "square_of_frequency": ("ω² = 4S/m leaves the range: from S =", "1.8×10³⁰⁸ m/4", "kg/s²"),
    "first_contact": (
        "the first contact leaves the range: from S =",
        "1.8×10³⁰⁸/(Σd max(1, (1 + h)h/m))",
        "kg/s²",
    ),
}


def table(experiments: Mapping[str, xr.Dataset], title: str) -> Table:
    """Return a row for each limit: what happens, the formula, what it predicts, and what was found."""
    (found,) = experiments.values()
    names, measured = meanings_of(found.limit), found.measured.values.tolist()
    rows = []
    for name, predicted, value in zip(names, found.predicted.values.tolist(), measured, strict=True):
        what, formula, unit = _ROWS[name]
        rows.append([what, formula, readable(predicted, 3), readable(value, 3), unit])
    scene = scenes.from_mapping(scene_of(found)).with_ground(stiffness=float(found.attrs["bounce_stiffness"]))
    omega_h, slow = float(found.attrs["bounce_omega_h"]), measured[names.index("first_fall")]
    note = (
        f"ulp: a unit in the last place. Launch at z = {scene.launch.position[2]:g} m with "
        f"u = {scene.launch.velocity[2]:g} m/s; m = {scene.cube.mass:g} kg, s = {scene.cube.side:.6g} m. Round-off is "
        f"followed at S = {readable(scene.ground.stiffness)} kg/s² and ωh = {omega_h:g}, "
        f"{round(linear_theory.steps_for(scene, omega_h)):,} steps in {scene.duration:g} s; the first contact is that "
        f"of a run of {int(found.attrs['coarse'])} steps. A step of {readable(slow)} s is "
        f"{readable(scene.duration / slow)} steps in {scene.duration:g} s."
    )
    return rendered(title, ["limit", "formula", "predicted", "measured", "unit"], rows, note)

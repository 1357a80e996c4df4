"""A scene and a study to begin with, as YAML in which a comment says unit and alternatives of every key."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

from stiffdice.integrators import linear_stability
from stiffdice.scene.scene import PRESETS, Scene

# Of each key: its unit, and what else it may be.
_KEYS = {
    "cube": "the body: a cube, or a box with a load (config/README.md)",
    "cube.radius": "[m] centre to corner. Or `side: 16 mm`, with geometry: exact; a box has `sides: [a, b, c]`",
    "cube.mass": "[kg] in total",
    "cube.geometry": "printed: side as in the paper's formula; exact: a true cube, side 2r/√3",
    "cube.inertia": "solid: m s²/6; corners: m s²/2, eight masses at the corners",
    "cube.sides": "[m] of a box along x, y, z of the upright one",
    "cube.node_masses": "[kg] at the nodes, in their order",
    "cube.moments": "[kg m²] moments of inertia about the directions of the edges",
    "ground": "a plane through the origin that pushes back; its numbers are per node",
    "ground.stiffness": "[kg/s²] or `contact_time: 1 ms` in its place, with a restitution",
    "ground.damping": "[kg/s] or `restitution: 0.5` in its place: speed up over speed down of a flat landing",
    "ground.friction": "[1] coefficient of friction",
    "ground.contact": "gated: acts on nodes below the ground; ungated: in the air, too, as the paper's listings",
    "ground.normal": "[1] direction out of the ground, of any length: [0, 0, 1] is level, [0.1, 0, 1] a slope",
    "launch": "how it starts",
    "launch.position": "[m] of the centre",
    "launch.velocity": "[m/s] of the centre",
    "launch.angular_momentum": '[kg m²/s] or a spin, "[50, 100, 0] rad/s"; or {seed: 7}, random',
    "launch.orientation": '[rad] rotation vector from the upright cube. Or "[0, 0, 10] deg"',
    "launch.node_velocity": "of the first step. rigid: with the spin; translation: the centre's, as in the listings",
    "gravity": "[m/s²] downwards, along −z",
    "duration": "[s] of the motion",
}
_SECTIONS = ("cube", "ground", "launch")
_COLUMN = 44  # where comments begin
# Fewest steps of the run, and how many times those that the linear limit needs; states that are kept.
_STEPS, _TIMES, _KEPT = 10_000, 10.0, 1000
_STIFFNESS = 1e4  # kg/s², of the sweep, where the scene has no ground


def scene_text(name: str, scene: Scene, source: str) -> str:
    """Return the YAML file of a scene, every key with its value; source: what it was begun from."""
    lines = [f"# {name}: begun from {source}. config/README.md of the project explains every key."]
    lines += [f"# {line}" for line in scene.derived]
    lines += ["# A number without a unit is in the unit in brackets; `5 g` has its own.", ""]
    for key, value in scene.as_mapping().items():
        if key in _SECTIONS:
            lines += [f"{key}:  # {_KEYS[key]}"]
            lines += [_line(f"{key}.{part}", f"  {part}", inner) for part, inner in value.items()]
        else:
            lines.append(_line(key, key, value))
    return "\n".join(lines) + "\n"


def study_text(name: str, scene: Scene, path: str) -> str:
    """Return the YAML file of a study of a scene: one throw, and how many steps it needs by stiffness.

    path: of the scene's file, from the top of the project.
    """
    steps = _steps(scene)
    stiffness = scene.ground.stiffness or _STIFFNESS
    preset = preset_of(scene.ground.contact, scene.cube.geometry)
    turns = any(scene.launch.spin) or any(scene.launch.orientation)
    rows = [
        f"# A study of {name}, begun by `stiffdice new`: `make study STUDY={name}` makes results/{name}/figures/.",
        "# config/README.md explains every key, and what else can be measured and drawn.",
        "",
        ("question: How many time steps does it need?", "what the study is to answer"),
        "",
        "runs:  # throws to store, by name",
        f"  {name}:",
        (f"    scene: {path}", "from the top of the project"),
        (f"    presets: [{preset}]", f"for keys not in the scene: {', '.join(PRESETS)}"),
        ("    model: tumbling", "or sliding, vertical (no rotation), auto (the least that is exact)"),
        ("    scheme: symplectic_euler", "or event, exact, rk4, velocity_verlet, implicit_euler, forward_euler"),
        (f"    steps: {steps}", f"[1] number of time steps, here of {scene.duration / steps:.3g} s"),
        (f"    every: {max(1, steps // _KEPT)}", "[1] keep one state in so many"),
        "",
        "sweeps:  # grids of stiffness and steps, by name",
        "  steps-needed:",
        (f"    scene: {path}", "each cell sets its stiffness and contact law"),
        (f"    model: {'tumbling' if turns else 'sliding'}", "sliding is faster, for what lands flat"),
        (f"    contact: [{scene.ground.contact}]", "gated, ungated, or both"),
        (f"    stiffness: {{from: {stiffness / 10:g}, to: {stiffness * 10:g}, count: 5}}", "[kg/s²] or a list"),
        ("    omega_h: {from: 3.0, to: 0.2, count: 40}", "[1] contact frequency × step: 2 is the limit. Or steps"),
        ("    members: 8", "[1] launches per cell, spread over the phase of the landing"),
        ("    seed: 1", "[1] of the jitter of the steps"),
        ("    refine: 0", "[1] rounds with more cells where members disagree"),
        "",
        "criteria:  # what a run has to keep; beside these: finite, restitution, trajectory",
        ("  energy: 0.05", "[1] airborne energy at most 1 + this of the launch's"),
        ("  apex: 0.02", "[1] no rebound above 1 + this of the one before (sliding only)"),
        "",
        "figures:  # in results/NAME/figures/, by name",
        f'  position: {{draw: position, run: {name}, title: "Position of {name}"}}',
        f'  energy: {{draw: energy, run: {name}, title: "Energy of {name}"}}',
        '  frontier: {draw: frontier, of: [steps-needed], title: "Steps needed against stiffness"}',
        "",
        ("dpi: 150", "[1] dots per inch of PNG files"),
    ]
    return "\n".join(row if isinstance(row, str) else _commented(*row) for row in rows) + "\n"


def preset_of(contact: str, geometry: str) -> str:
    """Return the reading of the paper that has a contact law and a geometry."""
    if contact == "ungated":
        return "as_listed"
    return "as_written" if geometry == "printed" else "corrected"


def _steps(scene: Scene) -> int:
    """Return enough steps of symplectic Euler, in two digits."""
    fewest = max(linear_stability.fewest_steps(scene, "tumbling", "symplectic_euler"))
    wanted = max(_STEPS, _TIMES * fewest) if math.isfinite(fewest) else _STEPS
    unit = 10 ** (math.floor(math.log10(wanted)) - 1)
    return math.ceil(wanted / unit) * unit


def _line(key: str, shown: str, value: Any) -> str:
    return _commented(f"{shown}: {_plain(value)}", _KEYS.get(key, "see config/README.md"))


def _commented(text: str, comment: str) -> str:
    return f"{text:{_COLUMN - 2}}  # {comment}"


def _plain(value: Any) -> str:
    """Return a value as YAML on one line; numbers with all their digits."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(_pairs(value)) + "}"
    return str(value) if isinstance(value, str) else json.dumps(value)


def _pairs(mapping: Mapping[str, Any]) -> Iterator[str]:
    for key, value in mapping.items():
        yield f"{key}: {_plain(value)}"

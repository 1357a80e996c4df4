"""The scenes that the benchmarks run, by model and contact law; the step is the throw listing's, 10⁻⁴ s."""

from __future__ import annotations

import dataclasses

from stiffdice.scene.scene import Scene, from_mapping

STEP_SIZE = 1e-4  # [s]

# The throw listing's ground; the paper's random spin is figure 4's.
THROW = {
    "ground": {"damping": 0.1, "friction": 0.1},
    "launch": {"position": [0, 0, 3], "velocity": [5, 0, 5], "angular_momentum": {"seed": 2}},
}

PRESETS = {"gated": "as_written", "ungated": "as_listed"}


def scene_of(law: str, steps: int) -> Scene:
    """Return the throw under a contact law for so many steps: 100,000 are the listing's ten seconds."""
    return dataclasses.replace(from_mapping(THROW, preset=PRESETS[law]), duration=steps * STEP_SIZE)

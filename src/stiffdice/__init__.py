"""How many time steps does a stiff ground cost, and what do you get for them?

A scene (`Scene`) is read from a file (`load_scene`) or from plain data (`scene_from_mapping`). `simulate` runs it and
returns a `Run`: verdict, measures and, if asked, the `Trajectory`. `run_dataset` and `write_dataset` turn a run into a
dataset of xarray and into a file; `open_results` opens files of runs, sweeps and experiments. `advise` says which
scheme and how many steps keep an error, and `run_advised` makes that run. `land` throws a die as often as a
`LaunchDistribution` draws launches, and says which faces are up. `simulate_pair` runs a scene of two cubes, a
`PairScene`, and `pair_dataset` turns that run into a dataset.

```python
import stiffdice

scene = stiffdice.scene_from_mapping(
    {
        "cube": {"side": "16 mm", "mass": "5 g"},
        "ground": {"restitution": 0.5, "stiffness": "10 kN/m"},
        "launch": {"position": [0, 0, 0.05], "velocity": [0.3, 0, 0]},
        "duration": 0.2,
    }
)
run = stiffdice.simulate(scene, model="sliding", steps=20_000, every=20)
print(stiffdice.Verdict(run.verdict[0]).sentence)
print(run.trajectory.mechanical_energy[[0, -1]])  # [J]

advice = stiffdice.advise(scene, error=0.01)  # of the cube's radius
print(advice.best.scheme, advice.best.steps, advice.best.error)
better = stiffdice.run_advised(advice, advice.best)

stiffdice.write_dataset(stiffdice.run_dataset(better), "thrown.h5")
height = stiffdice.open_results("thrown.h5").position.sel(axis="z")
print(float(height.max()))  # [m]
```

Lengths are in metres, masses in kilograms, times in seconds; a scene also takes values with units. What is wrong with
an input is told by `InputError`, in one line.
"""

from __future__ import annotations

import importlib
from typing import Any

__version__ = "0.1.0"

# By where each is: loaded when asked for, so that importing the package takes no time; and named, not imported,
# because the digest of all code follows what this file imports (`code_digest.py`). `__init__.pyi` tells type checkers
# the same.
_PUBLIC = {
    # The problem.
    "Scene": "stiffdice.scene.scene:Scene",
    "load_scene": "stiffdice.scene.scene:load",
    "scene_from_mapping": "stiffdice.scene.scene:from_mapping",
    # Its run. A run holds numbers of verdicts, and energies in its trajectory.
    "simulate": "stiffdice.simulation.run:simulate",
    "Run": "stiffdice.simulation.run:Run",
    "Trajectory": "stiffdice.simulation.run:Trajectory",
    "Verdict": "stiffdice.simulation.outcome:Verdict",
    # Two cubes that meet, and the energy of each.
    "PairScene": "stiffdice.scene.pair:PairScene",
    "load_pair_scene": "stiffdice.scene.pair:load",
    "pair_scene_from_mapping": "stiffdice.scene.pair:from_mapping",
    "simulate_pair": "stiffdice.simulation.pair.run:simulate_pair",
    "PairRun": "stiffdice.simulation.pair.run:PairRun",
    "PairTrajectory": "stiffdice.simulation.pair.run:PairTrajectory",
    "pair_dataset": "stiffdice.simulation.pair.dataset:pair_dataset",
    # Many throws of a die, until its faces are decided.
    "LaunchDistribution": "stiffdice.simulation.launch_distribution:LaunchDistribution",
    "land": "stiffdice.simulation.landing:land",
    "Landing": "stiffdice.simulation.landing:Landing",
    "Rest": "stiffdice.simulation.landing:Rest",
    # Which run to make.
    "advise": "stiffdice.advice.recommend:advise",
    "Advice": "stiffdice.advice.result:Advice",
    "Option": "stiffdice.advice.result:Option",
    "run_advised": "stiffdice.advice.result:run_advised",
    # Datasets and files; xarray draws, selects and exports.
    "run_dataset": "stiffdice.simulation.dataset:run_dataset",
    "write_dataset": "stiffdice.io.writer:write_dataset",
    "open_results": "stiffdice.io.reader:open_results",
    # What a notebook catches.
    "StiffdiceError": "stiffdice.errors:StiffdiceError",
    "InputError": "stiffdice.errors:InputError",
    "OutputError": "stiffdice.errors:OutputError",
}

__all__ = list(_PUBLIC)


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, _, attribute = _PUBLIC[name].partition(":")
    return getattr(importlib.import_module(module), attribute)


def __dir__() -> list[str]:
    return sorted([*globals(), *_PUBLIC])

from __future__ import annotations

from pathlib import Path

import pytest

from stiffdice.experiments import friction_chatter
from stiffdice.io.writer import write_dataset
from stiffdice.scene import pair
from stiffdice.scene.scene import from_mapping
from stiffdice.simulation import energy_budget
from stiffdice.simulation.dataset import config_attributes, run_dataset
from stiffdice.simulation.pair import energy_budget as pair_budget
from stiffdice.simulation.pair.dataset import pair_dataset
from stiffdice.simulation.pair.run import simulate_pair
from stiffdice.simulation.run import simulate
from stiffdice.sweep import stability_limits

CHATTER = {"friction": [0.075], "step_size": [1e-6, 1e-4]}


@pytest.fixture(scope="session")
def written(tmp_path_factory, shards, collected):
    """A file of each kind that data are in, as the workflow writes them: kind → path."""
    folder = tmp_path_factory.mktemp("written")
    scene = from_mapping({"launch": {"angular_momentum": [0.1, 0.2, 0.3]}})
    ledger = energy_budget.ledger(scene, model="tumbling", scheme="symplectic_euler", steps=3000)
    run = run_dataset(simulate(scene, steps=3000, every=50)).assign(ledger.data_vars)
    found = friction_chatter.measure(from_mapping({}), **CHATTER)
    two = pair.load(Path(__file__).parents[2] / "config" / "scenes" / "two-cubes.yaml", ["duration=0.3"])
    booked = pair_budget.ledger(two, steps=1200, every=60)
    datasets = {
        "run": run,
        "pair": pair_dataset(simulate_pair(two, steps=1200, every=60)).assign(booked.data_vars),
        "sweep": collected,
        "frontier": stability_limits.find(collected),
        "experiment": found.assign_attrs(
            config_attributes("experiment", {"measure": "friction-chatter", "options": CHATTER})
        ),
    }
    for kind, dataset in datasets.items():
        write_dataset(dataset, folder / f"{kind}.h5")
    return {kind: folder / f"{kind}.h5" for kind in datasets} | {"shard": shards[0]}

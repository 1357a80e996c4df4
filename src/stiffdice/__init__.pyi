from stiffdice.advice.recommend import advise
from stiffdice.advice.result import Advice, Option, run_advised
from stiffdice.errors import InputError, OutputError, StiffdiceError
from stiffdice.io.reader import open_results
from stiffdice.io.writer import write_dataset
from stiffdice.scene.scene import Scene
from stiffdice.scene.scene import from_mapping as scene_from_mapping
from stiffdice.scene.scene import load as load_scene
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.landing import Landing, Rest, land
from stiffdice.simulation.launch_distribution import LaunchDistribution
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.run import Run, Trajectory, simulate

__version__: str
__all__ = [
    "Advice",
    "InputError",
    "Landing",
    "LaunchDistribution",
    "Option",
    "OutputError",
    "Rest",
    "Run",
    "Scene",
    "StiffdiceError",
    "Trajectory",
    "Verdict",
    "advise",
    "land",
    "load_scene",
    "open_results",
    "run_advised",
    "run_dataset",
    "scene_from_mapping",
    "simulate",
    "write_dataset",
]

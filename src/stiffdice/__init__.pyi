from stiffdice.advice.recommend import advise
from stiffdice.advice.result import Advice, Option, run_advised
from stiffdice.errors import InputError, OutputError, StiffdiceError
from stiffdice.io.reader import open_results
from stiffdice.io.writer import write_dataset
from stiffdice.scene.pair import PairScene
from stiffdice.scene.pair import from_mapping as pair_scene_from_mapping
from stiffdice.scene.pair import load as load_pair_scene
from stiffdice.scene.scene import Scene
from stiffdice.scene.scene import from_mapping as scene_from_mapping
from stiffdice.scene.scene import load as load_scene
from stiffdice.simulation.dataset import run_dataset
from stiffdice.simulation.landing import Landing, Rest, land
from stiffdice.simulation.launch_distribution import LaunchDistribution
from stiffdice.simulation.outcome import Verdict
from stiffdice.simulation.pair.dataset import pair_dataset
from stiffdice.simulation.pair.run import PairRun, PairTrajectory, simulate_pair
from stiffdice.simulation.run import Run, Trajectory, simulate

__version__: str
__all__ = [
    "Advice",
    "InputError",
    "Landing",
    "LaunchDistribution",
    "Option",
    "OutputError",
    "PairRun",
    "PairScene",
    "PairTrajectory",
    "Rest",
    "Run",
    "Scene",
    "StiffdiceError",
    "Trajectory",
    "Verdict",
    "advise",
    "land",
    "load_pair_scene",
    "load_scene",
    "open_results",
    "pair_dataset",
    "pair_scene_from_mapping",
    "run_advised",
    "run_dataset",
    "scene_from_mapping",
    "simulate",
    "simulate_pair",
    "write_dataset",
]

"""Files of tosses for tests: some of the real ones, and tosses that the simulator made."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
from scipy.spatial.transform import Rotation

from stiffdice.experiments.tosses.launches import Launches, launches_of
from stiffdice.experiments.tosses.replay import Physics, replay, scene_of, step_of, whole_step
from stiffdice.scene import tosses as files
from stiffdice.scene.scene import Ground, Scene

REAL = Path(__file__).parent.parent / "config" / "measurements" / "tosses.h5"
SCENE = Scene(ground=Ground(contact="gated"), gravity=9.8)

_UNITS = {"position": "m", "orientation": "1", "row_size": "1", "velocity": "m s-1", "angular_velocity": "rad s-1"}


def some(count: int) -> files.Tosses:
    """The first real tosses, in stored lengths."""
    return files.load(REAL).chosen(np.arange(count))


def made(count: int, physics: Physics, omega_h: float = 0.05) -> tuple[files.Tosses, Launches]:
    """Real launches, the tosses replaced by what the simulator makes of them; and these launches."""
    real = some(count)
    launches = launches_of(real, "flight", SCENE.gravity)
    scene = scene_of(real, physics, SCENE)
    paths = replay(real, launches, scene, whole_step(real.rate, step_of(scene, omega_h)))
    motion = {"velocity": launches.velocity, "angular_velocity": launches.angular_velocity}
    return real._replace(position=paths.position, orientation=paths.orientation, **motion), launches


def contents(tosses: files.Tosses) -> tuple[dict, dict]:
    """What a file of these tosses holds: variables and attributes."""
    quaternions = Rotation.from_matrix(tosses.orientation).as_quat(scalar_first=True)
    spin = np.einsum("kji,kj->ki", tosses.orientation[tosses.first], tosses.angular_velocity)
    variables = {
        "position": tosses.position.copy(),
        "orientation": quaternions,
        "row_size": tosses.counts.astype(np.int32),
        "velocity": tosses.velocity.copy(),
        "angular_velocity": spin,
    }
    attributes = {
        "sampling_rate": tosses.rate,
        "sampling_rate_units": "Hz",
        "half_width": tosses.half_width,
        "half_width_units": "m",
        "mass": tosses.mass,
        "mass_units": "kg",
        "moment_of_inertia": tosses.moment_of_inertia,
        "moment_of_inertia_units": "kg m2",
    }
    return variables, attributes


def write(path: Path, variables: dict, attributes: dict, units: dict | None = None) -> Path:
    """A file with these; units: other ones than those of tosses, by variable."""
    with h5py.File(path, "w", libver="latest") as file:  # with checksums, as h5netcdf writes
        file.attrs.update(attributes)
        for name, values in variables.items():
            file[name] = values
            file[name].attrs["units"] = (_UNITS | (units or {}))[name]
    return path


def stored(tosses: files.Tosses, path: Path) -> Path:
    return write(path, *contents(tosses))

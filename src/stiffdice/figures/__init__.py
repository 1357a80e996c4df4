"""Datasets in, figures out. A drawing is a function; one line registers it."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import xarray as xr
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from stiffdice.figures import cube, frontier, style, trajectory
from stiffdice.io.write import write_bytes

# What a study may ask for under `figures`, and the function that draws it. Each takes the datasets and the title.
DRAWINGS: dict[str, Any] = {
    "cube-start": lambda data, title: cube.at(data, title, 0.0),
    "cube-middle": lambda data, title: cube.at(data, title, 0.5),
    "cube-end": lambda data, title: cube.at(data, title, 1.0),
    "animation": cube.animation,
    "position": trajectory.position,
    "energy": trajectory.energy,
    "frontier": lambda data, title: frontier.steps_needed(data["frontier"], title),
}


def draw(drawing: str, data: Mapping[str, xr.Dataset], title: str, dpi: int, paths: list[str]) -> None:
    """Draw one figure into files, whose endings say the format; equal data give equal files.

    data: runs by preset, or `frontier`. Raises OutputError if a file cannot be stored.
    """
    with style.applied():
        figure = DRAWINGS[drawing](data, title)
        for path in paths:
            write_bytes(_encoded(figure, Path(path).suffix[1:], dpi), path)


def _encoded(figure: Figure | FuncAnimation, kind: str, dpi: int) -> bytes:
    if isinstance(figure, FuncAnimation):
        return _gif(figure, dpi)
    stream = io.BytesIO()
    metadata = {"svg": {"Date": None, "Creator": "stiffdice"}, "png": {"Software": "stiffdice"}}[kind]
    figure.savefig(stream, format=kind, dpi=dpi, metadata=metadata)
    return stream.getvalue()


def _gif(animation: FuncAnimation, dpi: int) -> bytes:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "animation.gif"
        animation.save(path, writer=PillowWriter(fps=cube.FRAMES_PER_SECOND), dpi=dpi)
        return path.read_bytes()

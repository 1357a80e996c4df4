"""Datasets in, figures out. A drawing is a function; one line of `catalogue.py` registers it."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import xarray as xr
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from stiffdice.io.writer import write_bytes
from stiffdice.report.figures import style
from stiffdice.study.catalogue import DRAWINGS

# Of an animation; 50 ms a frame, because a GIF counts in hundredths of a second.
FRAMES_PER_SECOND = 20


def draw(drawing: str, data: Mapping[str, xr.Dataset], title: str, dpi: int, paths: list[str]) -> None:
    """Draw one figure into files, whose endings say the format; equal data give equal files.

    data: runs by preset, or what sweeps and experiments found, by name. Raises OutputError if a file cannot be stored.
    """
    with style.applied():
        figure = DRAWINGS[drawing].load()(data, title)
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
        animation.save(path, writer=PillowWriter(fps=FRAMES_PER_SECOND), dpi=dpi)
        return path.read_bytes()

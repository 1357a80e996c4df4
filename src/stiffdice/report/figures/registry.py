"""Datasets in, figures out. A drawing is a function; one line of `catalogue.py` registers it."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from PIL import Image

from stiffdice.io.writer import write_bytes
from stiffdice.report.figures import style
from stiffdice.study.catalogue import DRAWINGS

# Of an animation; 50 ms a frame, because a GIF counts in hundredths of a second.
FRAMES_PER_SECOND = 20
COLOURS = 64  # of all frames together
_METADATA = {
    "svg": {"Date": None, "Creator": "stiffdice"},
    "png": {"Software": "stiffdice"},
    "pdf": {"CreationDate": None, "Creator": "stiffdice"},
}


class Animation(NamedTuple):
    """A figure, what moves in it at a frame, from 0 on, and the number of frames."""

    figure: Figure
    show: Callable[[int], list[Any]]
    frames: int


def draw(drawing: str, data: Mapping[str, xr.Dataset], title: str, dpi: int, paths: list[str]) -> None:
    """Draw one figure into files, whose endings say the format; equal data give equal files.

    data: runs by preset, or what sweeps and experiments found, by name. Raises OutputError if a file cannot be stored.
    """
    store(DRAWINGS[drawing].load(), data, title, dpi, paths)


def store(
    drawing: Callable[..., Figure | Animation], data: Mapping[str, xr.Dataset], title: str, dpi: int, paths: list[str]
) -> None:
    """Draw by a function as `draw` does by a name."""
    with style.applied():
        figure = drawing(data, title)
        for path in paths:
            stream = io.BytesIO()
            if isinstance(figure, Animation):
                _draw_gif(figure, dpi, stream)
            else:
                kind = Path(path).suffix[1:]
                figure.savefig(stream, format=kind, dpi=dpi, metadata=_METADATA[kind])
            write_bytes(stream.getvalue(), path)


def _draw_gif(animation: Animation, dpi: int, stream: io.BytesIO) -> None:
    """Draw a GIF of frames for which what does not move is drawn once."""
    figure = animation.figure
    figure.set_dpi(dpi)
    canvas: Any = FigureCanvasAgg(figure)
    for artist in animation.show(0):
        artist.set_animated(True)
    canvas.draw()
    still, frames = canvas.copy_from_bbox(figure.bbox), []
    for number in range(animation.frames):
        canvas.restore_region(still)
        for artist in animation.show(number):
            if isinstance(artist, Line3DCollection):
                artist.do_3d_projection()  # which is else the axes' to call
            figure.draw_artist(artist)
        frames.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    palette = frames[-1].quantize(COLOURS, Image.Quantize.FASTOCTREE)
    images = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    every = 1000 // FRAMES_PER_SECOND
    images[0].save(stream, "GIF", save_all=True, append_images=images[1:], duration=every, loop=0)

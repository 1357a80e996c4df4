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

from stiffdice import __version__
from stiffdice.errors import printable
from stiffdice.io.writer import write_bytes
from stiffdice.report.figures import style
from stiffdice.study.catalogue import DRAWINGS

# Of an animation; 50 ms a frame, because a GIF counts in hundredths of a second.
FRAMES_PER_SECOND = 20
COLOURS = 64  # of all frames together
FORMATS = "svg", "png", "pdf"
# Attributes of a dataset that say what its numbers follow from, and how much of each a figure keeps.
_DIGESTS = "config_digest", "scene_digest", "code_digest", "runs_digest"
_DIGITS = 16


class Animation(NamedTuple):
    """A figure, what moves in it at a frame, from 0 on, and the number of frames."""

    figure: Figure
    show: Callable[[int], list[Any]]
    frames: int


def draw(
    drawing: str,
    data: Mapping[str, xr.Dataset],
    title: str,
    dpi: int,
    paths: list[str],
    made_from: Mapping[str, str] | None = None,
) -> None:
    """Draw one figure into files, whose endings say the format; equal data give equal files.

    data: runs by preset, or what sweeps and experiments found, by name. made_from: words by name that are kept in each
    file beside the data's digests. Raises OutputError if a file cannot be stored.
    """
    store(DRAWINGS[drawing].load(), data, title, dpi, paths, {"drawing": drawing, **(made_from or {})})


def store(
    drawing: Callable[..., Figure | Animation],
    data: Mapping[str, xr.Dataset],
    title: str,
    dpi: int,
    paths: list[str],
    made_from: Mapping[str, str] | None = None,
) -> None:
    """Draw by a function as `draw` does by a name."""
    told = provenance(data, made_from or {})
    with style.applied():
        figure = drawing(data, title)
        for path in paths:
            stream = io.BytesIO()
            if isinstance(figure, Animation):
                _draw_gif(figure, dpi, stream, told)
            else:
                kind = Path(path).suffix[1:]
                figure.savefig(stream, format=kind, dpi=dpi, metadata=_metadata(kind, title, told))
                figure.set_layout_engine("none")  # all formats in one layout, which takes longest
            write_bytes(stream.getvalue(), path)


def provenance(data: Mapping[str, xr.Dataset], made_from: Mapping[str, str]) -> str:
    """Return what a figure is made from in one line of ASCII, which a search through the bytes of any format finds.

    It ends with a semicolon. It holds our version, `made_from`, and the digests that each dataset tells of itself.
    """
    parts = [f"stiffdice {__version__}", *(f"{name} {words}" for name, words in made_from.items())]
    for name, found in data.items():
        told = [f"{key.removesuffix('_digest')} {found.attrs[key][:_DIGITS]}" for key in _DIGESTS if key in found.attrs]
        parts.append(f"{name}: {', '.join(told)}" if told else "")
    return "".join(f"{part}; " for part in parts if part).rstrip().encode("ascii", "backslashreplace").decode("ascii")


def _metadata(kind: str, title: str, told: str) -> dict[str, str | None]:
    """Return what a file of this kind says of itself, without a date."""
    named = {"Title": printable(" ".join(title.split())), "Creator": f"stiffdice {__version__}"}
    if kind == "png":
        return {"Title": named["Title"], "Description": told, "Software": named["Creator"]}
    if kind == "svg":
        return {**named, "Description": told, "Date": None}
    return {**named, "Subject": told, "CreationDate": None}


def _draw_gif(animation: Animation, dpi: int, stream: io.BytesIO, told: str) -> None:
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
    images[0].save(
        stream, "GIF", save_all=True, append_images=images[1:], duration=every, loop=0, comment=told.encode()
    )

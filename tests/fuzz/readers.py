"""Every reader with files to spoil: what may come of a spoilt file is an error of one line, or something sound."""

from __future__ import annotations

import hashlib
import io
import json
import math
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from tests.fuzz import hdf5_blocks, mutations

from stiffdice.errors import LONGEST, InputError, RefusedError

TOP = Path(__file__).parent.parent.parent


class Reader(NamedTuple):
    """samples: sound files. spoil: sample, others, seed → one that is not. attempt: reads it, in a folder.

    before: called with some of the files that come next, and the folder.
    """

    samples: list[bytes]
    spoil: Callable[[bytes, list[bytes], int], bytes]
    attempt: Callable[[bytes, bytes, Path], None]
    before: Callable[[list[bytes], Path], None] = lambda _, __: None


def one_line(error: InputError) -> None:
    """State that an error is one for people."""
    assert 0 < len(str(error)) <= LONGEST
    assert str(error).isprintable(), repr(str(error))


def told(error: InputError, path: Path) -> None:
    """State that an error is one for people, and names the file."""
    one_line(error)
    assert str(error).startswith(f"{path}: "), str(error)


def scenes() -> Reader:
    from stiffdice.scene import scene

    def attempt(data: bytes, _: bytes, folder: Path) -> None:
        path = folder / "scene.yaml"
        path.write_bytes(data)
        try:
            found = scene.load(path)
        except InputError as error:
            told(error, path)
        else:
            sound_scene(found)

    samples = [path.read_bytes() for path in sorted((TOP / "config" / "scenes").glob("*.yaml"))]
    return Reader(samples, mutations.text_of, attempt)


def sound_scene(found: object) -> None:
    """State what holds of every scene."""
    from stiffdice.scene.scene import Scene, from_mapping

    assert isinstance(found, Scene)
    again = from_mapping(json.loads(json.dumps(found.as_mapping())))
    assert again == found
    assert again.digest == found.digest
    assert found.cube.mass > 0
    assert found.duration > 0
    assert all(math.isfinite(part) for part in (*found.launch.spin, *found.launch.velocity, *found.ground.normal))
    assert math.isclose(math.hypot(*found.ground.normal), 1)


def overrides() -> Reader:
    from stiffdice.scene import scene

    samples = [
        *(b"ground.stiffness=1e6", b"launch.velocity=[1, 2, 3]", b"launch.angular_momentum={seed: 7, low: 0, high: 1}"),
        *(b"launch.angular_momentum.seed=7", b"preset=as_written", b"cube={mass: 2, inertia: corners}", b"gravity=0"),
    ]

    def attempt(data: bytes, _: bytes, __: Path) -> None:
        try:
            found = scene.changed({"launch": {"position": [0, 0, 4]}}, [data.decode("utf-8", "surrogateescape")])
        except InputError as error:
            one_line(error)
        else:
            sound_scene(found)

    return Reader(samples, mutations.text_of, attempt)


def studies() -> Reader:
    from stiffdice.study import config as study

    def attempt(data: bytes, _: bytes, folder: Path) -> None:
        path = folder / "quick.yaml"
        path.write_bytes(data)
        try:
            found = study.load(path)
        except InputError as error:
            one_line(error)
            assert str(error).startswith(f"{path}: ")
        else:
            for sweep in found.sweeps.values():
                sound_sweep(sweep)

    names = ("quick", "paper", "extremes", "stability", "tradeoff")
    return Reader([(TOP / "config" / f"{name}.yaml").read_bytes() for name in names], mutations.text_of, attempt)


MOST_COLUMNS = 200  # looked at, of a sweep that may have a million


def sound_sweep(sweep: object) -> None:
    """State what holds of every sweep."""
    from stiffdice.sweep import partition
    from stiffdice.sweep.grid import Sweep

    assert isinstance(sweep, Sweep)
    columns = sweep.columns()
    assert len(set(columns)) == len(columns) > 0
    sound_scene(sweep.scene_of(columns[0]))
    if len(columns) <= MOST_COLUMNS:
        dealt = [
            (piece.column, n) for shard in partition.of(sweep).values() for piece in shard.pieces for n in piece.steps
        ]
        assert sorted(dealt) == sorted((column, n) for column in columns for n in sweep.scan(column))
    for column in columns[:3]:
        steps = sweep.scan(column)
        low, high = sweep.step_range(column.stiffness)
        assert steps == sorted(set(steps))
        assert max(1, math.floor(low)) <= steps[0] <= steps[-1] <= math.ceil(high)


def manifests() -> Reader:
    from stiffdice.archive import manifest

    digests = {
        f"results/quick/{name}": format(number, "064x") for number, name in enumerate(("a.h5", "b/c d.h5", "ü.csv"))
    }

    def attempt(data: bytes, _: bytes, __: Path) -> None:
        try:
            found = manifest.parse(data.decode("utf-8", "replace"))
        except RefusedError as error:
            one_line(error)
        else:
            assert manifest.parse(manifest.text_of(found)) == found

    return Reader([manifest.text_of(digests).encode(), manifest.text_of({}).encode()], mutations.text_of, attempt)


def archives() -> Reader:
    from stiffdice.archive.extract import unzip

    image = io.BytesIO()
    with zipfile.ZipFile(image, "w", zipfile.ZIP_DEFLATED) as packed:
        for name in ("manifest-sha256.txt", "config/quick.yaml", "results/quick/logs/a b.log"):
            packed.writestr(name, f"{name}\n" * 50)
    stored = io.BytesIO()
    with zipfile.ZipFile(stored, "w") as packed:
        packed.writestr("a/b.txt", "content")

    def attempt(data: bytes, sample: bytes, folder: Path) -> None:
        path, target = folder / "x.zip", folder / "x"
        path.write_bytes(data)
        try:
            unzip(path, target)
        except InputError as error:
            one_line(error)
            left = [entry for entry in folder.iterdir() if entry != path]
            assert left == [], "something half unpacked was left"
            return
        for entry in target.rglob("*"):
            assert not entry.is_symlink()
        _cleared(target)

    return Reader([image.getvalue(), stored.getvalue()], mutations.bytes_of, attempt)


def crates() -> Reader:
    """Descriptions of archives; what is said of files that are not so is a finding of `verify`, not an error."""
    from stiffdice.archive import manifest
    from stiffdice.archive.verify import CRATE, verify

    text = b"a,b\n1,2\n"
    digest = hashlib.sha256(text).hexdigest()
    files = [{"@id": f"a {k}.csv", "@type": "File", "contentSize": str(len(text)), "sha256": digest} for k in range(3)]
    graph = [{"@id": CRATE, "about": {"@id": "./"}}, {"@id": "./", "@type": "Dataset", "hasPart": files}, *files]
    sample = json.dumps({"@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph}, indent=1).encode()

    def attempt(data: bytes, _: bytes, folder: Path) -> None:
        crate = folder / "crate"
        crate.mkdir()
        contents = {CRATE: data} | {f"a {k}.csv": text for k in range(3)}
        digests = {name: hashlib.sha256(content).hexdigest() for name, content in contents.items()}
        for name, content in (contents | {manifest.NAME: manifest.text_of(digests).encode()}).items():
            (crate / name).write_bytes(content)
        for line in verify(crate).lines():
            assert line.isprintable(), repr(line)
        _cleared(crate)

    return Reader([sample], mutations.text_of, attempt)


def _cleared(folder: Path) -> None:
    import shutil

    shutil.rmtree(folder)


def _images(folder: Path) -> Iterator[bytes]:
    """Yield files of ours as HDF5 wrote them: a whole one, and one that grew."""
    from tests.io.test_structure_check import whole

    from stiffdice.io import seal
    from stiffdice.io.shard_writer import Spool
    from stiffdice.io.writer import write_dataset

    write_dataset(whole(), folder / "whole.h5")
    given = whole().drop_vars("total")
    with Spool(folder / "grown.h5", given.isel(cell=slice(1))) as spool:
        first = spool.add_cells(given.sizes["cell"])
        spool.put({name: given[name].values for name in ("ratio", "verdict", "stiffness")}, slice(first, None))
    for name in ("whole.h5", "grown.h5"):
        yield (folder / name).read_bytes()[: -seal.LENGTH]


def damaged_files(folder: Path) -> Reader:
    """Files whose seal was not renewed: read as they were, or not at all."""
    import xarray as xr

    from stiffdice.io import seal
    from stiffdice.io.reader import open_file

    samples = [image + seal.line_of(image) for image in _images(folder)]
    sound = {}
    for sample in samples:
        (folder / "x.h5").write_bytes(sample)
        sound[sample] = open_file(folder / "x.h5")

    def attempt(data: bytes, sample: bytes, folder: Path) -> None:
        path = folder / "x.h5"
        path.write_bytes(data)
        try:
            found = open_file(path)
        except InputError as error:
            told(error, path)
        else:
            assert data in sound, "a changed file was read"
            xr.testing.assert_identical(found, sound[data])

    return Reader(samples, mutations.bytes_of, attempt)


def forged_files(folder: Path) -> Reader:
    """Files whose seal was renewed, in another process first: refused there, or all that reads them gets through."""
    from stiffdice.io import isolation, seal
    from stiffdice.io.reader import open_file, parts
    from stiffdice.report import file_page

    places: dict[bytes, Path] = {}
    errors: dict[str, InputError] = {}

    def before(images: list[bytes], folder: Path) -> None:
        """Try them in one other process, as far as none ends it."""
        places.clear()
        places.update((image, folder / f"{number}.h5") for number, image in enumerate(images))
        for image, path in places.items():
            path.write_bytes(image + seal.line_of(image))
        errors.clear()
        errors.update(isolation.refused(places.values()))

    def attempt(data: bytes, _: bytes, __: Path) -> None:
        path = places[data]
        error = errors.get(str(path))
        if error and "the HDF5 library fails" in str(error):  # or the child did
            error = _tried(path)
        if error is not None:
            told(error, path)
            return
        try:
            found = open_file(path)
            for part in parts(path, 50) if "cell" in found.sizes else ():
                assert set(part.variables) == set(found.variables)
        except InputError as refusal:
            told(refusal, path)
            return
        for variable in found.variables.values():
            assert variable.attrs["units"]
        assert file_page.as_text(found, "x.h5")
        json.loads(file_page.as_json(found))

    return Reader(list(_images(folder)), hdf5_blocks.changed, attempt, before)


def tosses(folder: Path) -> Reader:
    """Files of measured tosses, in another process first: refused there, or read as tosses that are whole."""
    import numpy as np
    from tests import toss_files

    from stiffdice.scene import tosses as files

    def attempt(data: bytes, _: bytes, folder: Path) -> None:
        path = folder / "x.h5"
        path.write_bytes(data)
        error = _tried(path, files.__name__)
        try:
            if error is not None:
                raise error
            found = files.load(path)
        except InputError as refusal:
            told(refusal, path)
            return
        assert found.counts.sum() == len(found.position) == len(found.orientation)
        assert all(np.isfinite(part).all() for part in found)

    few = [toss_files.stored(toss_files.some(count), folder / f"{count}.h5").read_bytes() for count in (1, 2)]
    return Reader([*few, toss_files.REAL.read_bytes()], _changed_or_cut, attempt)


def _changed_or_cut(sample: bytes, samples: list[bytes], seed: int) -> bytes:
    """Return a file changed in its structure, or anywhere."""
    spoil = hdf5_blocks.changed if seed % 4 and hdf5_blocks.blocks(sample) else mutations.bytes_of
    return spoil(sample, samples, seed)


def _tried(path: Path, module: str = "") -> InputError | None:
    from stiffdice.io import isolation

    honest, states = isolation.tried, []

    def watched(paths: list[str], module: str) -> Any:
        answers, status = honest(paths, module)
        states.append(status)
        return answers, status

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(isolation, "tried", watched)
        error = isolation.refused([path], module or isolation.OURS).get(str(path))
    assert states != [1], "the child itself failed, and not the library"
    return error


READERS = {
    "scene": lambda _: scenes(),
    "set": lambda _: overrides(),
    "study": lambda _: studies(),
    "manifest": lambda _: manifests(),
    "zip": lambda _: archives(),
    "crate": lambda _: crates(),
    "damaged": damaged_files,
    "forged": forged_files,
    "tosses": tosses,
}

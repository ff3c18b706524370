"""Films of the published streets, kept in the user's cache folder for later runs.

Making such a film takes thirty times as long as reading it. A file has 2 MB, those of the
benchmark's streets together a sixth of a gigabyte. Code, libraries and processor are part of the
key: the film of another maker is replaced.
"""

import hashlib
import pickle
import platform
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pyarrow as pa

from care_sim.base.errors import InvalidInput
from care_sim.base.files import cache_folder, replacing
from care_sim.base.seeds import SPLITS
from care_sim.core.arrays import Floats
from care_sim.core.cells.stack import Grid
from care_sim.core.conditions import RAYS, FilmedReturns
from care_sim.loops.film import Film
from care_sim.sensors.annotated import NO_RETURNS, Cloud
from care_sim.sensors.setups import sensor_setup
from care_sim.sources.scenes import Scene, Source, Streets
from care_sim.streets.street import street_name
from care_sim.study.provenance import machine, versions

_HEAD = hashlib.sha256().digest_size
_LAST_BITS = 4
"""The norm of a point is no farther from the range that made it, in steps of a float."""


def kept_film(source: Source, scene: Scene, returns: FilmedReturns) -> Film:
    """Return the film of a scene: of a published street, in plain rays, the kept one.

    Raises InvalidInput where the film cannot be made.
    """
    if type(source) is not Streets or returns != RAYS or not _is_published(scene):
        return source.film(scene, returns)
    setup = repr(sensor_setup(source.sensor)).encode()
    file = cache_folder("films") / f"{scene.name}-{hashlib.sha256(setup).hexdigest()[:8]}.film"
    key = setup + _maker()
    film = _read(file, key)
    if film is None:
        film = source.film(scene, returns)
        _keep(film, file, key)
    return film


@cache
def _maker() -> bytes:
    """Return what decides the bits of a film besides its street and set-up."""
    return repr([versions(), platform.system(), machine()["processor"]]).encode()


def _is_published(scene: Scene) -> bool:
    """Whether studies and the benchmark play the scene again and again."""
    return scene.seed in SPLITS["test"] and scene.name == street_name(scene.seed)


def _read(file: Path, key: bytes) -> Film | None:
    """Return the kept film, None without a whole one of this key."""
    try:
        content = file.read_bytes()
    except OSError:
        return None
    head, packed = content[:_HEAD], content[_HEAD:]
    # Unpickling runs code: a damaged file, or one of other code, is not unpickled.
    if head != _head(key, packed):
        return None
    film, ranges = pickle.loads(pa.CompressedInputStream(pa.BufferReader(packed), "zstd").read())
    cells = [shot.cloud.cells for shot in film.shots]
    return _with_points(film, map(film.grid.points, cells, ranges))


def _keep(film: Film, file: Path, key: bytes) -> None:
    ranges = [_ranges(shot.cloud, film.grid) for shot in film.shots]
    if any(own is None for own in ranges):
        return
    bare = _with_points(film, [NO_RETURNS.points] * len(ranges))
    packed = pa.compress(pickle.dumps((bare, ranges)), codec="zstd", asbytes=True)
    # Nothing may be written there, or another process writes the same.
    with suppress(OSError, InvalidInput), replacing(file) as unfinished:
        unfinished.write_bytes(_head(key, packed) + packed)


def _head(key: bytes, packed: bytes) -> bytes:
    return hashlib.sha256(key + packed).digest()


def _ranges(cloud: Cloud, grid: Grid) -> Floats | None:
    """Return the ranges (n,) of which `grid.points` makes the very points of a cloud, None where
    there are none. They take a third of the room.
    """
    cells, ranges = cloud.cells, grid.ranges_to(cloud.cells, cloud.points)
    steps = np.spacing(ranges)
    wrong = np.arange(len(cells))
    for step in sorted(range(-_LAST_BITS, _LAST_BITS + 1), key=abs):
        tried = ranges[wrong] + step * steps[wrong]
        exact = (grid.points(cells[wrong], tried) == cloud.points[wrong]).all(axis=1)
        ranges[wrong[exact]] = tried[exact]
        wrong = wrong[~exact]
    return None if len(wrong) else ranges


def _with_points(film: Film, points: Iterable[Floats]) -> Film:
    shots = [
        replace(shot, cloud=replace(shot.cloud, points=own))
        for shot, own in zip(film.shots, points, strict=True)
    ]
    return replace(film, shots=tuple(shots))

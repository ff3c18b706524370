"""Points of one sweep, from a PCD, NPY, CSV or BIN file, and times in one of the usual units."""

import os
from collections.abc import Callable, Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats
from care_sim.perception.csv_tables import columns_of, read_csv
from care_sim.sources.film_checks import REACH_M
from care_sim.sources.nuscenes.sweeps import FULL_INTENSITY, MOST_SWEEP_BYTES, RINGS

UNITS_S = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
"""Times from so large a number on are counts of nanoseconds, microseconds, milliseconds since 1970;
smaller ones are seconds.
"""


def in_seconds(times: Floats) -> Floats:
    """Return `times` (n,) in seconds, whichever of the `UNITS_S` they are."""
    most = np.abs(times).max(initial=0.0)
    return times * next((unit for least, unit in UNITS_S if most >= least), 1.0)


_AXES = ("x", "y", "z")
COLUMNS = (*_AXES, "intensity", "ring")
"""Columns of every point; other columns of files are left out."""
_MOST_HEADER_LINES = 100
_KINDS = {"F": "f", "I": "i", "U": "u"}


def read_sweep(path: Path) -> Floats:
    """Return the points (n, 5) of a sweep: x, y, z as the file has them, metres, intensity and
    ring, each NaN where the file does not tell it. Intensities above 1 are taken for shares of 255.

    - PCD: fields x, y, z, and intensity and ring if there are, `DATA ascii` or `binary`.
    - NPY: an array (n, 3 or more) that begins with x, y, z, intensity, ring.
    - CSV: columns x, y, z, and intensity and ring if there are; or no heading and x, y, z first.
    - BIN: float32 x, y, z, intensity (KITTI), with a whole ring behind them in nuScenes' form.

    Raises InvalidInput with the path for a file that is missing, too large or of another form, and
    as `checked_points` does.
    """
    if not os.path.isfile(path):
        raise InvalidInput(f"{path}: no such file")
    if path.stat().st_size > MOST_SWEEP_BYTES:
        raise InvalidInput(f"{path}: a sweep may hold {MOST_SWEEP_BYTES} bytes")
    try:
        points = READERS[path.suffix](path)
    except InvalidInput:
        raise
    except KeyError as error:
        raise InvalidInput(f"{path}: no sweep (it lacks {error})") from error
    except (OSError, ValueError, TypeError, OverflowError, MemoryError) as error:
        raise InvalidInput(f"{path}: no sweep ({' '.join(str(error).split())[:200]})") from error
    return checked_points(path, points)


def _full(points: Floats) -> Floats:
    """(n, 5) of points (n, 3 or more), intensities from 0 to 1."""
    full = np.full((len(points), len(COLUMNS)), np.nan)
    full[:, : points.shape[1]] = points[:, : len(COLUMNS)]
    if np.nanmax(full[:, 3], initial=0) > 1:
        full[:, 3] = np.clip(full[:, 3] / FULL_INTENSITY, 0, 1)
    return full


def checked_points(place: object, points: Floats) -> Floats:
    """Return the points without rays that met nothing: NaN in x, y and z (as PCL writes them).

    Raises InvalidInput with the `place` where no point is left, and for one that is not finite or
    farther than any LiDAR reaches.
    """
    points = points[~np.isnan(points[:, :3]).all(axis=1)]
    if not len(points):
        raise InvalidInput(f"{place}: no points")
    near = (np.abs(points[:, :3]) <= REACH_M[1]).all(axis=1)
    if not near.all():
        wrong = int(near.argmin())
        raise InvalidInput(
            f"{place}: point {wrong} lies at {points[wrong, :3].tolist()}, must be metres within "
            f"{REACH_M[1]:g}"
        )
    return _full(points)


def _pcd(path: Path) -> Floats:
    with path.open("rb") as file:
        header: dict[str, list[str]] = {}
        for line in islice(file, _MOST_HEADER_LINES):
            key, *values = line.decode("ascii").split() or ("",)
            header[key] = values
            if key == "DATA":
                break
        body = file.read()
    (form,), (points,) = header["DATA"], map(int, header["POINTS"])
    if points < 0:
        raise ValueError(f"{points} points")
    names = header["FIELDS"]
    counts = [int(count) for count in header.get("COUNT", ["1"] * len(names))]
    if form == "ascii":
        starts = dict(zip(names, np.cumsum([0, *counts]).tolist(), strict=False))
        table = np.array(body.decode("ascii").split(), dtype=float).reshape(points, -1)
        return _by_name({name: table[:, start] for name, start in starts.items()})
    if form != "binary":
        raise ValueError(f"DATA {form}, must be ascii or binary")
    # Padding may have one name several times.
    numbers = zip(header["TYPE"], header["SIZE"], strict=True)
    fields = zip(names, numbers, counts, strict=True)
    kind = np.dtype(
        [
            (name if name in COLUMNS else f"{place} {name}", f"<{_KINDS[letter]}{size}", (count,))
            for place, (name, (letter, size), count) in enumerate(fields)
        ]
    )
    rows = np.frombuffer(body, kind, points)
    return _by_name({name: rows[name][:, 0] for name in COLUMNS if name in names})


def _by_name(columns: Mapping[str, Any]) -> Floats:
    """(n, 5) columns by their names, of which x, y and z must be there."""
    count = len(columns["x"])
    lacking = {name: np.full(count, np.nan) for name in COLUMNS[len(_AXES) :]}
    known = {name: columns[name] for name in COLUMNS if name in columns or name in _AXES}
    return np.column_stack([(lacking | known)[name] for name in COLUMNS]).astype(float)


def _npy(path: Path) -> Floats:
    # Mapped: an array that says it has billions of numbers is refused by the file's length.
    array = np.asarray(np.lib.format.open_memmap(path, mode="r"))
    if array.ndim != 2 or array.shape[1] < 3 or array.dtype.kind not in "fiu":
        raise ValueError(f"must be numbers (n, 3 or more), got {array.dtype} {array.shape}")
    return array[:, : len(COLUMNS)].astype(float)


def _csv(path: Path) -> Floats:
    with path.open("rb") as file:
        first = file.readline(1000).split(b",")[0].strip()
    # A first line of numbers is no heading.
    try:
        float(first)
    except ValueError:
        table = read_csv(path)
        known = [name for name in COLUMNS if name in _AXES or name in table.column_names]
        return _by_name(dict(zip(known, columns_of(path, table, known).T, strict=True)))
    table = read_csv(path, headless=True)
    return columns_of(path, table, ("f0", "f1", "f2"))


def _bin(path: Path) -> Floats:
    values = np.fromfile(path, "<f4")
    with np.errstate(invalid="ignore"):
        for count in (5, 4):
            if values.size % count == 0 and path.stat().st_size == values.nbytes:
                rows = values.reshape(-1, count)
                rings = rows[:, 4] if count == 5 else np.zeros(1)
                if ((rings >= 0) & (rings < RINGS) & (rings == np.rint(rings))).all():
                    return rows.astype(float)
    raise ValueError("must hold float32 x, y, z, intensity and perhaps a whole ring")


READERS: dict[str, Callable[[Path], Floats]] = {
    ".pcd": _pcd,
    ".npy": _npy,
    ".csv": _csv,
    ".bin": _bin,
}
"""Reader of a file, by the end of its name."""

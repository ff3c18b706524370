"""The tables of an Argoverse 2 log, Feather files: annotations, poses of the car and sweeps. They
are checked, and what is missing or broken is named in one line.
"""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow
from numpy.typing import NDArray
from pyarrow import feather, types

from care_sim.base.errors import InvalidInput, shown, unknown
from care_sim.core.arrays import Floats, Integers
from care_sim.sources.film_checks import (
    AWAY_M,
    MAP_M,
    REACH_M,
    SIZES_M,
    STAMPS_NS,
    ValueRange,
    check_span,
    quaternion_fault,
)

Columns = dict[str, NDArray[Any]]


def read_columns(
    path: Path,
    kinds: Mapping[str, type],
    ranges: Mapping[str, ValueRange],
    optional: Collection[str] = (),
) -> Columns:
    """The named columns of a Feather file as arrays of the given kinds, int, float or str; numbers
    lie in their ranges. `optional` ones are left out where the file lacks them.

    Raises InvalidInput for a file that is missing or truncated, lacks a column, holds another kind
    in it, or has an empty or infinite value, or one beyond its range.
    """
    try:
        with path.open("rb") as file:
            table = feather.read_table(file)
        table.validate(full=True)
        # Names that are no UTF-8 show only when they are read.
        names = table.column_names
    except FileNotFoundError:
        raise InvalidInput(f"{path}: no such file") from None
    except (OSError, pyarrow.ArrowException, UnicodeDecodeError) as error:
        raise InvalidInput(f"{path}: no readable Feather file ({_first_line(error)})") from error
    kinds = {n: kind for n, kind in kinds.items() if n in names or n not in optional}
    ranges = {n: ends for n, ends in ranges.items() if n in kinds}
    for name in kinds:
        count = names.count(name)
        if count != 1:
            found = "lacks the column" if not count else f"has {count} columns"
            raise InvalidInput(f"{path}: {found} {name!r}; needed: {', '.join(kinds)}")
    columns = {name: _column(path, table[name], name, kind) for name, kind in kinds.items()}
    for name, (least, most) in ranges.items():
        fits = (columns[name] >= least) & (columns[name] <= most)
        if not fits.all():
            row = fits.argmin()
            got = f"got {columns[name][row]:g} in row {row}"
            raise InvalidInput(f"{path}: column {name!r} must lie in [{least:g}, {most:g}], {got}")
    return columns


def _column(path: Path, column: pyarrow.ChunkedArray, name: str, kind: type) -> NDArray[Any]:
    if not _HOLDS[kind](column.type):
        raise InvalidInput(
            f"{path}: column {name!r} must hold {kind.__name__} values, has {column.type}"
        )
    if column.null_count:
        raise InvalidInput(f"{path}: column {name!r} has {column.null_count} empty values")
    values: NDArray[Any] = np.asarray(column.to_pylist() if kind is str else column, dtype=kind)
    if kind is float and not np.isfinite(values).all():
        raise InvalidInput(
            f"{path}: column {name!r} has a value that is not finite, in row "
            f"{np.isfinite(values).argmin()}"
        )
    return values


def _is_text(kind: pyarrow.DataType) -> bool:
    kind = kind.value_type if types.is_dictionary(kind) else kind
    return bool(types.is_string(kind) or types.is_large_string(kind))


_HOLDS: dict[type, Callable[[pyarrow.DataType], bool]] = {
    int: types.is_integer,
    float: lambda kind: types.is_floating(kind) or types.is_integer(kind),
    str: _is_text,
}


def _first_line(error: Exception) -> str:
    return (str(error).splitlines() or [type(error).__name__])[0]


ARGOVERSE2_CATEGORIES: dict[str, str | None] = {
    "REGULAR_VEHICLE": "car",
    "BOX_TRUCK": "truck",
    "LARGE_VEHICLE": "truck",
    "TRUCK": "truck",
    "TRUCK_CAB": "truck",
    "ARTICULATED_BUS": "bus",
    "BUS": "bus",
    "SCHOOL_BUS": "bus",
    "BICYCLE": "bicycle",
    "OFFICIAL_SIGNALER": "pedestrian",
    "PEDESTRIAN": "pedestrian",
    # Outside the five classes: bodies that occlude, and that nobody reports. Riders have boxes of
    # their own; as in nuScenes the bicycle counts, once, and its rider does not.
    "ANIMAL": None,
    "BICYCLIST": None,
    "BOLLARD": None,
    "CONSTRUCTION_BARREL": None,
    "CONSTRUCTION_CONE": None,
    "DOG": None,
    "MESSAGE_BOARD_TRAILER": None,
    "MOBILE_PEDESTRIAN_CROSSING_SIGN": None,
    "MOBILE_PEDESTRIAN_SIGN": None,
    "MOTORCYCLE": None,
    "MOTORCYCLIST": None,
    "RAILED_VEHICLE": None,
    "SIGN": None,
    "STOP_SIGN": None,
    "STROLLER": None,
    "TRAFFIC_LIGHT_TRAILER": None,
    "VEHICULAR_TRAILER": None,
    "WHEELCHAIR": None,
    "WHEELED_DEVICE": None,
    "WHEELED_RIDER": None,
}
"""The class of every category of the taxonomy, None outside the five classes."""
RECORDING_CAR = "EGO_VEHICLE"
"""The category of the recording car itself, which is no object of its own film."""

POSE_FILE = "city_SE3_egovehicle.feather"
PLAIN_ANNOTATIONS = "annotations.feather"
ANNOTATION_FILES = "annotations*.feather"
LEAST_SWEEP_NS = 10**7
"""No LiDAR turns faster. Sweeps of 10 Hz in microseconds would seem to be 0.1 ms apart."""
PLACE = ("tx_m", "ty_m", "tz_m")
TURN = ("qx", "qy", "qz", "qw")
SIZE = ("length_m", "width_m", "height_m")
_POSE_TYPES = {"timestamp_ns": int, **dict.fromkeys((*PLACE, *TURN), float)}
_BOX_TYPES = {
    **_POSE_TYPES,
    **dict.fromkeys(SIZE, float),
    "track_uuid": str,
    "category": str,
    "num_interior_pts": int,
}
_POSE_RANGES = {"timestamp_ns": STAMPS_NS, **dict.fromkeys(PLACE, MAP_M)}
_BOX_RANGES = {
    "timestamp_ns": STAMPS_NS,
    **dict.fromkeys(PLACE, AWAY_M),
    **dict.fromkeys(SIZE, SIZES_M),
}


def annotation_file(log: Path) -> Path:
    """Return the file of the annotations of a log: the plain name, or the only other one.

    Raises InvalidInput where there is none, or several that are not called by the plain name.
    """
    plain = log / PLAIN_ANNOTATIONS
    found = [plain] if plain.exists() else sorted(log.glob(ANNOTATION_FILES))
    if not found:
        raise InvalidInput(f"{log / ANNOTATION_FILES}: no such file")
    if len(found) > 1:
        names = ", ".join(path.name for path in found)
        raise InvalidInput(f"{log}: {names}: call the right one {PLAIN_ANNOTATIONS}")
    return found[0]


def read_boxes(path: Path) -> tuple[Integers, Columns]:
    """The annotated timestamps (n,), ascending, and the checked annotations, without the recording
    car, each with the `number` of its track in the film.

    Raises InvalidInput for a file that is missing, truncated or incomplete, an unknown category, a
    box that no drive holds (`care_sim.sources.film_checks`), an object annotated twice at once.
    """
    boxes = read_columns(path, _BOX_TYPES, _BOX_RANGES)
    # A sweep that annotates the recording car alone is annotated too: nobody else is there.
    sweeps = np.unique(boxes["timestamp_ns"])
    kept = boxes["category"] != RECORDING_CAR
    boxes = {name: column[kept] for name, column in boxes.items()}
    if not kept.any():
        raise InvalidInput(f"{path}: no annotations")
    check_span(path, (sweeps[-1] - sweeps[0]) * 1e-9)
    least_ns = np.diff(sweeps).min(initial=LEAST_SWEEP_NS)
    if least_ns < LEAST_SWEEP_NS:
        raise InvalidInput(
            f"{path}: two sweeps {least_ns * 1e-6:g} ms apart: timestamp_ns must be nanoseconds, "
            f"and sweeps at least {LEAST_SWEEP_NS * 1e-6:g} ms apart"
        )
    for category in np.unique(boxes["category"]).tolist():
        if category not in ARGOVERSE2_CATEGORIES:
            raise InvalidInput(f"{path}: {unknown('category', category, ARGOVERSE2_CATEGORIES)}")
    # Tracks are numbered in the order of their ids, wherever in the file they come.
    numbers = np.unique(boxes["track_uuid"], return_inverse=True)[1]
    fault = quaternion_fault(table(boxes, TURN))
    if fault is not None:
        raise InvalidInput(f"{path}: {_seen(boxes, fault[0])} has {fault[1]}")
    again = _first_again(np.column_stack([boxes["timestamp_ns"], numbers]))
    if again is not None:
        raise InvalidInput(f"{path}: {_seen(boxes, again)} is annotated twice")
    return sweeps, boxes | {"number": numbers}


def read_poses(path: Path) -> Columns:
    """The checked poses of the car, in order of time.

    Raises InvalidInput for a file that is missing, truncated or incomplete, a pose that no drive
    holds (`care_sim.sources.film_checks`), two poses at once.
    """
    poses = read_columns(path, _POSE_TYPES, _POSE_RANGES)
    stamps = poses["timestamp_ns"]
    again = _first_again(stamps[:, None])
    if again is not None:
        raise InvalidInput(f"{path}: two poses at {stamps[again]}")
    fault = quaternion_fault(table(poses, TURN))
    if fault is not None:
        raise InvalidInput(f"{path}: the pose at {stamps[fault[0]]} has {fault[1]}")
    order = np.argsort(stamps)
    return {name: column[order] for name, column in poses.items()}


_OF_LASERS = ("intensity", "laser_number")


def read_points(path: Path) -> Floats:
    """(n, 5) the points of a sweep in the frame of the car, corrected for its motion, with their
    intensities from 0 to 1 and the numbers of their lasers.

    Raises InvalidInput for a file that is missing, truncated or incomplete, or a point beyond the
    reach of any LiDAR.
    """
    places = ("x", "y", "z")
    reaches = dict.fromkeys(places, REACH_M) | dict.fromkeys(_OF_LASERS, (0, 255))
    kinds = dict.fromkeys((*places, *_OF_LASERS), float)
    columns = read_columns(path, kinds, reaches, optional=_OF_LASERS)
    unknown = np.full(len(columns["x"]), np.nan)
    intensities = columns.get("intensity", unknown) / 255
    lasers = columns.get("laser_number", unknown)
    return np.column_stack([table(columns, places), intensities, lasers])


def _seen(boxes: Columns, row: int) -> str:
    return f"the track {shown(str(boxes['track_uuid'][row]))} at {boxes['timestamp_ns'][row]}"


def _first_again(rows: Integers) -> int | None:
    """The first of rows (n, k) that stands further up as well."""
    # `np.unique` gives where each different row stands first; all other rows repeat one.
    repeated = np.ones(len(rows), dtype=bool)
    repeated[np.unique(rows, axis=0, return_index=True)[1]] = False
    return int(repeated.argmax()) if repeated.any() else None


def table(columns: Columns, names: tuple[str, ...]) -> Floats:
    """(n, k) the named columns side by side."""
    return np.column_stack([columns[name] for name in names]).astype(float)

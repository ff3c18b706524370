"""Logs: the times of their sweeps, and where the car was."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import FULL_TURN, Frame
from care_sim.perception.csv_tables import columns_of, read_csv
from care_sim.sources.film_checks import MAP_M, check_span, quaternion_fault
from care_sim.sources.sweeps.points import READERS, in_seconds, read_sweep

SWEEPS_KEYFRAME_S = 0.5
"""Keyframes are as far apart as those of nuScenes."""
LONGEST_GAP_S = 1.0
"""Poses farther apart are not interpolated."""
FASTEST_MPS = 100.0
"""No car drives so fast: places or times are in another unit."""
ASIDE = np.pi / 4
"""Radians: no car drives so far off its heading."""


@dataclass(frozen=True)
class Log:
    """Sweeps at `times_s` (n,), of which `points_of` reads one by its number, and `poses` (m, 8) of
    the car: seconds, x, y, z, quaternion x, y, z, w. A single pose is that of a car that stands.

    `name` is that of the scene. Errors name the sweeps' `source` and the poses' `pose_source`.
    Raises InvalidInput for what no drive holds.
    """

    name: str
    source: str
    times_s: Floats
    points_of: Callable[[int], Floats]
    poses: Floats
    pose_source: str

    def __post_init__(self) -> None:
        _check_times(self.source, self.times_s)
        _check_times(self.pose_source, self.poses[:, 0])
        if not (np.abs(self.poses[:, 1:4]) <= MAP_M[1]).all():
            raise InvalidInput(f"{self.pose_source}: x, y and z must lie within {MAP_M[1]:g} m")
        fault = quaternion_fault(self.poses[:, 4:])
        if fault is not None:
            raise InvalidInput(f"{self.pose_source}: pose {fault[0]} has {fault[1]}")
        _check_drive(self.pose_source, self.poses)

    def keyframes(self) -> Integers:
        """Return the numbers of the sweeps that are nearest to every half second.

        Raises InvalidInput where there is none within a quarter of a second.
        """
        start, end = self.times_s[0], self.times_s[-1]
        moments = np.arange(start, end + SWEEPS_KEYFRAME_S / 10, SWEEPS_KEYFRAME_S)
        rows = np.searchsorted((self.times_s[1:] + self.times_s[:-1]) / 2, moments)
        gaps = np.abs(self.times_s[rows] - moments)
        if gaps.max() > SWEEPS_KEYFRAME_S / 2:
            raise InvalidInput(
                f"{self.source}: no sweep within {SWEEPS_KEYFRAME_S / 2:g} s of second "
                f"{moments[gaps.argmax()] - start:g} of the log"
            )
        return np.unique(rows)

    def cars(self, times_s: Floats) -> list[Frame]:
        """Return the frame of the car at `times_s` (k,), interpolated. The world begins at the
        first pose.

        Raises InvalidInput for a time without poses at most a second apart round it.
        """
        known, places = self.poses[:, 0], self.poses[:, 1:4] - self.poses[0, 1:4]
        if len(known) == 1:
            return [Frame.turned_by(self._turns[0], places[0])] * len(times_s)
        after = np.clip(np.searchsorted(known, times_s), 1, len(known) - 1)
        # Half a sweep may lie beyond the first or the last pose.
        beyond = np.maximum(known[0] - times_s, times_s - known[-1]) > SWEEPS_KEYFRAME_S / 10
        wrong = beyond | (known[after] - known[after - 1] > LONGEST_GAP_S)
        if wrong.any():
            raise InvalidInput(
                f"{self.source}: the sweep at {times_s[wrong.argmax()]:.3f} s has no pose; poses "
                f"of {self.pose_source} go from {known[0]:.3f} to {known[-1]:.3f} s and must be at "
                f"most {LONGEST_GAP_S:g} s apart"
            )
        times = np.clip(times_s, known[0], known[-1])
        between = np.column_stack([np.interp(times, known, column) for column in places.T])
        turns = Slerp(known, self._turns)(times)
        return [Frame.turned_by(*pose) for pose in zip(turns, between, strict=True)]

    @cached_property
    def _turns(self) -> Rotation:
        return Rotation.from_quat(self.poses[:, 4:])


def _check_times(source: str, times: Floats) -> None:
    if not (len(times) and np.isfinite(times).all()):
        raise InvalidInput(f"{source}: times must be finite, at least one")
    check_span(source, float(np.ptp(times)))
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        before, after = times[back[0] : back[0] + 2]
        raise InvalidInput(f"{source}: times must ascend, got {after:.6f} after {before:.6f} s")


def _check_drive(source: str, poses: Floats) -> None:
    """Raise InvalidInput for a car that is too fast, or drives sideways or backwards."""
    # Over half a second, so that centimetres of noise between dense poses are no speed.
    times = poses[:, 0]
    rows = np.unique(np.searchsorted(times, np.arange(times[0], times[-1], SWEEPS_KEYFRAME_S)))
    x, y = np.diff(poses[rows, 1:3], axis=0).T
    fastest = (np.hypot(x, y) / np.diff(times[rows])).max(initial=0.0)
    if fastest > FASTEST_MPS:
        raise InvalidInput(
            f"{source}: the car drives {fastest:.4g} m/s; x, y and z must be metres, times seconds"
        )
    drives = np.hypot(x, y) > 1.0
    if drives.any():
        yaws = Rotation.from_quat(poses[rows[:-1], 4:]).as_euler("ZYX")[:, 0]
        # Backwards for a while is no fault: the median counts.
        aside = np.abs((np.arctan2(y, x) - yaws + np.pi) % (2 * np.pi) - np.pi)
        off = float(np.median(aside[drives]))
        if off > ASIDE:
            raise InvalidInput(
                f"{source}: the car drives {np.degrees(off):.0f} degrees off its heading; yaw is "
                "that of the car's x axis, ahead, from the world's x towards y, radians"
            )


SWEEPS_FOLDER, POSES_FILE, TIMES_FILE = "sweeps", "poses.csv", "times.csv"


_TURN = ("qx", "qy", "qz", "qw")


_LEAST_NAME = 1e9
"""A whole number below this may be the number of a sweep, and is no time."""


def log_of_folder(folder: Path) -> Log:
    """Return the log in a folder: `sweeps/`, files of one kind, `poses.csv`, and `times.csv` where
    the names of the sweeps are not their times.

    Raises InvalidInput for what is missing or ambiguous.
    """
    sweeps = _sweep_files(folder / SWEEPS_FOLDER)
    times = _times(folder, sweeps)
    order = np.argsort(times, kind="stable")
    files = [sweeps[row] for row in order.tolist()]
    path = folder / POSES_FILE
    return Log(
        folder.name,
        str(folder / SWEEPS_FOLDER),
        times[order],
        lambda number: read_sweep(files[number]),
        _poses(path),
        str(path),
    )


def _sweep_files(folder: Path) -> list[Path]:
    found = sorted(path for path in folder.glob("*") if path.suffix in READERS)
    kinds = sorted({path.suffix for path in found})
    if len(kinds) != 1:
        raise InvalidInput(
            f"{folder}: sweeps must be files of one kind, {', '.join(READERS)}, got "
            f"{' and '.join(kinds) or 'none'}"
        )
    return found


def _times(folder: Path, sweeps: list[Path]) -> Floats:
    """Return (n,) the seconds of the sweeps, by `times.csv`, else by their names."""
    path = folder / TIMES_FILE
    if path.exists():
        table = read_csv(path)
        times = in_seconds(columns_of(path, table, ["time"])[:, 0])
        names = map(str, table["file"].to_pylist() if "file" in table.column_names else ())
        told = dict(zip(names, times.tolist(), strict=False))
        for sweep in sweeps:
            if sweep.name not in told:
                raise InvalidInput(f"{path}: no row of columns file and time for {sweep.name}")
        return np.array([told[sweep.name] for sweep in sweeps])
    for sweep in sweeps:
        whole, point, part = sweep.stem.partition(".")
        is_time = whole.isdecimal() and (part.isdecimal() if point else True)
        if not is_time or not (point or float(whole[:40]) >= _LEAST_NAME):
            raise InvalidInput(
                f"{sweep}: its name is no time: nano-, micro- or milliseconds since 1970, or "
                f"seconds with a decimal point; write {TIMES_FILE} with the columns file and time"
            )
    return in_seconds(np.array([float(sweep.stem[:40]) for sweep in sweeps]))


def _poses(path: Path) -> Floats:
    """Return (m, 8) seconds, x, y, z and quaternion x, y, z, w of the car."""
    if not path.is_file():
        raise InvalidInput(
            f"{path}: no such file; it holds the poses of the car, columns time, x, y, z (metres) "
            "and yaw (radians) or qx, qy, qz, qw; a single row where the car stands"
        )
    table = read_csv(path)
    place = columns_of(path, table, ("time", "x", "y", "z"))
    if "yaw" in table.column_names:
        (yaws,) = columns_of(path, table, ["yaw"]).T
        wrong = ~(np.abs(yaws) <= FULL_TURN)
        if wrong.any():
            got = shown(float(yaws[wrong.argmax()]))
            raise InvalidInput(f"{path}: yaw must be radians within a full turn, got {got}")
        turns = Rotation.from_euler("Z", yaws[:, None]).as_quat()
    else:
        turns = columns_of(path, table, _TURN)
    return np.column_stack([in_seconds(place[:, 0]), place[:, 1:], turns])

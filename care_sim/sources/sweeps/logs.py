"""What a log holds: the times of its sweeps, and where the car was."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.sources.plausible import MAP_M, check_span, quaternion_fault

SWEEPS_KEYFRAME_S = 0.5
"""Keyframes are as far apart as those of nuScenes."""
LONGEST_GAP_S = 1.0
"""Between two poses nothing farther apart is interpolated."""
FASTEST_MPS = 100.0
"""No car drives so fast: places are in another unit then, or times are."""
ASIDE = np.pi / 4
"""Radians: no car drives so far off its heading."""


@dataclass(frozen=True)
class Log:
    """Sweeps at `times_s` (n,), ascending, of which `points_of` reads one by its number, and the
    poses of the car: `pose_times_s` (m,), `places` (m, 3) and `turns` (m,). A single pose is that
    of a car that stands. `name` is that of the scene, `source` what complaints name.
    """

    name: str
    source: str
    times_s: Floats
    points_of: Callable[[int], Floats]
    pose_times_s: Floats
    places: Floats
    turns: Rotation

    @classmethod
    def of(
        cls,
        name: str,
        source: str,
        times_s: Floats,
        points_of: Callable[[int], Floats],
        poses: Floats,
        poses_from: str,
    ) -> "Log":
        """The log of sweeps and `poses` (m, 8): seconds, x, y, z, quaternion x, y, z, w, which
        were read `poses_from` somewhere. Raises InvalidInput for what no drive holds.
        """
        for what, times in ((source, times_s), (poses_from, poses[:, 0])):
            if not (len(times) and np.isfinite(times).all()):
                raise InvalidInput(f"{what}: times must be finite, at least one")
            back = np.flatnonzero(np.diff(times) <= 0)
            if len(back):
                raise InvalidInput(
                    f"{what}: times must ascend, got {times[back[0] + 1]:.6f} s after "
                    f"{times[back[0]]:.6f} s"
                )
            check_span(what, float(times[-1] - times[0]))
        places = poses[:, 1:4]
        if not ((places >= MAP_M[0]) & (places <= MAP_M[1])).all():
            raise InvalidInput(f"{poses_from}: x, y and z must lie in {list(MAP_M)} m")
        fault = quaternion_fault(poses[:, 4:])
        if fault is not None:
            raise InvalidInput(f"{poses_from}: pose {fault[0]} has {fault[1]}")
        _check_drive(poses_from, poses)
        return cls(
            name, source, times_s, points_of, poses[:, 0], places, Rotation.from_quat(poses[:, 4:])
        )

    @property
    def posed(self) -> tuple[float, float]:
        """The times of the first and the last pose."""
        return float(self.pose_times_s[0]), float(self.pose_times_s[-1])

    def keyframes(self) -> Integers:
        """Return the numbers of the sweeps that are nearest to every half second.

        Raises InvalidInput where there is none within a quarter of a second.
        """
        start, end = self.times_s[0], self.times_s[-1]
        moments = np.arange(start, end + SWEEPS_KEYFRAME_S / 10, SWEEPS_KEYFRAME_S)
        rows = np.searchsorted((self.times_s[1:] + self.times_s[:-1]) / 2, moments)
        gap = np.abs(self.times_s[rows] - moments)
        if gap.max() > SWEEPS_KEYFRAME_S / 2:
            far = moments[gap.argmax()] - start
            raise InvalidInput(
                f"{self.source}: no sweep within {SWEEPS_KEYFRAME_S / 2:g} s of second {far:g} of "
                "the log"
            )
        return np.unique(rows)

    def cars(self, times_s: Floats) -> list[Frame]:
        """Return the frame of the car at `times_s` (k,), interpolated. The world begins at the
        first pose.

        Raises InvalidInput for a time without poses at most a second apart round it.
        """
        known = self.pose_times_s
        if len(known) == 1:
            return [Frame.turned_by(self.turns[0], np.zeros(3))] * len(times_s)
        after = np.clip(np.searchsorted(known, times_s), 1, len(known) - 1)
        gaps = known[after] - known[after - 1]
        # A sweep is read as a whole, so half of one may lie beyond the first or last pose.
        beyond = np.maximum(known[0] - times_s, times_s - known[-1]) > SWEEPS_KEYFRAME_S / 10
        wrong = beyond | (gaps > LONGEST_GAP_S)
        if wrong.any():
            raise InvalidInput(
                f"{self.source}: the sweep at {times_s[wrong.argmax()]:.3f} s has no pose; poses "
                f"go from {known[0]:.3f} to {known[-1]:.3f} s and must be at most "
                f"{LONGEST_GAP_S:g} s apart"
            )
        times = np.clip(times_s, known[0], known[-1])
        start = self.places[0]
        places = [np.interp(times, known, column) for column in (self.places - start).T]
        turns = Slerp(known, self.turns)(times)
        return [
            Frame.turned_by(turn, place)
            for turn, place in zip(turns, np.column_stack(places), strict=True)
        ]


def _check_drive(source: str, poses: Floats) -> None:
    """Raise InvalidInput for a car that is too fast, or drives sideways."""
    # Over half a second, so that centimetres of noise between dense poses are no speed.
    times = poses[:, 0]
    rows = np.unique(np.searchsorted(times, np.arange(times[0], times[-1], SWEEPS_KEYFRAME_S)))
    ways = np.diff(poses[rows, 1:3], axis=0)
    lengths = np.hypot(*ways.T)
    fastest = (lengths / np.diff(times[rows])).max(initial=0.0)
    if fastest > FASTEST_MPS:
        raise InvalidInput(
            f"{source}: the car drives {fastest:.4g} m/s; x, y and z must be metres, times seconds"
        )
    drives = lengths > 1.0
    if drives.any():
        yaws = Rotation.from_quat(poses[rows[:-1], 4:]).as_euler("ZYX")[:, 0]
        off = (np.arctan2(ways[:, 1], ways[:, 0]) - yaws)[drives]
        # Backwards is no fault.
        aside = float(np.median(np.abs((off + np.pi / 2) % np.pi - np.pi / 2)))
        if aside > ASIDE:
            raise InvalidInput(
                f"{source}: the car drives {np.degrees(aside):.0f} degrees off its heading; yaw is "
                "that of the car's x axis, ahead, from the world's x towards y, radians"
            )

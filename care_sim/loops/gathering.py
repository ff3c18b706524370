"""Several sweeps as one cloud for a detector: each return with its time, all in the sensor frame of
the keyframe. The motion of the car is undone, in the closed loop as far as the car knows it, in a
film by its poses; that of others is not.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from care_sim.core.frames import Frame
from care_sim.core.types import Detections
from care_sim.loops.film import Shot
from care_sim.sensors.annotated import AT_KEYFRAME, Cloud, SweepPose, joined


def gather_sweeps(returned: Cloud, fire: Callable[[Cloud], Cloud], shot: Shot) -> Cloud:
    """The returns of a keyframe of a film, and what `fire` takes of the sweeps before it. Without
    sweeps the returns of the keyframe are as they were.
    """
    # Cells are those of the sensor as it stood then; faults are drawn for every sweep.
    earlier = [
        (shot.time_s - sweep.time_s, sweep.sensor, fire(sweep.cloud)) for sweep in shot.sweeps
    ]
    return _together(returned, shot.sensor, earlier)


class Gathering:
    """The last sweeps of the closed loop, as many as a detector needs."""

    def __init__(self, sweeps: int, keyframe_s: float):
        self._earlier: deque[tuple[Frame, Cloud]] = deque(maxlen=sweeps - 1)
        self._keyframe_s = keyframe_s

    def add(self, cloud: Cloud, taken_for: Frame) -> Cloud:
        """The returns of this keyframe with those before it. `taken_for`: where the car takes its
        sensor to be.
        """
        # The oldest comes first, as in a film.
        count = len(self._earlier)
        earlier = [
            ((count - row) * self._keyframe_s, frame, sweep)
            for row, (frame, sweep) in enumerate(self._earlier)
        ]
        self._earlier.append((taken_for, cloud))
        return _together(cloud, taken_for, earlier)


def _together(now: Cloud, sensor: Frame, earlier: list[tuple[float, Frame, Cloud]]) -> Cloud:
    """One cloud of the keyframe's returns and of `earlier` sweeps: seconds ago, frame, returns."""
    if not earlier:
        return now
    clouds = [_moved(now, sensor, sensor, 0.0)]
    clouds += [_moved(cloud, frame, sensor, ago) for ago, frame, cloud in earlier]
    # The latest sweep first.
    poses = [SweepPose(ago, _matrix(frame, sensor)) for ago, frame, _ in reversed(earlier)]
    return replace(joined(clouds), poses=(AT_KEYFRAME, *poses), newest=now)


def _moved(cloud: Cloud, sensor: Frame, to: Frame, ago_s: float) -> Cloud:
    """A sweep in another sensor frame, each return with its time."""
    return replace(
        cloud,
        points=cloud.points if sensor is to else to.points_of(sensor, cloud.points),
        times=(0.0 if cloud.times is None else cloud.times) + np.full(len(cloud), -ago_s),
        far=None if cloud.far is None else _moved(cloud.far, sensor, to, ago_s),
    )


def _matrix(sensor: Frame, to: Frame) -> np.ndarray:
    """(4, 4) moves points from one sensor frame into another."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    origin, *axes = to.points_of(sensor, corners)
    matrix = np.eye(4)
    matrix[:3, 3] = origin
    matrix[:3, :3] = (np.array(axes) - origin).T
    return matrix


def acted_on(reported: Detections, track_score: float) -> np.ndarray:
    """(n,) which detections are sure enough to become tracks; all of a detector without scores."""
    if reported.scores is None:
        return np.ones(len(reported), np.bool_)
    return np.asarray(reported.scores >= track_score)

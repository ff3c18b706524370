"""The truth about the coming keyframe, for privileged policies, scoring and training alone.

Truth is read from the running loop and never enters a `Belief`. Also the return data besides
ranges, for `info`.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.grid import Cells
from care_sim.core.types import Scan, Tracks
from care_sim.sensors.annotated import NO_OBJECT

_NO_CELL = -1
Told = dict[str, Floats]
"""By name, (n,) numbers of the fired cells, 0 of a cell without a return."""


def told_by(
    fired: Cells, cells: Cells, intensities: Floats | None = None, times_s: Floats | None = None
) -> Told:
    """Return columns (k,) of returns of `cells` (k,) as numbers per `fired` cell. Both kinds of
    cells ascend. The first of several returns of a cell counts, and each shot at a cell gets the
    same number. Columns that are None are left out.
    """
    if intensities is None and times_s is None:
        return {}
    # The place of the first return of every fired cell; behind the last one there is none.
    first = np.searchsorted(cells, fired)
    returned = np.append(cells, _NO_CELL)[first] == fired
    return {
        name: np.where(returned, np.append(values, 0.0)[first], 0.0)
        for name, values in (("intensities", intensities), ("times_s", times_s))
        if values is not None
    }


class TrueLoop(ABC):
    """The truth that either loop tells about its coming keyframe. The object behind a track is the
    one that it was last detected on.
    """

    def __init__(self) -> None:
        self.index = 0
        """The number of the coming keyframe."""
        self._objects: dict[int, int] = {}

    @abstractmethod
    def full_scan(self) -> Scan:
        """Return the scan of all cells now, before noise and dropout. Truth: for the privileged
        alone.
        """

    def true_objects(self, tracks: Tracks) -> Integers:
        """(n,) the objects behind tracks, NO_OBJECT for a track without one. In the closed loop
        these are bodies. Truth: for training and scoring alone.
        """
        objects = [self._objects.get(track, NO_OBJECT) for track in tracks.ids.tolist()]
        return np.array(objects, np.int64)

    def true_boxes(self, tracks: Tracks) -> Floats:
        """(n, 7) where the objects behind forecasts are now, in the sensor frame. A track without
        an object, or whose object is nowhere now, keeps its forecast. Truth: for the privileged
        alone.
        """
        # All objects are read at once: the closed loop reads their boxes off one table.
        behind = self.true_objects(tracks).tolist()
        present = self._present([number for number in behind if number != NO_OBJECT])
        boxes = tracks.boxes.copy()
        for row, number in enumerate(behind):
            if number != NO_OBJECT:
                boxes[row] = present.get(number, boxes[row])
        return boxes

    @abstractmethod
    def _present(self, objects: Sequence[int]) -> dict[int, Floats]:
        """The present boxes of objects, in the sensor frame, without those that are nowhere."""

    def _note(self, tracks: Integers, objects: Integers) -> None:
        """The tracks with the ids `tracks` (n,) were detected on `objects` (n,)."""
        # The last one counts: where the tracker changed its object, the truth changes with it.
        self._objects.update(zip(tracks.tolist(), objects.tolist(), strict=True))


class Truth:
    """The truth about the coming keyframe of an environment's running `loop`, from episode to
    episode.

    `make_policy` hands it to subclasses of `PrivilegedPolicy` and to nobody else. `Policy.told`
    holds public settings alone.
    """

    def __init__(self, env: Any):
        self._env = env

    @property
    def loop(self) -> Any:
        """The running loop, with all that is true in it."""
        return self._env.loop

    def boxes(self, tracks: Tracks) -> Floats:
        """(n, 7) true boxes, in the sensor frame, of the objects behind the tracks.

        A track without an object keeps its forecast.
        """
        boxes: Floats = self._env.loop.true_boxes(tracks)
        return boxes

    def full_scan(self) -> Scan:
        """Return the scan of all cells, before noise and dropout; `cells` ascend."""
        scan: Scan = self._env.loop.full_scan()
        return scan

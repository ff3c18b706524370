"""The types that the stages of a keyframe exchange.

Frames: sensor frame x forward, y left, z up; metres, seconds, radians. A box is (7,): centre x, y,
z, length, width, height, yaw. Velocities are over ground, in sensor axes. Nothing here carries a
body id of the simulator: truth stays in the world and in the scoring.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.core.cells.boxes import planar_ranges
from care_sim.core.grid import Cells

CLASSES = ("car", "truck", "bus", "bicycle", "pedestrian")
"""The five driving classes shared by both detectors and the scoring (paper, Sec. 5.1)."""
_EXACT = 2.0**53
"""Up to this a float holds every whole number."""

Action = NDArray[np.float32]
"""A score per cell, (E, A); see `care_sim.core.firing.actions`."""


@dataclass(frozen=True)
class Ego:
    """The car's own motion."""

    speed: float = 0.0
    """Along its heading, m/s; below 0 backwards."""
    yaw_rate: float = 0.0
    """rad/s, above 0 to the left."""
    acceleration: float = 0.0
    """Along its heading, m/s^2."""


@dataclass(frozen=True)
class Detections:
    """3D detections of one keyframe, in the sensor frame; `len()` is their number n."""

    classes: Integers
    """(n,) places in `CLASSES`."""
    boxes: Floats
    """(n, 7)."""
    returns: Integers
    """(n,) how many fired rays hit each."""
    scores: Floats | None = None
    """(n,) confidences from 0 to 1; None of a detector that has none."""
    velocities: Floats | None = None
    """(n, 2) over ground, in sensor axes, m/s; None without."""
    attributes: Sequence[str] | None = None
    """(n,) nuScenes attributes, "" where unknown; None without."""

    def __len__(self) -> int:
        return len(self.classes)

    def take(self, rows: Integers | Mask) -> "Detections":
        """Some of them, by index or mask."""
        return Detections(
            self.classes[rows],
            self.boxes[rows],
            self.returns[rows],
            None if self.scores is None else self.scores[rows],
            None if self.velocities is None else self.velocities[rows],
            None if self.attributes is None else np.asarray(self.attributes)[rows].tolist(),
        )


class _Table:
    """Columns of one table. Made from rows, it reads each column when it is first used, since few
    callers use all. `len()` is the number of rows n.
    """

    COLUMNS: ClassVar[tuple[str, ...]]
    _PLACES: ClassVar[Mapping[str, int | slice]]
    """Where in COLUMNS the attributes are."""
    _WHOLE: ClassVar[tuple[str, ...]]
    """The columns of whole numbers."""

    @classmethod
    def from_checked_rows(cls, table: Floats) -> Self:
        """The columns of rows (n, k) without padding, whose numbers are known to be in order. The
        table is theirs from now on.
        """
        made = cls.__new__(cls)
        vars(made).update(_table=table, _rows=_shared(table.view()))
        return made

    if not TYPE_CHECKING:  # for which any name would then be an attribute

        def __getattr__(self, name: str) -> Floats | Integers:
            if name not in self._PLACES:
                raise AttributeError(f"{type(self).__name__} has no attribute {name!r}")
            column = self._table[:, self._PLACES[name]]
            vars(self)[name] = column.astype(np.int64) if name in self._WHOLE else column
            return vars(self)[name]

    def __len__(self) -> int:
        return len(self._rows)

    def take(self, rows: NDArray[np.int64] | Mask) -> Self:
        """Some of the rows, by index or mask."""
        return self.from_checked_rows(self._rows[rows])

    def rows(self) -> Floats:
        """(n, k) table in the order of `COLUMNS`, read-only."""
        return self._rows

    @cached_property
    def _rows(self) -> Floats:
        columns = [getattr(self, name) for name in self._PLACES]
        table = np.empty((len(columns[0]), len(self.COLUMNS)))
        for place, column in zip(self._PLACES.values(), columns, strict=True):
            table[:, place] = column
        return _shared(table)


@dataclass(frozen=True)
class ImageDetections(_Table):
    """2D camera detections as columns of one table; `len()` is their number n."""

    classes: Integers
    """(n,) places in `CLASSES`."""
    confidences: Floats
    """(n,) from 0 to 1."""
    boxes: Floats
    """(n, 4) left, top, right, bottom in pixels."""
    cameras: Integers
    """(n,) places in `Rig.cameras`."""
    ages: Floats
    """(n,) seconds since the picture was taken."""
    yaw_changes: Floats
    """(n,) how far the car has turned since, radians."""

    COLUMNS = (
        "class", "confidence", "left", "top", "right", "bottom", "camera", "age", "yaw_change",
    )  # fmt: skip
    CLASS, CONFIDENCE, LEFT, CAMERA, AGE, YAW_CHANGE = 0, 1, 2, 6, 7, 8
    BOX = slice(2, 6)
    TIMING = slice(7, 9)
    """Places in COLUMNS."""
    _PLACES = {  # noqa: RUF012 (a constant)
        "classes": CLASS, "confidences": CONFIDENCE, "boxes": BOX, "cameras": CAMERA, "ages": AGE,
        "yaw_changes": YAW_CHANGE,
    }  # fmt: skip
    _WHOLE = ("classes", "cameras")

    @classmethod
    def from_rows(cls, rows: NDArray[np.floating]) -> "ImageDetections":
        """Read rows in the order of `COLUMNS`; rows of class -1 are padding.

        Raises InvalidInput for a class or a camera that is no number, or too large to be held
        exactly.
        """
        table: Floats = rows[rows[:, cls.CLASS] >= 0].astype(np.float64)
        _check_whole_columns("classes and cameras", table[:, [cls.CLASS, cls.CAMERA]])
        return cls.from_checked_rows(table)

    def aged(self, age_s: float, yaw_change: float) -> "ImageDetections":
        """The same detections `age_s` seconds later, in which the car has turned by `yaw_change`
        radians.
        """
        rows = self.rows().copy()
        rows[:, self.TIMING] += age_s, yaw_change
        return ImageDetections.from_checked_rows(rows)

    def unturned(self) -> "ImageDetections":
        """The same detections as if the car had not turned since their pictures."""
        return replace(self, yaw_changes=np.zeros(len(self)))


@dataclass(frozen=True)
class Tracks(_Table):
    """Tracked objects as columns of one table, the nearest first; `len()` is their number n."""

    ids: Integers
    """(n,) 0 or more; within an episode an id is never given to a second object."""
    classes: Integers
    """(n,) places in `CLASSES`."""
    boxes: Floats
    """(n, 7) in the sensor frame."""
    velocities: Floats
    """(n, 2) over ground, m/s; 0 for fewer than two hits, since it is not known then."""
    misses: Integers
    """(n,) keyframes since the object was last detected."""
    hits: Integers
    """(n,) keyframes at which it was detected."""

    COLUMNS = (
        "id", "class", "x", "y", "z", "length", "width", "height", "yaw", "vx", "vy", "misses",
        "hits",
    )  # fmt: skip
    ID, CLASS, YAW, MISSES, HITS = 0, 1, 8, 11, 12
    CENTRE, BOX, VELOCITY = slice(2, 5), slice(2, 9), slice(9, 11)
    """Places in COLUMNS."""
    _PLACES = {  # noqa: RUF012 (a constant)
        "ids": ID, "classes": CLASS, "boxes": BOX, "velocities": VELOCITY, "misses": MISSES,
        "hits": HITS,
    }  # fmt: skip
    _WHOLE = ("ids", "classes", "misses", "hits")

    @property
    def ranges(self) -> Floats:
        """(n,) planar distance of the centres from the sensor."""
        return planar_ranges(self.boxes)

    @classmethod
    def from_rows(cls, rows: NDArray[np.floating]) -> "Tracks":
        """Read rows in the order of `COLUMNS`; rows of id -1 are padding.

        Raises InvalidInput for ids, classes, misses or hits that are no numbers, or too large to be
        held exactly.
        """
        table: Floats = rows[rows[:, cls.ID] >= 0].astype(np.float64)
        whole = [cls.ID, cls.CLASS, cls.MISSES, cls.HITS]
        _check_whole_columns("ids, classes, misses and hits", table[:, whole])
        return cls.from_checked_rows(table)

    def moved(self, boxes: Floats, velocities: Floats) -> "Tracks":
        """The same tracks at other boxes (n, 7), with other velocities (n, 2)."""
        return Tracks(self.ids, self.classes, boxes, velocities, self.misses, self.hits)


def _check_whole_columns(what: str, numbers: Floats) -> None:
    """Raise InvalidInput for what no integer can be made of."""
    # NaN fails both comparisons, and so is refused.
    if not (numbers.min(initial=0) >= -_EXACT and numbers.max(initial=0) <= _EXACT):
        raise InvalidInput(f"{what} must be numbers up to {_EXACT:g}, none of them NaN")


def _shared(table: Floats) -> Floats:
    """A table that is kept and handed to all who ask, and so is read-only."""
    table.flags.writeable = False
    return table


@dataclass(frozen=True)
class Demand:
    """The demand of a policy to the allocator (Algorithm 1).

    A set is a list of cells, taken in its order. The paper takes them "in ascending index", and so
    its policies list them (`care_sim.core.cells.order`).
    """

    exploitation: Sequence[Cells] = ()
    """Sets of cells, that of the nearest object first."""
    layers: Sequence[Sequence[Cells]] = ()
    """The reserve layers in order of priority, each a sequence of sets of cells."""
    shots: Integers | None = None
    """(N,) least number of shots at each cell of the grid, if the cell is taken; None for one. Only
    hardware that may fire a cell more than once reads it (`care_sim.core.firing.base`). The
    allocator counts cells. The hardware deals the shots, no more than the budget, and what is left
    on top.
    """


@dataclass(frozen=True)
class Scan:
    """The returns of the fired cells."""

    cells: Cells
    """(n,) the fired ones, ascending; one that has two returns comes twice, the nearer first."""
    ranges: Floats
    """(n,) in metres, inf without a return."""
    intensities: Floats | None = None
    """(n,) calibrated, 0 to 1 and 0 without a return (`care_sim.sensors.signal`); None of a LiDAR
    whose pulses have no strength.
    """
    times: Floats | None = None
    """(n,) seconds from the keyframe, below 0, and 0 without a return (`care_sim.sensors.beams`);
    None where all cells fire at once.
    """
    points: Floats | None = None
    """(n, 3) where the returns lie, the motion of the ego compensated; None where they lie along
    the directions of their cells.
    """

    def take(self, kept: Mask) -> "Scan":
        """Some of the rows, by mask (n,)."""
        optional = (self.intensities, self.times, self.points)
        return Scan(
            self.cells[kept],
            self.ranges[kept],
            *(None if column is None else column[kept] for column in optional),
        )


@dataclass(frozen=True)
class Command:
    """The command of the controller to the car."""

    acceleration: float
    """m/s^2, below 0 to slow down."""
    braking: bool
    """Whether the brake is on; before it acts the acceleration is 0."""

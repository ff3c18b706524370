"""What the stages of a keyframe exchange.

Frames: sensor frame x forward, y left, z up; metres, seconds, radians. A box is (7,): centre x, y,
z, length, width, height, yaw. Velocities are over ground, in sensor axes. Nothing here carries a
body id of the simulator: truth stays in the world and in the scoring.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.bounds import bounded, settle
from care_sim.errors import InvalidInput, as_array, shown
from care_sim.frames import Floats
from care_sim.grid import AZIMUTH_MARGIN, ELEVATION_MARGIN, MOST_COLUMNS, MOST_ROWS, AngularGrid, Cells
from care_sim.pinhole import Lenses, PinholeCamera

CLASSES = ("car", "truck", "bus", "bicycle", "pedestrian")
"""The five driving classes shared by both detectors and the scoring (paper, Sec. 5.1)."""
_LABELS = frozenset(range(len(CLASSES)))

MAX_DETECTIONS = 128
"""Rows of the observation; six cameras in dense traffic saw up to 67 boxes in recorded drives."""
MAX_TRACKS = 256
"""Rows of the observation: one that explains every detection, and as many again."""
OBSERVED = ("ego", "budget", "detections", "tracks", "ranges")
"""What an observation consists of."""
_EXACT = 2.0**53
"""Up to this a float holds every whole number."""
HIGHEST = 2.0**24
"""No number of an observation is larger: the largest whole number that float32 holds beside all smaller ones."""

Observation = Mapping[str, NDArray[np.float32]]
Action = NDArray[np.float32]


@dataclass(frozen=True)
class Ego:
    """The car's own motion: speed m/s along its heading (below 0 backwards), yaw rate rad/s, acceleration m/s^2."""

    speed: float = 0.0
    yaw_rate: float = 0.0
    acceleration: float = 0.0


@dataclass(frozen=True)
class Detections:
    """3D detections of one keyframe: `classes` (n,), `boxes` (n, 7), `returns` (n,) fired rays that hit.

    `scores` (n,) are confidences from 0 to 1; None of a detector that has none.
    """

    classes: Cells
    boxes: Floats
    returns: Cells
    scores: Floats | None = None

    def __len__(self) -> int:
        return len(self.classes)


@dataclass(frozen=True)
class ImageDetections:
    """2D camera detections as columns of one table; `len()` is their number n.

    `classes` (n,), `confidences` (n,), `boxes` (n, 4: left, top, right, bottom in pixels),
    `cameras` (n,) index into `Rig.cameras`, `ages` (n,) seconds since the picture was taken and
    `yaw_changes` (n,) how far the car has turned since.
    """

    classes: Cells
    confidences: Floats
    boxes: Floats
    cameras: Cells
    ages: Floats
    yaw_changes: Floats

    COLUMNS = ("class", "confidence", "left", "top", "right", "bottom", "camera", "age", "yaw_change")

    def __len__(self) -> int:
        return len(self.classes)

    @classmethod
    def from_rows(cls, rows: NDArray[np.floating]) -> "ImageDetections":
        """Read rows in the order of `COLUMNS`; rows of class -1 are padding.

        Raises InvalidInput for a class or a camera that is no number, or too large to be held exactly.
        """
        table: Floats = rows[rows[:, 0] >= 0].astype(np.float64)
        classes, cameras = _whole("classes and cameras", table[:, [0, 6]]).T
        return cls(classes, table[:, 1], table[:, 2:6], cameras, table[:, 7], table[:, 8])

    def rows(self) -> Floats:
        """(n, 9) table in the order of `COLUMNS`, read-only."""
        return self._rows

    @cached_property
    def _rows(self) -> Floats:
        return _table(self.classes, self.confidences, self.boxes, self.cameras, self.ages, self.yaw_changes)


@dataclass(frozen=True)
class Tracks:
    """Tracked objects as columns of one table; `len()` is their number n.

    Nearest first. `ids` (n,), `classes` (n,), `boxes` (n, 7) in the sensor frame, `velocities` (n, 2) over ground,
    `misses` (n,) keyframes since the object was last detected, `hits` (n,) keyframes at which it was; with
    fewer than two the velocity is not known and reads 0.
    """

    ids: Cells
    classes: Cells
    boxes: Floats
    velocities: Floats
    misses: Cells
    hits: Cells

    COLUMNS = ("id", "class", "x", "y", "z", "length", "width", "height", "yaw", "vx", "vy", "misses", "hits")

    def __len__(self) -> int:
        return len(self.ids)

    @property
    def ranges(self) -> Floats:
        """(n,) planar distance of the centres from the sensor."""
        return np.hypot(self.boxes[:, 0], self.boxes[:, 1])

    @classmethod
    def from_rows(cls, rows: NDArray[np.floating]) -> "Tracks":
        """Read rows in the order of `COLUMNS`; rows of id -1 are padding.

        Raises InvalidInput for ids, classes, misses or hits that are no numbers, or too large to be held exactly.
        """
        table: Floats = rows[rows[:, 0] >= 0].astype(np.float64)
        ids, classes, misses, hits = _whole("ids, classes, misses and hits", table[:, [0, 1, 11, 12]]).T
        return cls(ids, classes, table[:, 2:9], table[:, 9:11], misses, hits)

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> "Tracks":
        """Some of the tracks, by index or mask."""
        return Tracks(*(getattr(self, column.name)[rows] for column in fields(self)))

    def rows(self) -> Floats:
        """(n, 13) table in the order of `COLUMNS`, read-only."""
        return self._rows

    @cached_property
    def _rows(self) -> Floats:
        return _table(self.ids, self.classes, self.boxes, self.velocities, self.misses, self.hits)


@dataclass(frozen=True)
class Belief:
    """All a policy may know when it chooses: what Gymnasium shows, and nothing else.

    `budget` is B, the number of cells that may fire; `detections` are the camera's, `tracks` the
    forecasts for this keyframe; `ranges` (E, A) the last scan, 0 not fired, maximum range no return. The loops make
    it with `care_sim.limits`, within what an observation can hold.
    """

    ego: Ego
    budget: int
    detections: ImageDetections
    tracks: Tracks
    ranges: NDArray[np.float32]

    @classmethod
    def from_observation(cls, observation: Observation) -> "Belief":
        """Read an observation of the environments back, without loss. Raises InvalidInput for another."""
        if not (isinstance(observation, Mapping) and all(key in observation for key in OBSERVED)):
            raise InvalidInput("an observation of CARE-Sim's environments is needed, as they give it without wrappers")
        ego, (budget,) = (_numbers(observation, key, size) for key, size in (("ego", 3), ("budget", 1)))
        ranges = _read(observation, "ranges", (None, None)).astype(np.float32, copy=False)
        if not ranges.size:
            raise InvalidInput("ranges of an observation must hold a cell at least")
        if not (0 <= budget <= 1 and ranges.min(initial=0) >= 0 and ranges.max(initial=0) <= HIGHEST):
            raise InvalidInput("an observation's budget must lie in [0, 1], its ranges be numbers of 0 or more")
        return cls(
            Ego(*ego),
            round(budget * ranges.size),
            ImageDetections.from_rows(_rows(observation, "detections", ImageDetections.COLUMNS)),
            Tracks.from_rows(_rows(observation, "tracks", Tracks.COLUMNS)),
            ranges,
        )

    def to_observation(self) -> dict[str, NDArray[np.float32]]:
        """The fixed-shape float32 arrays of the environments' observation space, new ones.

        Raises InvalidInput for more rows than a table has, since what were left out would be missed in silence.
        """
        ego = np.array([self.ego.speed, self.ego.yaw_rate, self.ego.acceleration], np.float32)
        return {
            "ego": ego,
            "budget": np.array([self.budget / self.ranges.size], np.float32),
            "detections": _padded("detections", self.detections.rows(), MAX_DETECTIONS),
            "tracks": _padded("tracks", self.tracks.rows(), MAX_TRACKS),
            "ranges": self.ranges.copy(),
        }


def _read(observation: Observation, key: str, shape: tuple[int | None, ...]) -> NDArray[Any]:
    """An array of an observation; None in `shape` is any length. Raises InvalidInput for another shape."""
    array = as_array(f"{key} of an observation", observation[key])
    fits = array.ndim == len(shape) and all(n in (None, m) for n, m in zip(shape, array.shape, strict=True))
    if not (fits and array.dtype.kind in "iuf"):
        wanted = " x ".join("any" if n is None else str(n) for n in shape)
        raise InvalidInput(f"{key} of an observation must be {wanted} numbers, got {array.dtype} of {array.shape}")
    return array


def _numbers(observation: Observation, key: str, size: int) -> list[float]:
    """A vector of an observation. Raises InvalidInput for what no sensor says."""
    numbers: list[float] = _read(observation, key, (size,)).tolist()
    if not all(-HIGHEST <= number <= HIGHEST for number in numbers):
        raise InvalidInput(f"{key} of an observation must hold numbers up to {HIGHEST:g}, none of them NaN")
    return numbers


def _rows(observation: Observation, key: str, columns: Sequence[str]) -> NDArray[Any]:
    """The rows of a table that are no padding. Raises InvalidInput for those that are neither padding nor of a known
    class, and for what no sensor says.
    """
    table = _read(observation, key, (None, len(columns)))
    given = table[:, 0] >= 0
    rows = table[given]
    if not (rows.min(initial=0) >= -HIGHEST and rows.max(initial=0) <= HIGHEST):
        raise InvalidInput(f"{key} of an observation must hold numbers up to {HIGHEST:g}, none of them NaN")
    leads, labels = rows[:, 0].tolist(), rows[:, columns.index("class")].tolist()
    padded = (table[~given, 0] == -1).all()
    if not (padded and all(label in _LABELS for label in labels) and all(lead == int(lead) for lead in leads)):
        raise InvalidInput(
            f"{key} of an observation: a row must begin with a whole number, -1 where it is padding, and be of a class "
            f"0 to {len(CLASSES) - 1}"
        )
    return rows


def _whole(what: str, numbers: Floats) -> Cells:
    """The numbers as integers. Raises InvalidInput for what none is."""
    if not (numbers.min(initial=0) >= -_EXACT and numbers.max(initial=0) <= _EXACT):
        raise InvalidInput(f"{what} must be numbers up to {_EXACT:g}, none of them NaN")
    return numbers.astype(np.int64)


def _table(*columns: NDArray[np.generic]) -> Floats:
    table: Floats = np.column_stack(columns)
    table.flags.writeable = False
    return table


def _padded(what: str, rows: Floats, length: int) -> NDArray[np.float32]:
    if len(rows) > length:
        raise InvalidInput(f"an observation holds {length} {what} at most, got {len(rows)}")
    table = np.zeros((length, rows.shape[1]), np.float32)
    table[:, 0] = -1
    table[: len(rows)] = rows
    return table


@dataclass(frozen=True)
class Demand:
    """What a policy asks of the allocator (Algorithm 1).

    `exploitation` are sets of cells, nearest object first; `layers` are the reserve layers in order
    of priority, each a sequence of sets of cells.
    """

    exploitation: Sequence[Cells] = ()
    layers: Sequence[Sequence[Cells]] = ()


@dataclass(frozen=True)
class Scan:
    """Returns of the fired cells: `cells` (n,) ascending and `ranges` (n,) in metres, inf without return."""

    cells: Cells
    ranges: Floats


@dataclass(frozen=True)
class Rig:
    """What is fixed about the sensing task and known to a policy in advance.

    `budget` is B in cells and `reserve_fraction` rho of Algorithm 1; `keyframe_s` the time between
    two decisions. Hulls and wedges are dilated by `azimuth_margin` columns and `elevation_margin` rows.
    The LiDAR stands `sensor_height_m` above the road.
    """

    grid: AngularGrid = field(default_factory=AngularGrid)
    cameras: tuple[PinholeCamera, ...] = ()
    budget: int = bounded(1638, 0, MOST_COLUMNS * MOST_ROWS)
    reserve_fraction: float = bounded(0.3, 0, 1)
    keyframe_s: float = bounded(0.1, 0.001, 60)
    azimuth_margin: int = bounded(AZIMUTH_MARGIN, 0, MOST_COLUMNS)
    elevation_margin: int = bounded(ELEVATION_MARGIN, 0, MOST_ROWS)
    sensor_height_m: float = bounded(1.84, 0, 100)

    def __post_init__(self) -> None:
        settle(self)
        if not isinstance(self.grid, AngularGrid):
            raise InvalidInput(f"grid must be an AngularGrid, got {shown(self.grid)}")
        if not (isinstance(self.cameras, tuple | list) and all(isinstance(c, PinholeCamera) for c in self.cameras)):
            raise InvalidInput(f"cameras must be a tuple of PinholeCamera, got {shown(self.cameras)}")
        object.__setattr__(self, "cameras", tuple(self.cameras))

    def read(self, observation: Observation) -> Belief:
        """The belief of an observation. Raises InvalidInput for one of another grid or other cameras."""
        belief = Belief.from_observation(observation)
        if belief.ranges.shape != self.grid.shape:
            raise InvalidInput(f"ranges of an observation must be {self.grid.shape}, got {belief.ranges.shape}")
        if not all(0 <= number < len(self.cameras) for number in belief.detections.cameras.tolist()):
            raise InvalidInput(f"detections of an observation must be of cameras 0 to {len(self.cameras) - 1}")
        return belief

    @cached_property
    def lenses(self) -> Lenses:
        """The cameras as one table."""
        return Lenses.of(self.cameras)

    def hulls(self, boxes: Floats, azimuth_margins: Cells | None = None) -> list[Cells]:
        """The cells of sensor-frame boxes (n, 7), dilated by the rig's margins or by `azimuth_margins` (n,)."""
        azimuth = self.azimuth_margin if azimuth_margins is None else azimuth_margins
        return self.grid.hulls(boxes, azimuth, self.elevation_margin)

    def wedges(self, bundles: Floats) -> list[Cells]:
        """The cells of bundles of rays (n, k, 3), middle first, dilated by the rig's margins."""
        return self.grid.wedges(bundles, self.azimuth_margin, self.elevation_margin)


@dataclass(frozen=True)
class Command:
    """What the controller asks of the car: acceleration in m/s^2 and whether the brake is on."""

    acceleration: float
    braking: bool


@dataclass(frozen=True)
class Keyframe:
    """The record of one keyframe, from which every metric is computed. Scoring only: it holds truth.

    `in_view`: the unimpaired camera shows the first-sighting actor; `detected`: the detector reported
    it. `distance_m`: planar, sensor to its centre, at the scan. The rest holds for the time until the
    next keyframe: `nearest_m` (centre to centre) and `clearance_m` (hull to hull) at their smallest,
    `impact_speed_mps` the car's speed at its first contact with any body, else None.
    """

    index: int
    time_s: float
    fired: Cells
    in_view: bool
    detected: bool
    braking: bool
    speed_mps: float
    distance_m: float
    nearest_m: float
    clearance_m: float
    impact_speed_mps: float | None


@dataclass(frozen=True)
class Outcome:
    """The result of an episode; see `care_sim.evaluation.metrics.outcome` for the definitions."""

    detection_distance_m: float | None
    undetected_to_m: float | None
    braked: bool
    min_distance_m: float | None
    clearance_m: float | None
    collision: bool
    impact_speed_mps: float | None
    rays_fired: int

"""The knowledge of a policy at a keyframe, and its form as an observation of Gymnasium."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import as_array
from care_sim.base.compiled import compiled
from care_sim.base.errors import InvalidInput
from care_sim.core.allocation import half_up
from care_sim.core.arrays import ONE_WORLD, Floats, Integers, Mask
from care_sim.core.types import CLASSES, Ego, ImageDetections, Tracks

SOUND, BEYOND, NO_ROW = range(3)
"""Verdicts on the rows of a table: in order; a number beyond the bound, or NaN; neither padding nor
of a known class."""


@compiled()
def read_rows(
    tables: NDArray[np.floating], wanted: Mask, label: int, labels: int, highest: float
) -> tuple[Floats, Integers, int]:
    """Return the rows (n, k) of the `wanted` (W,) tables (W, m, k), table after table. Rows that
    begin with -1 are padding and are left out. Also return the number of rows per table (W,) and
    the verdict, such as `SOUND`.

    Numbers go up to `highest`. Rows begin with a whole number of 0 or more, and have a class below
    `labels` in the column `label`.
    """
    counts = np.zeros(len(tables), np.int64)
    for w in range(len(tables)):
        if wanted[w]:
            for m in range(tables.shape[1]):
                counts[w] += tables[w, m, 0] != -1

    rows = np.empty((counts.sum(), tables.shape[2]))
    verdict = SOUND
    n = 0
    for w in range(len(tables)):
        end, m = n + counts[w], 0
        while n < end:
            if tables[w, m, 0] != -1:
                for k in range(tables.shape[2]):
                    rows[n, k] = tables[w, m, k]
                verdict = _worse(verdict, rows[n], label, labels, highest)
                n += 1
            m += 1
    return rows, counts, verdict


@compiled()
def _worse(verdict: int, row: Floats, label: int, labels: int, highest: float) -> int:
    """The verdict on the rows so far, and one more; a number beyond the bound is the worst."""
    for number in row:
        if not -highest <= number <= highest:
            return BEYOND
    lead, own = row[0], row[label]
    known = lead >= 0 and lead == np.floor(lead) and 0 <= own < labels and own == np.floor(own)
    return verdict if known or verdict == BEYOND else NO_ROW


@compiled()
def lie_between(numbers: NDArray[np.floating], least: float, most: float) -> bool:
    """Whether all numbers (m, k) lie within these bounds, which NaN never does."""
    outside = 0
    for m in range(len(numbers)):
        for k in range(numbers.shape[1]):
            outside += not least <= numbers[m, k] <= most
    return outside == 0


@compiled()
def rows_within(rows: Floats, least: Floats, most: Floats) -> bool:
    """Whether all rows (n, k) lie between `least` (k,) and `most`, one row for all (1, k) or one
    each (n, k). NaN never does.
    """
    for n in range(len(rows)):
        upper = most[min(n, len(most) - 1)]
        for k in range(rows.shape[1]):
            if not least[k] <= rows[n, k] <= upper[k]:
                return False
    return True


@compiled()
def range_image(size: int, cells: Integers, ranges: Floats, reach: float) -> NDArray[np.float32]:
    """(N,) metres of the fired `cells` (n,), `reach` where nothing returned, 0 of cells that were
    not fired. The first of several returns of a cell counts.
    """
    image = np.empty(size, np.float32)
    lay_ranges(image, cells, ranges, reach)
    return image


@compiled()
def lay_ranges(image: NDArray[np.float32], cells: Integers, ranges: Floats, reach: float) -> None:
    """Make `image` (N,) what `range_image` gives."""
    image[:] = 0.0
    for n in range(len(cells) - 1, -1, -1):
        image[cells[n]] = min(ranges[n], reach)


MAX_DETECTIONS = 128
"""Rows of the observation; six cameras in dense traffic saw up to 67 boxes in recorded drives."""
MAX_TRACKS = 256
"""Rows of the observation: one that explains every detection, and as many again."""
OBSERVED = ("ego", "budget", "detections", "tracks", "ranges")
"""The parts of an observation."""
HIGHEST = 2.0**24
"""No number of an observation is larger: the largest whole number that float32 holds beside all
smaller ones."""

Observation = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True)
class Belief:
    """All that a policy may know when it chooses: what Gymnasium shows, and nothing else.

    `ego` is the car's own motion as its odometry reads it. `budget` is B, the number of cells that
    may fire. `detections` are the camera's, `tracks` the forecasts for this keyframe. `ranges`
    (E, A) are the last scan in metres: 0 not fired, maximum range no return. The loops make it with
    `care_sim.loops.observation_limits`, within what an observation can hold.
    """

    ego: Ego
    budget: int
    detections: ImageDetections
    tracks: Tracks
    ranges: NDArray[np.float32]

    @classmethod
    def from_observation(cls, observation: Observation) -> "Belief":
        """Read an observation of the environments back, without loss.

        Raises InvalidInput for anything else: another structure, another shape, numbers that no
        sensor says.
        """
        if not (isinstance(observation, Mapping) and observation.keys() >= {*OBSERVED}):
            raise InvalidInput(
                "an observation of CARE-Sim's environments is needed,"
                " as they give it without wrappers"
            )
        ego = _vector(observation, "ego", 3)
        (budget,) = _vector(observation, "budget", 1)
        ranges = array_of(observation, "ranges", 2, None).astype(np.float32, copy=False)
        if not ranges.size:
            raise InvalidInput("ranges of an observation must hold a cell at least")
        fits = lie_between(np.ascontiguousarray(ranges), 0.0, HIGHEST)
        if not (0 <= budget <= 1 and fits):
            raise InvalidInput(
                "an observation's budget must lie in [0, 1], its ranges be numbers of 0 or more"
            )
        detections = _rows(observation, "detections", ImageDetections.COLUMNS)
        tracks = _rows(observation, "tracks", Tracks.COLUMNS)
        return cls(
            Ego(*ego),
            half_up(budget * ranges.size),
            ImageDetections.from_checked_rows(detections),
            Tracks.from_checked_rows(tracks),
            ranges,
        )

    def to_observation(self) -> dict[str, NDArray[np.float32]]:
        """The fixed-shape float32 arrays of the environments' observation space, new ones.

        Raises InvalidInput for more rows than a table has: what were left out would be missed in
        silence.
        """
        ego = np.array([self.ego.speed, self.ego.yaw_rate, self.ego.acceleration], np.float32)
        return {
            "ego": ego,
            "budget": np.array([self.budget / self.ranges.size], np.float32),
            "detections": _padded("detections", self.detections.rows(), MAX_DETECTIONS),
            "tracks": _padded("tracks", self.tracks.rows(), MAX_TRACKS),
            "ranges": self.ranges.copy(),
        }


def array_of(observation: Observation, key: str, axes: int, width: int | None) -> NDArray[Any]:
    """An array of an observation with so many axes, the last `width` long; None is any length.
    Raises InvalidInput for another shape or type.
    """
    array = as_array(f"{key} of an observation", observation[key])
    fits = array.ndim == axes and width in (None, array.shape[-1])
    if not (fits and array.dtype.kind in "iuf"):
        wanted = "any x " * (axes - 1) + ("any" if width is None else str(width))
        raise InvalidInput(
            f"{key} of an observation must be {wanted} numbers, got {array.dtype} of {array.shape}"
        )
    return array


def _vector(observation: Observation, key: str, size: int) -> list[float]:
    """A vector of an observation. Raises InvalidInput for what no sensor says."""
    numbers: list[float] = array_of(observation, key, 1, size).tolist()
    if not all(-HIGHEST <= number <= HIGHEST for number in numbers):
        raise _beyond(key)
    return numbers


def _rows(observation: Observation, key: str, columns: Sequence[str]) -> Floats:
    """The rows of a table that are no padding, checked here once and for all. Raises InvalidInput
    as `rows_of` does.
    """
    return rows_of(array_of(observation, key, 2, len(columns))[None], ONE_WORLD, key, columns)[0]


def rows_of(
    tables: NDArray[Any], wanted: Mask, key: str, columns: Sequence[str]
) -> tuple[Floats, Integers]:
    """The rows (n, k) that are no padding of those of the tables (W, m, k) that are `wanted` (W,),
    and how many there are of each (W,). Raises InvalidInput for rows that are neither padding nor
    of a known class, and for what no sensor says.
    """
    # Observations of environments are compiled for; other numbers are converted first.
    if tables.dtype != np.float32:
        tables = tables.astype(np.float64)
    rows, counts, verdict = read_rows(
        np.ascontiguousarray(tables), wanted, columns.index("class"), len(CLASSES), HIGHEST
    )
    if verdict == BEYOND:
        raise _beyond(key)
    if verdict == NO_ROW:
        raise InvalidInput(
            f"{key} of an observation: a row must begin with a whole number, -1 where it is"
            f" padding, and be of a class 0 to {len(CLASSES) - 1}"
        )
    return rows, counts


def _beyond(key: str) -> InvalidInput:
    return InvalidInput(
        f"{key} of an observation must hold numbers up to {HIGHEST:g}, none of them NaN"
    )


def _padded(what: str, rows: Floats, length: int) -> NDArray[np.float32]:
    """A table of `length` rows, of which those that are left over begin with -1."""
    if len(rows) > length:
        raise InvalidInput(f"an observation holds {length} {what} at most, got {len(rows)}")
    table = np.zeros((length, rows.shape[1]), np.float32)
    table[:, 0] = -1
    table[: len(rows)] = rows
    return table

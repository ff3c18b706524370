"""Measures of an episode of the closed loop, or of a scene of the open loop."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from care_sim.evaluation.censoring import FEWEST_PAIRS, Reading
from care_sim.evaluation.recall import Tally
from care_sim.evaluation.scene_contrasts import (
    FIRST_SIGHTING,
    OVERALL,
    TTFD,
    Ratio,
    ratio_level,
)
from care_sim.evaluation.strata import ENTRY, NEWCOMERS
from care_sim.study.rows.reading import detection, is_avoided
from care_sim.study.run_config import Row

GATE_M = 2.5
"""Way of the ego at 30 km/h (8.33 m/s) while the controller's brake builds up (0.3 s). An earlier
detection by less gains less than the reaction time.
"""
GATE_POINTS = 5.0
"""The gate of the paper (Sec. 5.2), fixed there before the runs."""
GATE_COLLISION_POINTS = 10.0
"""Smallest share of the collisions that a full scan prevents; stated before a world was
validated.
"""

HEADINGS = {FIRST_SIGHTING: "First sightings", OVERALL: "Overall recall", TTFD: "Censored TTFD"}

Units = Mapping[Any, Any]
"""Measurements by unit: a `Reading` per seed, or a `Tally` per scene."""
_TALLY = tuple(field.name for field in fields(Tally))


@dataclass(frozen=True)
class Measure:
    """A quantity of an episode, its unit and decimals, and the `gate`: the smallest mean difference
    that counts. `read` returns None for an episode without the quantity.
    """

    name: str
    unit: str
    decimals: int
    gate: float
    read: Callable[[Row], Reading | None]
    fewest_pairs = 2
    """One pair has no spread, and no interval."""

    @property
    def heading(self) -> str:
        """The measure and its unit."""
        return f"{self.name}, {self.unit}"

    def units(self, rows: Iterable[Row]) -> dict[Any, Reading]:
        """Return the measurements by seed. A seed fixes world, faults and floor (common random
        numbers).
        """
        found = ((row["seed"], self.read(row)) for row in rows)
        return {seed: reading for seed, reading in found if reading is not None}

    def mean(self, units: Units) -> float | None:
        """The mean over units, a missed actor counted as in differences; None without units."""
        values = [reading.value for reading in units.values()]
        return float(np.mean(values)) if values else None


@dataclass(frozen=True)
class Recall:
    """A ratio of sums over scenes: of all objects, `within` a stratum ("range/below 20 m") or a
    kind of newcomers ("emerging"). With `equal_scenes` every scene weighs the same.
    """

    ratio: Ratio
    within: str = ""
    equal_scenes: bool = False
    gate = float("inf")
    """No asterisk: the table of contrasts states the gate of the protocol."""
    fewest_pairs = FEWEST_PAIRS

    @property
    def heading(self) -> str:
        """The measure, the stratum, the weights."""
        within = [self.within.rpartition("/")[2]] if self.within else []
        weights = ["equal scenes"] if self.equal_scenes else []
        return ", ".join([HEADINGS[self.ratio], *within, *weights])

    @property
    def decimals(self) -> int:
        """Decimals of a recall in % and of TTFD in keyframes."""
        return 2 if self.ratio is TTFD else 1

    def mean(self, units: Units) -> float | None:
        """The measure over all scenes; None where nothing is to be found."""
        level = ratio_level(self.ratio, units)
        return level.by_scene if self.equal_scenes else level.by_event

    def written(self, value: float | None) -> str:
        """A level in the unit of the measure."""
        return "" if value is None else f"{value:.{self.decimals}f}"


def tally_of(row: Row, within: str = "") -> Tally:
    """The tally of a play, of all objects or `within` a stratum or a kind of newcomers."""
    if within in NEWCOMERS:
        return sum((tally_of(row, f"{ENTRY}/{entry}") for entry in NEWCOMERS[within]), Tally())
    # Columns of a stratum are named KIND/STRATUM/FIELD, those of all events by the field alone.
    prefix = f"{within}/" if within else ""
    return Tally(*(row[f"{prefix}{column}"] for column in _TALLY))


def _detected(row: Row) -> Reading | None:
    found = detection(row)
    return None if found is None else Reading(100.0 * (not found.censored))


def _avoided(row: Row) -> Reading:
    return Reading(100.0 * is_avoided(row))


DETECTION = Measure("First detection", "m", 1, GATE_M, detection)
BRAKED = Measure("Braked", "points", 0, GATE_POINTS, lambda row: Reading(100.0 * row["braked"]))
DETECTED = Measure("Detected", "points", 0, GATE_POINTS, _detected)
AVOIDED = Measure("Collisions avoided", "points", 0, GATE_COLLISION_POINTS, _avoided)
AVOIDANCE = Measure("Avoided", "points", 0, GATE_POINTS, _avoided)


class Loop(NamedTuple):
    """Description of a loop's studies: its name, the units of levels and of differences, and the
    measures.
    """

    shown: str
    level_unit: str
    difference_unit: str
    measures: tuple[Measure | Recall, ...]


CLOSED_LOOP = Loop("First detection", "median, m", "m", (DETECTION,))
OPEN_LOOP = Loop("Recall", "%", "points", (Recall(FIRST_SIGHTING), Recall(OVERALL)))


def loop_of(rows: Sequence[Row]) -> Loop:
    """The loop that rows were played in."""
    return OPEN_LOOP if rows and "source" in rows[0] else CLOSED_LOOP

"""The levels of cells: medians, counts and regret of episodes, recall of plays.

Actors that were never detected are handled as `care_sim.evaluation.censoring` says.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from care_sim.evaluation.censoring import Quartiles, Reading, quartiles
from care_sim.reports.engine.contrasts import Contrast, contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.measures import AVOIDED, BRAKED, DETECTION, Measure, Recall, Units
from care_sim.reports.formatting import median
from care_sim.study.rows.reading import Key, Setting, detections, tags_of_row
from care_sim.study.run_config import FULL, Row

NO_ACTOR = Quartiles(None, None, None, 0)
"""Text of a cell whose drives have no meetings."""


@dataclass(frozen=True)
class Cell:
    """A policy at a budget in a setting of the closed loop. Distances in metres.

    `tags` are the policy's. `met` counts the episodes with a first-sighting actor, `never` those of
    them without a detection, and `detection` is over them. `closest_pass` and `clearance` are over
    the episodes in which the actor came into the camera's view, None without any. `regret` is the
    detection distance of the full scan in the same world minus this policy's, 0 at best. `as_full`
    counts the episodes in which the policy detects no later. Both are None for `full` and without
    it.
    """

    setting: Setting
    policy: str
    budget: float
    tags: tuple[str, ...]
    episodes: int
    met: int
    never: int
    detection: Quartiles
    braked: int
    closest_pass: Quartiles | None
    clearance: Quartiles | None
    collisions: int
    regret: Contrast | None
    as_full: int | None

    @property
    def key(self) -> Key:
        """Key of its rows."""
        return self.setting, self.policy, self.budget


def levels(frame: Frame, only: Setting | None = None) -> list[Cell]:
    """The cells of a study of episodes, or of one setting of it, in the order of their first rows,
    settings kept together.
    """
    settings = [only] if only else list(dict.fromkeys(setting for setting, _, _ in frame.groups))
    own = [key for key in frame.groups if key[0] in settings]
    # The sort is stable, so that the policies of a budget keep the order of their rows.
    keys = sorted(own, key=lambda key: (settings.index(key[0]), key[2]))
    return [cell for key in keys if (cell := level_of(frame, key))]


def level_of(frame: Frame, key: Key) -> Cell | None:
    """A cell of episodes; None where it was not played."""
    setting, policy, budget = key
    rows = frame.of(key)
    if not rows:
        return None
    readings = detections(rows)
    found = DETECTION.units(rows)
    full = {} if policy == FULL else frame.units(DETECTION, (setting, FULL, 1.0))
    # Full minus policy: a policy that detects later than the full scan has positive regret.
    regret = contrast(DETECTION, full, found)
    # An actor that neither detected is no success: a censored reading does not count.
    no_later = sum(
        not found[seed].censored and found[seed].value >= full[seed].value
        for seed in {*found} & {*full}
    )
    return Cell(
        setting=setting,
        policy=policy,
        budget=budget,
        tags=tags_of_row(rows[0]),
        episodes=len(rows),
        met=len(readings),
        never=sum(reading.censored for reading in readings),
        detection=quartiles(readings) or NO_ACTOR,
        braked=sum(row["braked"] for row in rows),
        closest_pass=_quartiles(rows, "min_distance_m"),
        clearance=_quartiles(rows, "clearance_m"),
        collisions=sum(row["collision"] for row in rows),
        regret=regret,
        as_full=no_later if regret else None,
    )


def _quartiles(rows: Sequence[Row], column: str) -> Quartiles | None:
    # An actor that never came into view was never passed: the episode has no value and is left out.
    return quartiles([Reading(row[column]) for row in rows if row[column] is not None])


def level(measure: Measure | Recall, units: Units) -> str:
    """The level of a cell in words: a recall, a median first detection, or how many of all episodes
    have what is counted; empty where it was not played.
    """
    if isinstance(measure, Recall):
        return measure.written(measure.mean(units))
    if not units:
        return ""
    if measure in (AVOIDED, BRAKED):
        return f"{sum(reading.value > 0 for reading in units.values())}/{len(units)}"
    return median(quartiles([*units.values()]))

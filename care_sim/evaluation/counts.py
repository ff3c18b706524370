"""Counts of a play that compare allocators: detections, and unwanted actions.

Counts on a street or a recording:

- `emerging`: newcomers that emerge, detected in their first keyframe;
- `entering`: newcomers that enter the range, detected in their first keyframe;
- `kept`: object frames within range that are detected, of all objects;
- `people kept`: the same of people on foot and on bicycles.

Emerging and entering are defined in `care_sim.evaluation.strata`. An object emerges if the film
first shows it nearer than 45 m, 5 m within the range. An object covers 5 m in a keyframe. The line
is older than this score, and also exists in recordings, where a box first holds a point.

Counts in a drive or a test: the collision `avoided`, and the `needless stops`.

A detector that detects by chance adds noise that no policy can influence. So newcomers are counted
by the sum of their chances, which the row of such a detector has (`care_sim.evaluation.chances`).
Kept objects are counted by draws. Luck lasts and tracks follow it, so a sum of chances would be too
high.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from care_sim.core.arrays import Floats, Mask
from care_sim.evaluation.sightings import Sightings
from care_sim.evaluation.strata import EMERGING, ENTERING, ENTRY, NEWCOMERS, strata

KEPT, PEOPLE_KEPT = "kept", "people kept"
SCENE_COUNTS = (EMERGING, ENTERING, KEPT, PEOPLE_KEPT)
"""The counts of a play of the open loop."""
AVOIDED, NEEDLESS = "avoided", "needless stops"
EPISODE_COUNTS = (AVOIDED, NEEDLESS)
"""The counts of an episode of the closed loop."""
PEOPLE = ("bicycle", "pedestrian")
_EXPECTED = "expected"


def expected_columns(sightings: Sightings, chances: Floats) -> dict[str, float]:
    """Return the expected counts of newcomers as columns `expected/COUNT` of a row.

    `chances` (e,) are the detection chances of `sightings.events`.
    """
    return {
        f"{_EXPECTED}/{count}": float(chances[own[sightings.events]].sum())
        for count, own in rows_of_newcomers(sightings).items()
    }


def rows_of_newcomers(sightings: Sightings) -> dict[str, Mask]:
    """Return which rows (r,) of `sightings.frames` are of each kind of newcomers."""
    entries = strata(sightings)[ENTRY]
    return {
        count: np.any([entries[label] for label in labels], axis=0)
        for count, labels in NEWCOMERS.items()
    }


def scene_counts(row: Mapping[str, Any]) -> dict[str, float]:
    """Return the counts of a row of the open loop: expected newcomers where the row has them."""
    # In a file of several detectors, some rows lack these columns.
    expected = {count: row.get(f"{_EXPECTED}/{count}") for count in SCENE_COUNTS}
    return {
        count: _drawn(row, count) if value is None else value for count, value in expected.items()
    }


def _drawn(row: Mapping[str, Any], count: str) -> float:
    if count == KEPT:
        return float(row["found"])
    if count == PEOPLE_KEPT:
        return float(sum(row[f"class/{name}/found"] for name in PEOPLE))
    return float(sum(row[f"{ENTRY}/{label}/sighted"] for label in NEWCOMERS[count]))

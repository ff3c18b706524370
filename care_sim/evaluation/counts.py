"""The counts of a play by which allocators are compared: what it detects, and what it must not do.

On a street or a recording they are

- `emerging`: newcomers that emerge, detected in their first keyframe;
- `entering`: newcomers that enter the range, detected in their first keyframe;
- `kept`: object frames within range that are detected, of all objects;
- `people kept`: the same of people on foot and on bicycles.

The line between emerging and entering is that of `care_sim.evaluation.strata`: an object emerges if
the film first shows it nearer than 45 m, 5 m within the range. It was there before any policy
played, it has a reason (what an object covers in a keyframe), and recordings have it too, since
their boxes say when they first hold a point. A trial had drawn the line at 40 m.

In a drive or a test they are the collision `avoided`, and the `needless stops`.

A detector that detects by chance makes draws, and draws are noise that no policy can help. Where
the chances are known a count is the sum of the chances, given all returns so far
(`care_sim.study.chances`); the row then has columns of its own for them.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from care_sim.core.arrays import Floats
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
_CLASS = "class"
_STRATA = {EMERGING: (ENTRY, NEWCOMERS[EMERGING]), ENTERING: (ENTRY, NEWCOMERS[ENTERING])} | {
    PEOPLE_KEPT: (_CLASS, PEOPLE)
}
"""The kind and the labels of the strata that a count adds up; none of `KEPT`, which takes all."""


def expected_columns(sightings: Sightings, chances: Floats) -> dict[str, float]:
    """The expected counts as columns `expected/COUNT` of a row, from the `chances` (r,) that each
    row of `sightings.frames` is detected.
    """
    masks = strata(sightings)
    is_first = np.isin(np.arange(len(chances)), sightings.events)
    columns = {f"{_EXPECTED}/{KEPT}": float(chances.sum())}
    for count, (kind, labels) in _STRATA.items():
        rows = np.any([masks[kind][label] for label in labels], axis=0)
        rows = rows & is_first if kind == ENTRY else rows
        columns[f"{_EXPECTED}/{count}"] = float(chances[rows].sum())
    return columns


def scene_counts(row: Mapping[str, Any]) -> dict[str, float]:
    """The counts of a row of the open loop: expectations where it has them, else draws."""
    if f"{_EXPECTED}/{KEPT}" in row:
        return {count: row[f"{_EXPECTED}/{count}"] for count in SCENE_COUNTS}
    return {count: _summed(row, count) for count in SCENE_COUNTS}


def _summed(sums: Mapping[str, Any], count: str) -> float:
    if count == KEPT:
        return float(sums["found"])
    kind, labels = _STRATA[count]
    last = "sighted" if kind == ENTRY else "found"
    return float(sum(sums[f"{kind}/{label}/{last}"] for label in labels))

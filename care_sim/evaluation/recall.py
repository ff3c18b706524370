"""First-sighting recall, overall recall and time to first detection, as numerators and denominators
of a scene.

The time to first detection (TTFD) of an event is the number of keyframes from its first sighting to
the first keyframe at which the object is detected. It is 0 for a detection at once, and K without
one at the first sighting or the K - 1 keyframes after it.

Every event counts, also an object that leaves, or a scene that ends, before K keyframes:
undetected, it counts K. The paper names one censoring time, K = 6 keyframes, for all events (Remark
1), and takes the mean over the events of recall. A shorter time would make such misses cheaper.
`SceneScore.chances` is the number of the K keyframes at which the object was in range, to select
events that had them all.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from care_sim.core.arrays import Integers, Mask
from care_sim.core.types import CLASSES
from care_sim.evaluation.differences import Adding
from care_sim.evaluation.sightings import Sightings

CENSORED_AT = 6
"""K, in keyframes: three seconds at 2 Hz (paper, Remark 1)."""


@dataclass(frozen=True)
class Tally(Adding):
    """Sums over one or more scenes.

    `sighted` of the `events` were detected at their first keyframe; `delay` is the sum of their
    TTFD in keyframes. `found` of the object `frames` in range were detected. An average over floor
    seeds need not be whole.
    """

    events: float = 0.0
    sighted: float = 0.0
    delay: float = 0.0
    frames: float = 0.0
    found: float = 0.0


@dataclass(frozen=True)
class SceneOutcome:
    """The result of a play of a scene. `first_sightings` events and `object_frames` in range, the
    share of each that was detected, 0 to 1, and `ttfd_keyframes`, the mean TTFD of the events. None
    without objects to detect.
    """

    first_sightings: int
    first_sighting_recall: float | None
    ttfd_keyframes: float | None
    object_frames: int
    overall_recall: float | None


@dataclass(frozen=True)
class SceneScore:
    """A policy's detections in a scene.

    `found` (r,) marks rows of `sightings.frames`. `delays` (e,) are the TTFD of events in
    keyframes, `CENSORED_AT` without detection. `chances` (e,) count the keyframes among the first
    `CENSORED_AT` at which the object was in range.
    """

    sightings: Sightings
    found: Mask
    delays: Integers
    chances: Integers

    @classmethod
    def of(cls, sightings: Sightings, masks: Sequence[Mask]) -> "SceneScore":
        """Return the score of a scene from the matches of its keyframes.

        `masks` are one per keyframe: (n,) which of its annotations, of all ranges, were detected
        (`matching.found_objects`).
        """
        # Rows of the table are the scored annotations, keyframe after keyframe, as the masks are.
        found = np.concatenate(masks)[sightings.in_range]

        # Keyframes (e, r) from an event to a later row of its object, K for rows of others. An
        # event is the first row of its object, so no age is below 0.
        rows = sightings.frames
        events = rows.take(sightings.events)
        late = rows.keyframes - events.keyframes[:, None]
        ages = np.where(rows.objects == events.objects[:, None], late, CENSORED_AT)

        # An event's delay is the age of the earliest detected row of its object. Without one
        # younger than K, the delay keeps its initial value K.
        delays = np.where(found, ages, CENSORED_AT).min(axis=1, initial=CENSORED_AT)
        return cls(sightings, found, delays, np.sum(ages < CENSORED_AT, axis=1))

    def tally(self, within: Mask | None = None) -> Tally:
        """Return the sums of all rows, or of the rows (r,) of `sightings.frames` `within` a
        stratum.

        An event belongs to the stratum of its first sighting, wherever the object is when it is
        found.
        """
        # Two denominators: events for first sightings and delays, object frames for overall recall.
        events = self.sightings.events
        rows = np.ones(len(self.found), bool) if within is None else within
        counted = rows[events]
        sums = counted.sum(), self.found[events][counted].sum(), self.delays[counted].sum()
        return Tally(*map(float, (*sums, rows.sum(), self.found[rows].sum())))

    def outcome(self) -> SceneOutcome:
        """Recalls and the mean TTFD, of all events and object frames alike."""
        sums = self.tally()
        return SceneOutcome(
            int(sums.events),
            _share(sums.sighted, sums.events),
            _share(sums.delay, sums.events),
            int(sums.frames),
            _share(sums.found, sums.frames),
        )

    def event_rows(self) -> list[dict[str, Any]]:
        """One row per event: where and what it was, whether it was found at once, its TTFD and its
        chances.
        """
        events = self.sightings.frames.take(self.sightings.events)
        columns = {
            "keyframe": events.keyframes,
            "object": events.objects,
            "class": np.array(CLASSES)[events.classes],
            "range_m": events.ranges,
            "azimuth": events.azimuths,
            "detected": self.found[self.sightings.events],
            "ttfd": self.delays,
            "chances": self.chances,
        }
        values = zip(*(column.tolist() for column in columns.values()), strict=True)
        return [
            {"scene": self.sightings.scene, **dict(zip(columns, row, strict=True))}
            for row in values
        ]


def _share(part: float, whole: float) -> float | None:
    return part / whole if whole else None

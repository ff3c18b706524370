"""First-sighting recall, overall recall and time to first detection, as numerators and denominators
of a scene.

Time to first detection (TTFD) of an event is the number of keyframes from its first sighting to the
first keyframe at which the object is found: 0 where it is found at once, and K where it is not
found at the first sighting or at the K - 1 keyframes that follow it. Every event counts, also one
nearer than K to the end of the scene or whose object leaves before: not found, it counts K. The
paper names one censoring time, K = 6 keyframes, for all events (Remark 1), and a mean over the
events that recall is taken over; a shorter time would make a miss cheaper where the scene happens
to end or the object drives off. `SceneScore.chances` says at how many of the K keyframes the object
was in range, for whoever wants only the events that had them all.
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
    """Sums over a scene, or over several.

    `events`, of which `sighted` were found at their first keyframe; `delay` is the sum of their
    TTFD in keyframes. `frames` are the object frames in range, of which `found` were found. An
    average over floor seeds is no whole number.
    """

    events: float = 0.0
    sighted: float = 0.0
    delay: float = 0.0
    frames: float = 0.0
    found: float = 0.0


@dataclass(frozen=True)
class SceneOutcome:
    """How a play of a scene ended: `first_sightings` events and `object_frames` in range, the
    shares of them that were found, at the first sighting and at all, 0 to 1, and `ttfd_keyframes`,
    the mean time to first detection of the events. None where there is nothing to find.
    """

    first_sightings: int
    first_sighting_recall: float | None
    ttfd_keyframes: float | None
    object_frames: int
    overall_recall: float | None


@dataclass(frozen=True)
class SceneScore:
    """What a policy found of a scene.

    `found` (r,) by row of `sightings.frames`; of the events (e,) `delays` are the TTFD in
    keyframes, `CENSORED_AT` where not found, and `chances` the keyframes among the first
    `CENSORED_AT` at which the object was in range.
    """

    sightings: Sightings
    found: Mask
    delays: Integers
    chances: Integers

    @classmethod
    def of(cls, sightings: Sightings, masks: Sequence[Mask]) -> "SceneScore":
        """The score of a scene whose keyframes were matched one by one.

        `masks` are one per keyframe: (n,) which of its annotations, of all ranges, were found
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

        # An event is found first at the youngest of its object's rows that was found. Found at none
        # that is younger than K, it keeps K, the initial value.
        delays = np.where(found, ages, CENSORED_AT).min(axis=1, initial=CENSORED_AT)
        return cls(sightings, found, delays, np.sum(ages < CENSORED_AT, axis=1))

    def tally(self, within: Mask | None = None) -> Tally:
        """The sums, of all or of the rows (r,) of `sightings.frames` that lie `within` a stratum.

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

"""First-sighting events of a scene (paper, Sec. 3 and Remark 1). They depend on the film alone, on
no policy.

"A first sighting is the first keyframe at which an annotated object within range R appears in the
scene, excluding objects present at scene start." Only objects within range are in the scene that is
scored, so this one sentence settles every case:

- not annotated at the first keyframe, and later scored within range (it drove in round a corner):
  an event where it is first scored, that is where a return or a pixel first shows it;
- annotated from the start or later, but beyond R, and then nearer (it enters by range): an event
  where it is first scored within R, a "new entry" like any other;
- within R at the first keyframe: "present at scene start", never an event, whatever it does later;
- gone and back, out of range or out of the annotations: "reappearances after annotation gaps are
  not scored separately", so an object has one event at most;
- never within R: no event.

The sentence does not ask who could be seen. So an object that its source annotates within R at
the first keyframe is present there though neither a return nor a pixel shows it
(`care_sim.loops.film.Film.hidden`), and is no event when it shows itself: `presence="annotated"`,
the rule. That takes out the very case after which the closed loop is made: the person who stands
behind a parked van from the first keyframe on and then walks out. How much it takes out depends on
who annotates. People drew the boxes of recordings, and seldom drew one where they saw nothing; the
generator of a street knows everybody, also those whom nobody could have annotated.
`presence="visible"` counts as present only what a sensor shows at the first keyframe, so that
the one behind the van is an event; `Sightings.emerging` are those by which the two counts differ.
What is scored at a keyframe is the same in both.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from care_sim.base.errors import InvalidInput, shown
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.sensors.annotated import NO_ANNOTATIONS, Annotations

RANGE_M = 50.0
"""R: planar distance from the sensor to the centre of the box, this value included (paper, Remark
1).
"""
ANNOTATED, VISIBLE = PRESENCES = ("annotated", "visible")
"""Who is present at scene start: all that is annotated there, or what shows a return or a pixel."""


@dataclass(frozen=True)
class ObjectFrames:
    """Every annotated object at every keyframe at which it is in range, in order of keyframe, as
    columns of one table.

    `keyframes` (r,) from 0, `objects` (r,) numbers of the film, `classes` (r,) into
    `care_sim.core.types.CLASSES`, `ranges` (r,) planar metres and `azimuths` (r,) radians from
    straight ahead towards the left, in the sensor frame.
    """

    keyframes: Integers
    objects: Integers
    classes: Integers
    ranges: Floats
    azimuths: Floats

    def __len__(self) -> int:
        return len(self.keyframes)

    def take(self, rows: Integers | Mask) -> "ObjectFrames":
        """Some of the rows, by index or mask."""
        return ObjectFrames(*(getattr(self, column.name)[rows] for column in fields(self)))


@dataclass(frozen=True)
class Sightings:
    """What there is to find in a scene, the same for every policy.

    `keyframes` are the annotations it was made from and `in_range` (n,) marks which of their
    objects, one keyframe after the other, are scored, those within `RANGE_M`: these are the
    rows of `frames`. `first_ranges` (r,) are the planar metres at which the annotations first show
    the object of each row, within range or beyond. `events` (e,) are the rows of `frames` that are
    first sightings, ascending. `emerging` (m,) are the rows at which an object that was hidden
    within range at the first keyframe first shows itself, ascending: events by the presence
    "visible", none by "annotated".
    """

    scene: str
    keyframes: tuple[Annotations, ...]
    in_range: Mask
    frames: ObjectFrames
    first_ranges: Floats
    events: Integers
    emerging: Integers

    @classmethod
    def of(
        cls,
        scene: str,
        keyframes: Sequence[Annotations],
        hidden: Annotations = NO_ANNOTATIONS,
        presence: str = ANNOTATED,
    ) -> "Sightings":
        """The sightings of the scene's annotations, one entry per keyframe; `hidden` are those of
        `Film.hidden`.

        Raises InvalidInput for a scene without a keyframe, for an object annotated twice at one
        keyframe or without a finite centre, and for a presence that is none of `PRESENCES`.
        """
        if not keyframes:
            raise InvalidInput(f"scene {scene}: a scene must have at least one keyframe")
        check_presence(presence)
        rows = _table(keyframes)
        together = (
            np.concatenate([getattr(part, column.name) for part in (keyframes[0], hidden)])
            for column in fields(hidden)
        )
        start = _table([Annotations(*together)])
        for table in (rows, start):
            _check(scene, table)

        # What is beyond the range is in no scene that is scored, so it counts neither as present
        # nor as appearing there.
        in_range = rows.ranges <= RANGE_M
        frames = rows.take(in_range)
        # Rows are in order of keyframe, so the first row of an object is its first keyframe.
        _, first = np.unique(frames.objects, return_index=True)
        appearing = np.sort(first[frames.keyframes[first] > 0]).astype(np.int64)
        present = np.isin(frames.objects[appearing], start.objects[start.ranges <= RANGE_M])
        events = appearing[~present] if presence == ANNOTATED else appearing
        _, first, which = np.unique(rows.objects, return_index=True, return_inverse=True)
        first_ranges = rows.ranges[first[which]][in_range]
        return cls(
            scene,
            tuple(keyframes),
            in_range,
            frames,
            first_ranges,
            events,
            appearing[present],
        )

    def scored(self, keyframe: int) -> Mask:
        """(n,) which annotations of a keyframe are in range."""
        # The mask runs through all keyframes, one after the other.
        start = sum(map(len, self.keyframes[:keyframe]))
        return self.in_range[start : start + len(self.keyframes[keyframe])]

    def appearing(self, keyframe: int) -> Mask:
        """(n,) which annotations of a keyframe are first sightings."""
        # Events are rows of the scored objects: their marks go to the scored ones, in their order.
        appears = self.scored(keyframe).copy()
        appears[appears] = np.isin(np.flatnonzero(self.frames.keyframes == keyframe), self.events)
        return appears


def check_presence(presence: object) -> None:
    """Raise InvalidInput for what is none of `PRESENCES`."""
    if not isinstance(presence, str) or presence not in PRESENCES:
        raise InvalidInput(
            f"presence must be {' or '.join(map(repr, PRESENCES))}, got {shown(presence)}"
        )


def _table(keyframes: Sequence[Annotations]) -> ObjectFrames:
    centres = np.concatenate([annotations.boxes[:, :2] for annotations in keyframes])
    return ObjectFrames(
        np.repeat(np.arange(len(keyframes)), [len(annotations) for annotations in keyframes]),
        np.concatenate([annotations.objects for annotations in keyframes]),
        np.concatenate([annotations.classes for annotations in keyframes]),
        np.hypot(*centres.T),
        np.arctan2(centres[:, 1], centres[:, 0]),
    )


def _check(scene: str, rows: ObjectFrames) -> None:
    lost = np.flatnonzero(~np.isfinite(rows.ranges))
    # Sorted by keyframe, then object: an object that is annotated twice follows itself.
    order = np.lexsort((rows.objects, rows.keyframes))
    again = order[1:][(np.diff(rows.keyframes[order]) == 0) & (np.diff(rows.objects[order]) == 0)]
    for fault, faulty in (("has no finite centre", lost), ("is annotated more than once", again)):
        for row in faulty[:1]:
            place = f"scene {scene}, keyframe {rows.keyframes[row]}"
            raise InvalidInput(f"{place}: object {rows.objects[row]} {fault}")

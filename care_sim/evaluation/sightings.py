"""First-sighting events of a scene (paper, Sec. 3 and Remark 1). They depend on the film alone, on
no policy.

"A first sighting is the first keyframe at which an annotated object within range R appears in the
scene, excluding objects present at scene start." Only objects within range are in the scored scene,
so this sentence covers every case:

- not annotated at the first keyframe, and later scored within range: an event where it is first
  scored, by its first return or pixel;
- annotated beyond R and then nearer (it enters by range): an event where it is first scored within
  R, a "new entry" like any other;
- within R at the first keyframe: "present at scene start", never an event;
- gone and back (range or annotations): "reappearances after annotation gaps are not scored
  separately", so an object has at most one event;
- never within R: no event.

The sentence ignores visibility. By the default, `presence="annotated"`, an object annotated within
R at the first keyframe is present there, even without a return or a pixel
(`care_sim.loops.film.Film.hidden`). It is no event when it appears.

This rule removes the closed loop's main case: a person who stands behind a parked van from the
first keyframe on and then walks out. Its effect depends on the annotator. People who annotated
recordings seldom drew a box where they saw nothing. The generator of a street annotates everybody,
also invisible objects.

With `presence="visible"` only objects that a sensor shows at the first keyframe are present, so the
person behind the van is an event. `Sightings.emerging` are the events by which the two counts
differ. Both rules score the same objects at a keyframe.
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
"""Objects present at scene start: all annotated ones, or those with a return or a pixel."""


@dataclass(frozen=True)
class ObjectFrames:
    """Annotated objects in range, a row per object and keyframe, in order of keyframe.

    `keyframes` (r,) count from 0, `objects` (r,) are numbers of the film, `classes` (r,) index
    `care_sim.core.types.CLASSES`. `ranges` (r,) are planar metres, `azimuths` (r,) radians from
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
        """Return the rows chosen by index or mask."""
        return ObjectFrames(*(getattr(self, column.name)[rows] for column in fields(self)))


@dataclass(frozen=True)
class Sightings:
    """Everything to detect in a scene, the same for every policy.

    `keyframes` are its annotations. `in_range` (n,) marks the scored objects of all keyframes in
    order, those within `RANGE_M`: the rows of `frames`. `first_ranges` (r,) are the planar metres
    at which the annotations first show each row's object, within range or beyond. `events` (e,) are
    the rows of first sightings, ascending.

    `emerging` (m,), ascending, are the rows at which an object appears that was hidden within range
    at the first keyframe. They are events by the presence "visible", not by "annotated".
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
        """Return the sightings of a scene's annotations, one entry per keyframe; `hidden` are those
        of `Film.hidden`.

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

        # Objects beyond the range are not in the scored scene, so they are neither present nor
        # appear there.
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

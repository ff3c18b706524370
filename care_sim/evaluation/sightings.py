"""First-sighting events of a scene (paper, Sec. 3 and Remark 1). They depend on the film alone, on no policy.

"A first sighting is the first keyframe at which an annotated object within range R appears in the scene, excluding
objects present at scene start." Only objects within range are in the scene that is scored, so this one sentence
settles every case:

- first annotated, within range, after the first keyframe (it came out of an occlusion or round a corner): an event;
- annotated from the start or later, but beyond R, and then nearer (it enters by range): an event where it is first
  within R, a "new entry" like any other;
- within R at the first keyframe: "present at scene start", never an event, whatever it does later;
- gone and back, out of range or out of the annotations: "reappearances after annotation gaps are not scored
  separately", so an object has one event at most;
- never within R: no event.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from care_sim.errors import InvalidInput, check_number
from care_sim.film import Annotations
from care_sim.frames import Floats
from care_sim.grid import Cells

RANGE_M = 50.0
"""R: planar distance from the sensor to the centre of the box, this value included (paper, Remark 1)."""


@dataclass(frozen=True)
class ObjectFrames:
    """Every annotated object at every keyframe at which it is in range, in order of keyframe, as columns of one table.

    `keyframes` (r,) from 0, `objects` (r,) numbers of the film, `classes` (r,) into `care_sim.types.CLASSES`,
    `ranges` (r,) planar metres and `azimuths` (r,) radians from straight ahead towards the left, in the sensor frame.
    """

    keyframes: Cells
    objects: Cells
    classes: Cells
    ranges: Floats
    azimuths: Floats

    def __len__(self) -> int:
        return len(self.keyframes)

    def take(self, rows: Cells | NDArray[np.bool_]) -> "ObjectFrames":
        """Some of the rows, by index or mask."""
        return ObjectFrames(*(getattr(self, column.name)[rows] for column in fields(self)))


@dataclass(frozen=True)
class Sightings:
    """What there is to find in a scene, the same for every policy.

    `keyframes` are the annotations it was made from and `in_range` (n,) marks which of their objects, one keyframe
    after the other, are scored: these are the rows of `frames`. `events` (e,) are the rows of `frames` that are first
    sightings, ascending.
    """

    scene: str
    keyframes: tuple[Annotations, ...]
    in_range: NDArray[np.bool_]
    frames: ObjectFrames
    events: Cells

    @classmethod
    def of(cls, scene: str, keyframes: Sequence[Annotations], range_m: float = RANGE_M) -> "Sightings":
        """The sightings of the scene's annotations, one entry a keyframe.

        Raises InvalidInput for a scene without a keyframe, for an object annotated twice at one keyframe or without a
        finite centre, and for a range below 0.
        """
        if not keyframes:
            raise InvalidInput(f"scene {scene}: a scene must have at least one keyframe")
        check_number("range_m", range_m, 0)
        rows = _table(keyframes)
        _check(scene, rows)
        in_range = rows.ranges <= range_m
        frames = rows.take(in_range)
        return cls(scene, tuple(keyframes), in_range, frames, _first_sightings(frames))

    def scored(self, keyframe: int) -> NDArray[np.bool_]:
        """(n,) which annotations of a keyframe are in range."""
        start = sum(map(len, self.keyframes[:keyframe]))
        return self.in_range[start : start + len(self.keyframes[keyframe])]

    def appearing(self, keyframe: int) -> NDArray[np.bool_]:
        """(n,) which annotations of a keyframe are first sightings."""
        appears = self.scored(keyframe).copy()
        appears[appears] = np.isin(np.flatnonzero(self.frames.keyframes == keyframe), self.events)
        return appears


def _first_sightings(frames: ObjectFrames) -> Cells:
    _, first = np.unique(frames.objects, return_index=True)
    return np.sort(first[frames.keyframes[first] > 0]).astype(np.int64)


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
    order = np.lexsort((rows.objects, rows.keyframes))
    again = order[1:][(np.diff(rows.keyframes[order]) == 0) & (np.diff(rows.objects[order]) == 0)]
    for fault, faulty in (("has no finite centre", lost), ("is annotated more than once", again)):
        for row in faulty[:1]:
            place = f"scene {scene}, keyframe {rows.keyframes[row]}"
            raise InvalidInput(f"{place}: object {rows.objects[row]} {fault}")

"""What is true about the objects that a keyframe shows for the first time, before it is fired.

Truth, that is which object lies behind a return, a camera box or a track, is read here for the
scoring. No policy receives it.
"""

from dataclasses import dataclass

import numpy as np

from care_sim.core.belief import Belief
from care_sim.core.grid import Cells
from care_sim.core.residual import explained, wedges
from care_sim.evaluation.miss_reasons import Appearance
from care_sim.evaluation.sightings import Sightings
from care_sim.loops.open_loop import OpenLoop

_COVERAGE = 0.5
"""Share of the cells of an object's hull that hulls of tracks hold where it appears inside
established coverage.
"""


@dataclass(frozen=True)
class NewObject:
    """An object at its first sighting: what the scoring knows of its `appearance`; `hull` (n,) are
    the cells that a perfect track of it would ask for, and `covered` says whether hulls of the
    tracks hold half of them or more.
    """

    appearance: Appearance
    hull: Cells
    covered: bool


def new_objects(loop: OpenLoop, belief: Belief, sightings: Sightings) -> list[NewObject]:
    """The first sightings of the coming keyframe, in the order of `sightings.events`. `belief` is
    what the policies are shown of it.
    """
    annotations = loop.shot.annotations
    rows = np.flatnonzero(sightings.appearing(loop.index))
    if not len(rows):
        return []
    pictured = loop.true_detected_objects()
    own_wedges = wedges(belief.detections, loop.rig)
    by_memory = explained(belief.detections, belief.tracks, loop.rig)
    tracked = loop.true_objects(belief.tracks)
    known = np.concatenate([*loop.rig.hulls(belief.tracks.boxes), np.empty(0, np.int64)])
    hulls = loop.rig.hulls(annotations.boxes[rows])
    made = []
    for number, hull in zip(annotations.objects[rows].tolist(), hulls, strict=True):
        boxes = np.flatnonzero(pictured == number)
        cloud = loop.shot.cloud.to_shots()
        appearance = Appearance(
            returns=cloud.cells[cloud.objects == number],
            wedges=tuple(own_wedges[box] for box in boxes.tolist()),
            explained=by_memory[boxes],
            tracked=number in tracked,
        )
        made.append(NewObject(appearance, hull, is_covered(hull, known)))
    return made


def is_covered(hull: Cells, known: Cells) -> bool:
    """Whether an object with this `hull` (n,) appears inside established coverage: hulls of tracks,
    whose cells are `known` (m,), hold half of it or more.
    """
    return bool(np.isin(hull, known).sum() >= _COVERAGE * len(hull))

"""A camera detector with the errors of a profile: misses, confused classes, jitter, ghosts."""

from collections.abc import Sequence

import numpy as np

from care_sim.core.arrays import Floats, Integers
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import IdentifiedDetections
from care_sim.sensors.box_pool import BoxPool
from care_sim.sensors.camera_errors import Ghosts, PersistentDraws, confused, jittered, seen_as
from care_sim.sensors.camera_profiles import CameraProfile

_JITTERED = 4
"""A box's middle across and down, its width and its height."""


class ProfiledDetector:
    """Makes of faultless detections what a detector of a profile reports.

    `objects` (n,) are all that it may ever find, `cameras` those that take the pictures. Ghosts are
    made from `pool`. Every kind of error has a random stream of its own.
    """

    def __init__(
        self,
        profile: CameraProfile,
        objects: Integers,
        cameras: Sequence[PinholeCamera],
        keyframe_s: float,
        pool: BoxPool,
        seeds: Sequence[np.random.SeedSequence],
    ):
        misses, jitter, confusion, ghosts = (np.random.default_rng(seed) for seed in seeds)
        self._profile = profile
        self._objects = objects
        self._order = np.argsort(objects)
        self._cameras = cameras
        self._matrix = profile.confusion_matrix()
        self._spreads = np.array([group.jitter for group in profile.groups])
        # A number for every group: no class need be known of an object before it is seen.
        times_s = [group.miss_time_s for group in profile.groups]
        self._misses = PersistentDraws(len(objects), times_s, keyframe_s, misses)
        jitter_times_s = [profile.jitter_time_s] * _JITTERED
        self._jitter = PersistentDraws(len(objects), jitter_times_s, keyframe_s, jitter)
        self._confusion = PersistentDraws(
            len(objects), [profile.confusion_time_s], keyframe_s, confusion
        )
        self._ghosts = Ghosts(
            pool,
            profile.ghosts_per_picture,
            profile.ghost_time_s,
            keyframe_s,
            len(cameras),
            ghosts,
        )

    def report(self, seen: IdentifiedDetections, boxes: Floats) -> tuple[Floats, Integers]:
        """What is reported of the faultless detections `seen` (m,): rows (k, 9) as
        `ImageDetections.rows`, and (k,) the object behind each.

        `boxes` (n, 7) are the 3D boxes of all objects in the sensor frame.
        """
        # Where the detections' objects stand among all.
        places = self._order[np.searchsorted(self._objects, seen.objects, sorter=self._order)]
        # All numbers are drawn at every keyframe, whatever is there.
        misses, jitter, confusion = (
            draws.next()[places] for draws in (self._misses, self._jitter, self._confusion)
        )
        classes = seen.detections.classes
        groups = self._profile.groups_of(classes)
        own_misses = misses[np.arange(len(seen)), groups]
        (found,) = np.nonzero(own_misses < self._recalls(seen, groups, boxes[places]))

        rows = seen.detections.rows()[found]
        rows[:, ImageDetections.CLASS] = confused(classes[found], confusion[found, 0], self._matrix)
        rows[:, ImageDetections.BOX] = jittered(
            rows[:, ImageDetections.BOX],
            jitter[found],
            self._spreads[groups[found]],
            seen.detections.cameras[found],
            self._cameras,
        )
        return rows, seen.objects[found]

    def ghosts(self, shown: Floats, time_s: float) -> Floats:
        """(k, 9) the ghosts of this keyframe's pictures, beside the boxes `shown` (n, 9)."""
        return self._ghosts.draw(shown, time_s)

    def _recalls(self, seen: IdentifiedDetections, groups: Integers, boxes: Floats) -> Floats:
        """(m,) the chances to find the objects `seen` (m,) of `groups` (m,) with `boxes` (m, 7)."""
        heights, shares = seen_as(seen, boxes, self._cameras, self._profile.focal_px)
        recalls = np.empty(len(seen))
        for number, group in enumerate(self._profile.groups):
            own = groups == number
            recalls[own] = group.recall.at(heights[own], shares[own])
        return recalls

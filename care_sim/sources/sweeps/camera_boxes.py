"""Boxes that a 2D detector reported on the pictures of a log."""

from collections import defaultdict
from pathlib import Path

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.frames import Frame
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.types import ImageDetections
from care_sim.sensors.annotated import Annotations, IdentifiedDetections
from care_sim.sources.nuscenes.detections import DetectionFile, Found, objects_behind
from care_sim.sources.sweeps.logs import SWEEPS_KEYFRAME_S, Log
from care_sim.sources.sweeps.tables import in_seconds


class CameraBoxes:
    """The boxes of a file in a form of `care_sim.sources.nuscenes.detections`. A picture is named
    CAMERA/TIME: the number of its camera in the set-up, from 0, and the time as that of a sweep.

    At a keyframe counts the newest picture of each camera that has boxes, up to half a second old,
    with its age and the car's turn since.
    """

    def __init__(self, path: Path, cameras: tuple[PinholeCamera, ...], log: Log):
        self._cameras, self._log = cameras, log
        pictures: dict[int, list[tuple[float, list[Found]]]] = defaultdict(list)
        for name, boxes in DetectionFile(path).pictures.items():
            camera, _, time = name.partition("/")
            try:
                pictures[int(camera[:9])].append((float(time), boxes))
            except ValueError as error:
                raise InvalidInput(
                    f"{path}: the picture {name!r:.100} must be named CAMERA/TIME, as 0/12.5"
                ) from error
        if any(not 0 <= number < len(cameras) for number in pictures):
            raise InvalidInput(
                f"{path}: cameras must be numbers from 0 on of the {len(cameras)} [[cameras]] in "
                f"the set-up, got {sorted(pictures)}"
            )
        self._pictures = {}
        for number, taken in pictures.items():
            taken.sort(key=lambda picture: picture[0])
            times = in_seconds(np.array([time for time, _ in taken]))
            self._pictures[number] = times, [boxes for _, boxes in taken]

    def seen(self, time_s: float, car: Frame, annotations: Annotations) -> IdentifiedDetections:
        """Return the boxes at a keyframe, each with the object that it lies on."""
        rows = [np.empty((0, len(ImageDetections.COLUMNS)))]
        objects = [np.empty(0, np.int64)]
        for number, (times, pictures) in self._pictures.items():
            newest = int(np.searchsorted(times, time_s, side="right")) - 1
            if newest < 0 or time_s - times[newest] > SWEEPS_KEYFRAME_S:
                continue
            found = pictures[newest]
            boxes = np.array([box for _, _, box in found])
            classes = np.array([label for label, _, _ in found], np.int64)
            # A picture may be older than the first pose.
            taken = np.clip(times[newest : newest + 1], *self._log.poses[[0, -1], 0])
            (then,) = self._log.cars(taken)
            turn = (car.yaw - then.yaw + np.pi) % (2 * np.pi) - np.pi
            told = np.tile([number, time_s - times[newest], turn], (len(found), 1))
            rows.append(np.column_stack([classes, [sure for _, sure, _ in found], boxes, told]))
            camera = self._cameras[number]
            limits = np.array([camera.width, camera.height] * 2)
            spans = np.nan_to_num(camera.project_boxes(annotations.boxes))
            objects.append(objects_behind(boxes, classes, np.clip(spans, 0, limits), annotations))
        return IdentifiedDetections(
            ImageDetections.from_rows(np.concatenate(rows)), np.concatenate(objects)
        )

"""The reference of a log without labels: what the full-scan detector finds and tracks."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from care_sim.base.errors import InvalidInput
from care_sim.core.arrays import Floats, Integers
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES, Detections
from care_sim.perception.detectors import CLUSTER, PRIVILEGED, check_detector, make_detector
from care_sim.perception.tracker import MemoryRules, TrackMemory
from care_sim.sensors.annotated import NO_ANNOTATIONS, NO_OBJECT, Annotations, Cloud
from care_sim.sources.nuscenes.sweeps import points_of_grid
from care_sim.sources.sweeps.logs import SWEEPS_KEYFRAME_S

STABLE_KEYFRAMES = 3
"""The paper counts stable entries. The gate of the third detection is the first narrow one, since
the track then has a velocity.
"""
_RULES = MemoryRules(coast_s=SWEEPS_KEYFRAME_S)
"""A track outlives one missed keyframe. After more, its gate holds clusters of something else."""


def check_reference(name: str) -> None:
    """Raise InvalidInput for no detector, and for one that needs annotations itself."""
    check_detector(name)
    if name in PRIVILEGED:
        raise InvalidInput(f"reference must be a detector that sees points alone, got {name}")


def reference(
    sweeps: Sequence[Floats],
    sensors: Sequence[Frame],
    detector: str,
    grid: AngularGrid,
    sensor_height_m: float,
) -> list[Annotations]:
    """Return the annotations of every keyframe, from its points (n, 3) in the frame of its sensor.

    The `detector` gets the full scan of every keyframe. Detections are tracked by place alone,
    since the class of a cluster changes with its view. An object is annotated at the keyframes at
    which it is detected, if these are at least `STABLE_KEYFRAMES`, with the class that it has most
    often.
    """
    made = make_detector(detector, sensor_height_m, **{"grid": grid} if detector == CLUSTER else {})
    memory = TrackMemory(SWEEPS_KEYFRAME_S, _RULES)
    found: list[Detections] = []
    tracks: list[Integers] = []
    for points, sensor in zip(sweeps, sensors, strict=True):
        cells, kept = points_of_grid(points, grid)
        cloud = Cloud(cells, kept, np.full(len(cells), NO_OBJECT))
        detections, _ = made.detect(cloud, NO_ANNOTATIONS)
        alike = replace(detections, classes=np.zeros(len(detections), np.int64))
        found.append(detections)
        tracks.append(memory.update(alike, sensor))
        memory.predict()
    counts = np.zeros((max((ids.max(initial=-1) for ids in tracks)) + 1, len(CLASSES)), np.int64)
    for detections, ids in zip(found, tracks, strict=True):
        np.add.at(counts, (ids, detections.classes), 1)
    stable, classes = counts.sum(axis=1) >= STABLE_KEYFRAMES, counts.argmax(axis=1)
    return [
        Annotations(ids[stable[ids]], classes[ids[stable[ids]]], detections.boxes[stable[ids]])
        for detections, ids in zip(found, tracks, strict=True)
    ]

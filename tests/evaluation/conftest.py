"""Random streets, and reports of a detector about them."""

import numpy as np
import pytest

from care_sim.core.types import CLASSES, Detections
from care_sim.evaluation.recall import SceneScore
from care_sim.perception.matching import found_objects
from care_sim.sensors.annotated import Annotations


@pytest.fixture(scope="session")
def street():
    """A random street of 8 keyframes from a seed: up to 12 objects that come, go and move, to 70 m
    away.
    """

    def make(seed):
        rng = np.random.default_rng(seed)
        count = int(rng.integers(0, 13))
        classes = rng.integers(0, len(CLASSES), count)
        paths = rng.uniform(-50, 50, (count, 2)) + rng.normal(0, 4, (8, count, 2)).cumsum(axis=0)
        return [keyframe(classes, centres, rng.random(count) < 0.7) for centres in paths]

    return make


def keyframe(classes, centres, present):
    objects = np.flatnonzero(present)
    boxes = np.tile([0.0, 0.0, -1.0, 2.0, 1.0, 1.5, 0.3], (len(objects), 1))
    boxes[:, :2] = centres[objects]
    return Annotations(objects, classes[objects], boxes)


@pytest.fixture(scope="session")
def detector():
    """Reports of a street from a seed: some objects, half a metre off, some of another class, and
    some that are not.
    """

    def make(street, seed):
        rng = np.random.default_rng(seed)
        return [_report(annotations, rng) for annotations in street]

    return make


def _report(annotations, rng):
    kept = rng.random(len(annotations)) < 0.6
    boxes = np.concatenate([annotations.boxes[kept], rng.uniform(-60, 60, (3, 7))])
    boxes[:, :2] += rng.normal(0, 0.5, (len(boxes), 2))
    classes = np.concatenate([annotations.classes[kept], [0, 3, 4]])
    classes = np.where(rng.random(len(classes)) < 0.1, (classes + 1) % len(CLASSES), classes)
    return Detections(classes, boxes, np.full(len(classes), 3))


@pytest.fixture(scope="session")
def score_scene():
    """Score the reports of a scene, one per keyframe."""

    def make(sightings, reports):
        pairs = zip(sightings.keyframes, reports, strict=True)
        return SceneScore.of(sightings, [found_objects(shown, report) for shown, report in pairs])

    return make

"""Tracks of crowds: who could be two is assigned as in a single world."""

import numpy as np
import pytest

from care_sim.loops.stages.scanning import Found
from care_sim.loops.stages.state import BatchState, filled
from care_sim.loops.stages.tracking import Tracking
from care_sim.core.frames import Frame
from care_sim.core.types import Detections
from care_sim.perception.tracker import MemoryRules, TrackMemory

DT = 0.1


@pytest.mark.parametrize(
    ("people", "spread", "line"), [(12, 4.0, 2), (12, 4.0, 5), (40, 200.0, 3), (300, 500.0, 2)]
)
def test_crowds_are_tracked_as_in_a_single_world(people, spread, line):
    """Of 300 that are new at every keyframe there are soon more than a table has rows."""
    worlds, keyframes = 3, 8
    draw = np.random.default_rng(people)
    state = BatchState(worlds)
    rules, tracking = MemoryRules(velocity_keyframes=line), Tracking(DT, line)
    memories = [TrackMemory(DT, rules) for _ in range(worlds)]
    state.live[:] = True, True, False
    boxes = draw.normal(size=(worlds, people, 7)) * spread
    boxes[:, :, 3:6] = 1.0
    classes = draw.integers(0, 2, (worlds, people))
    for world in range(worlds):
        rows = state.reported._replace(
            bodies=filled(state.reported.bodies, world, np.arange(people)),
            classes=filled(state.reported.classes, world, classes[world]),
        )
        state.reported = rows
    for _ in range(keyframes):
        boxes[:, :, :2] += draw.normal(size=(worlds, people, 2)) * (40 if people == 300 else 0.5)
        found = Found(np.zeros(worlds, np.int64), np.zeros((worlds, people), np.int64))
        for world in range(worlds):
            state.bodies = state.bodies._replace(
                boxes=filled(state.bodies.boxes, world, boxes[world])
            )
            seen = np.flatnonzero(draw.random(people) < 0.8)
            found.counts[world] = len(seen)
            found.rows[world, : len(seen)] = seen
            sensor = Frame(*draw.normal(size=2), 1.84, draw.uniform(-3, 3))
            state.sensors.poses[world] = sensor.x, sensor.y, sensor.z, sensor.yaw, 0, 0
            state.sensors.turns[world] = np.cos(sensor.yaw), np.sin(sensor.yaw)
            state.sensors.turns_back[world] = sensor.turn_back
            if state.live[world]:
                local = sensor.boxes_to_local(boxes[world, seen])
                detections = Detections(classes[world, seen], local, np.full(len(seen), 3))
                memories[world].update(detections, sensor)
        tracking.update(state, found)
        counts, rows = tracking.seen(state)
        for world in np.flatnonzero(state.live):
            pose = state.sensors.poses[world]
            expected = memories[world].tracks(Frame(*pose[:4])).rows()
            same(rows[world, : counts[world]], expected)
            memories[world].predict()
        tracking.predict(state)
        for world in np.flatnonzero(state.live):
            same(state.tracks.rows[world, : state.tracks.counts[world]], memories[world]._table)
    assert state.tracks.counts[2] == 0
    assert people < 300 or state.tracks.rows.shape[1] > 256


def same(ours, theirs):
    assert ours.shape == theirs.shape
    assert ours.tobytes() == theirs.tobytes()

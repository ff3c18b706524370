"""Tracks of crowds: who could be two is assigned as in a single world."""

import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.core.types import Detections
from care_sim.loops.stages.state import State
from care_sim.loops.stages.tracking import Tracking
from care_sim.perception.found import Found
from care_sim.perception.tracker import MemoryRules, TrackMemory

DT = 0.1


@pytest.mark.parametrize(
    ("people", "spread", "line"), [(12, 4.0, 2), (12, 4.0, 5), (40, 200.0, 3), (300, 500.0, 2)]
)
def test_crowds_are_tracked_as_in_a_single_world(people, spread, line):
    """If 300 are new at every keyframe, there are soon more than a table has rows."""
    worlds, keyframes = 3, 8
    draw = np.random.default_rng(people)
    state = State(worlds)
    rules, tracking = MemoryRules(velocity_keyframes=line), Tracking(DT, line)
    memories = [TrackMemory(DT, rules) for _ in range(worlds)]
    state.live[:] = True, True, False
    boxes = draw.normal(size=(worlds, people, 7)) * spread
    boxes[:, :, 3:6] = 1.0
    classes = draw.integers(0, 2, (worlds, people))
    for _ in range(keyframes):
        boxes[:, :, :2] += draw.normal(size=(worlds, people, 2)) * (40 if people == 300 else 0.5)
        found = Found.of(worlds, people)
        ids = {}
        for world in range(worlds):
            seen = np.flatnonzero(draw.random(people) < 0.8)
            sensor = Frame(*draw.normal(size=2), 1.84, draw.uniform(-3, 3))
            state.sensors.put(world, sensor)
            local = sensor.boxes_to_local(boxes[world, seen])
            found.counts[world] = len(seen)
            found.classes[world, : len(seen)] = classes[world, seen]
            found.boxes[world, : len(seen)] = local
            if state.live[world]:
                detections = Detections(classes[world, seen], local, np.full(len(seen), 3))
                ids[world] = memories[world].update(detections, sensor)
        tracking.update(state, found)
        for world, expected in ids.items():
            assert found.tracks[world, : len(expected)].tolist() == expected.tolist()
        counts, rows = tracking.seen(state, state.taken)
        for world in np.flatnonzero(state.live):
            expected = memories[world].tracks(state.sensors.frame(world)).rows()
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

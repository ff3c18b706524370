import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_sim.core.frames import Frame
from care_sim.core.types import CLASSES, Detections, Tracks
from care_sim.perception import tracker
from care_sim.perception.tracker import MemoryRules, TrackMemory

STILL = Frame(0.0, 0.0, 1.84, 0.0)
DT = 0.1


def detections(*objects, sensor=STILL):
    """Detections from (class name, world x, world y), as `sensor` sees them."""
    boxes = np.array([[x, y, 0.9, 2, 1, 1.8, 0.3] for _, x, y in objects], dtype=float).reshape(
        -1, 7
    )
    classes = np.array([CLASSES.index(name) for name, _, _ in objects], dtype=np.int64)
    return Detections(classes, sensor.boxes_to_local(boxes), np.full(len(objects), 5))


def follow(memory, frames, sensor=STILL):
    """Feed frames of objects; returns the tracks after each update."""
    history = []
    for objects in frames:
        memory.predict()
        memory.update(detections(*objects, sensor=sensor), sensor)
        history.append(memory.tracks(sensor))
    return history


def moving(name, x, y, vx, vy, keyframes, since=0):
    return [[(name, x + vx * DT * t, y + vy * DT * t)] for t in range(since, since + keyframes)]


def test_the_first_sight_has_a_box_and_no_velocity():
    (tracks,) = follow(TrackMemory(DT), [[("car", 10, 2)]])
    assert tracks.boxes[0] == pytest.approx([10, 2, 0.9 - 1.84, 2, 1, 1.8, 0.3])
    assert tracks.velocities.tolist() == [[0, 0]]
    assert (tracks.ids.tolist(), tracks.misses.tolist()) == ([0], [0])


def test_of_equally_near_tracks_the_older_comes_first():
    (tracks,) = follow(TrackMemory(DT), [[("car", 10, 2), ("car", 10, -2), ("car", 9, 0)]])
    assert tracks.ids.tolist() == [2, 0, 1]


def test_velocity_from_two_frames_and_a_forecast_one_keyframe_ahead():
    memory = TrackMemory(DT)
    tracks = follow(memory, moving("car", 10, 2, 8, -3, 2))[-1]
    assert tracks.velocities[0] == pytest.approx([8, -3])
    memory.predict()
    assert memory.tracks(STILL).boxes[0, :2] == pytest.approx([10 + 8 * 0.2, 2 - 3 * 0.2])


def test_each_detection_is_told_the_velocity_of_its_track_and_a_new_one_0():
    """Over ground, in the axes of a sensor that looks along y; tracks that died leave gaps in the
    ids.
    """
    memory, turned = TrackMemory(DT, MemoryRules(coast_s=0.0)), Frame(0.0, 0.0, 1.84, np.pi / 2)
    gone = [("bus", 30, 30), ("car", 10, 2), ("pedestrian", 5, -5)]
    memory.update(detections(*gone, sensor=turned), turned)
    memory.predict()
    ids = memory.update(
        detections(("bicycle", 9, 9), ("pedestrian", 5, -4.9), ("car", 10.8, 2), sensor=turned),
        turned,
    )
    assert ids.tolist() == [3, 2, 1]
    assert memory.velocities(ids, turned) == pytest.approx(np.array([[0, 0], [1, 0], [0, -8]]))


def test_ids_stay_with_two_people_whose_ways_cross():
    """They pass half a metre from each other, in opposite directions."""
    frames = [
        [("pedestrian", 10, -2 + 2 * DT * t), ("pedestrian", 10.5, 2 - 2 * DT * t)][
            :: 1 if t % 2 else -1
        ]
        for t in range(21)
    ]
    memory = TrackMemory(DT)
    history = follow(memory, frames)
    for tracks in history[1:]:
        by_place = sorted(
            zip(tracks.boxes[:, 0].tolist(), tracks.velocities[:, 1].tolist(), strict=True)
        )
        assert len(tracks) == 2
        assert [speed for _, speed in by_place] == pytest.approx([2, -2])
    ids = [
        dict(zip(np.round(t.boxes[:, 0], 1).tolist(), t.ids.tolist(), strict=True)) for t in history
    ]
    assert all(one == ids[0] for one in ids)


def test_a_track_coasts_and_its_velocity_bridges_the_gap():
    memory = TrackMemory(DT)
    frames = moving("car", 10, 0, 8, 0, 3)
    history = follow(memory, [*frames, [], [], *moving("car", 10, 0, 8, 0, 1, since=5)])
    assert [tracks.misses.tolist() for tracks in history] == [[0], [0], [0], [1], [2], [0]]
    assert history[4].boxes[0, 0] == pytest.approx(10 + 0.8 * 4)
    assert history[5].ids.tolist() == [0]
    assert history[5].velocities[0] == pytest.approx([8, 0])


@pytest.mark.parametrize(("keyframe_s", "kept"), [(0.1, 15), (0.5, 3)])
def test_an_undetected_track_dies_after_a_second_and_a_half(keyframe_s, kept):
    memory = TrackMemory(keyframe_s)
    history = follow(memory, [[("car", 10, 0)], *[[]] * (kept + 1)])
    assert [len(tracks) for tracks in history] == [1] * (kept + 1) + [0]


def test_another_class_is_another_object():
    history = follow(TrackMemory(DT), [[("car", 10, 0)], [("truck", 10, 0)]])
    assert sorted(history[-1].ids.tolist()) == [0, 1]
    assert sorted(history[-1].misses.tolist()) == [0, 1]


def test_an_update_names_the_track_of_every_detection():
    """One goes on, one dies in the same keyframe, and two begin, in any order."""
    memory = TrackMemory(DT)
    follow(memory, [[("car", 10, 0)], *[[("truck", 30, 0)]] * 14])
    memory.predict()
    seen = detections(("pedestrian", 5, 5), ("truck", 30, 0), ("bicycle", 20, -8))
    assert memory.update(seen, STILL).tolist() == [2, 1, 3]
    memory.predict()
    assert memory.update(detections(("truck", 30, 0), ("pedestrian", 5, 5)), STILL).tolist() == [
        1,
        2,
    ]
    tracks = memory.tracks(STILL)
    places = {
        number: box[0]
        for number, box in zip(tracks.ids.tolist(), tracks.boxes.tolist(), strict=True)
    }
    assert places == pytest.approx({1: 30, 2: 5, 3: 20})


@pytest.mark.parametrize(("jump", "same"), [(1.99, True), (2.01, False)])
def test_a_settled_track_is_matched_within_two_metres_of_its_forecast(jump, same):
    frames = moving("car", 10, 0, 5, 0, 3)
    history = follow(TrackMemory(DT), [*frames, [("car", 10 + 5 * DT * 3, jump)]])
    assert len(history[-1]) == (1 if same else 2)


@pytest.mark.parametrize(("jump", "same"), [(3.49, True), (3.51, False)])
def test_a_track_seen_once_is_matched_within_what_it_can_have_moved(jump, same):
    """2 m, and 15 m/s for 0.1 s."""
    history = follow(TrackMemory(DT), [[("car", 10, 0)], [("car", 10, jump)]])
    assert len(history[-1]) == (1 if same else 2)


def test_the_nearest_assignment_wins_as_a_whole():
    """The new object stands nearer to track 0 than track 0's own detection, and is not mistaken for
    it.
    """
    frames = [[("car", 10, 0), ("car", 13, 0)]] * 3
    history = follow(
        TrackMemory(DT), [*frames, [("car", 11.2, 0), ("car", 10, 0.1), ("car", 13, 0.1)]]
    )
    tracks = history[-1]
    where = dict(zip(tracks.ids.tolist(), tracks.boxes[:, :2].tolist(), strict=True))
    assert where[0] == pytest.approx([10, 0.1])
    assert where[1] == pytest.approx([13, 0.1])
    assert where[2] == pytest.approx([11.2, 0])


def test_a_turning_ego_sees_standing_things_stand():
    memory = TrackMemory(DT)
    for t in range(20):
        yaw = 0.06 * t
        sensor = Frame(8 / 0.6 * np.sin(yaw), 8 / 0.6 * (1 - np.cos(yaw)), 1.84, yaw)
        memory.predict()
        memory.update(detections(("car", 20, 5), ("pedestrian", 12, -3), sensor=sensor), sensor)
    ahead = Frame(8 / 0.6 * np.sin(1.2), 8 / 0.6 * (1 - np.cos(1.2)), 1.84, 1.2)
    memory.predict()
    forecast = memory.tracks(ahead)
    expected = detections(("car", 20, 5), ("pedestrian", 12, -3), sensor=ahead).boxes
    assert sorted(forecast.ids.tolist()) == [0, 1]
    assert forecast.velocities == pytest.approx(np.zeros((2, 2)), abs=1e-9)
    assert forecast.boxes[np.argsort(forecast.ids)] == pytest.approx(expected)


def test_velocities_are_over_ground_in_sensor_axes():
    """The sensor faces left: what drives along world x moves to its right."""
    left = Frame(5.0, 0.0, 1.84, np.pi / 2)
    tracks = follow(TrackMemory(DT), moving("car", 10, 10, 8, 0, 2), left)[-1]
    assert tracks.velocities[0] == pytest.approx([0, -8])
    assert tracks.boxes[0, :2] == pytest.approx([10, -5.8])


def smoothing(keyframes):
    return TrackMemory(DT, MemoryRules(velocity_keyframes=keyframes))


def test_an_error_that_alternates_leaves_the_velocity_of_least_squares():
    """Errors of +-0.1 m at four keyframes change a line's slope by -0.04 m per keyframe: (-1.5,
    -.5, .5, 1.5) times (.1, -.1, .1, -.1), over 5. Two keyframes are off by -0.2 m.
    """
    frames = [[("car", 10 + 0.8 * t + 0.1 * (-1) ** t, 2)] for t in range(4)]
    assert follow(TrackMemory(DT), frames)[-1].velocities[0] == pytest.approx([8 - 2, 0])
    assert follow(smoothing(4), frames)[-1].velocities[0] == pytest.approx([8 - 0.4, 0])


@pytest.mark.parametrize("missed", [0, 1, 5])
@pytest.mark.parametrize("keyframes", [3, 5, 10])
def test_place_and_velocity_are_a_line_through_the_detections(keyframes, missed):
    """With keyframes missed before the last one, too. Height, size and yaw are as detected."""
    draw = np.random.default_rng(keyframes)
    times = [*range(keyframes - 1), keyframes - 1 + missed]
    seen = {t: draw.normal((10 + 0.8 * t, 2 - 0.3 * t), 0.1) for t in times}
    memory = smoothing(10)
    for t in range(times[-1] + 1):
        memory.predict()
        boxes = [[*seen[t], t, 4 + t, 2 + t, 1 + t, 0.1 * t]] if t in seen else []
        found = Detections([0] * len(boxes), np.reshape(boxes, (-1, 7)), [5] * len(boxes))
        memory.update(found, Frame(0.0, 0.0, 0.0, 0.0))
    tracks = memory.tracks(Frame(0.0, 0.0, 0.0, 0.0))
    slope, start = np.polyfit(times, [*seen.values()], 1)
    assert tracks.velocities[0] == pytest.approx(slope / DT)
    assert tracks.boxes[0, :2] == pytest.approx(start + slope * times[-1])
    assert tracks.boxes[0, 2:] == pytest.approx(boxes[0][2:])


def test_older_detections_than_are_asked_for_fade():
    """A track that stood for 10 keyframes and is 0.6 m on moves by alpha = 5/6 and beta = 1/2 of
    that.
    """
    (*_, tracks) = follow(smoothing(3), [*[[("car", 10, 0)]] * 10, [("car", 10.6, 0)]])
    assert tracks.velocities[0] == pytest.approx([0.5 * 0.6 / DT, 0])
    assert tracks.boxes[0, :2] == pytest.approx([10.5, 0])


@settings(deadline=None)
@given(st.lists(st.none() | st.floats(-1.0, 1.0), min_size=2, max_size=14))
def test_with_two_keyframes_a_track_is_where_it_is_detected(steps):
    """To the last bit: its velocity is the way from the last detection over the time since."""
    memory = TrackMemory(DT, MemoryRules(gate_m=1000.0))
    follow(memory, [[("car", 10, 2.0)]])
    place, velocity, missed = 2.0, 0.0, 0
    for step in steps:
        follow(memory, [[] if step is None else [("car", 10, 2.0 + step)]])
        place += velocity * DT
        missed += 1
        if step is not None:
            elapsed = missed * DT
            velocity = (2.0 + step - (place - velocity * elapsed)) / elapsed
            place, missed = 2.0 + step, 0
        (row,) = memory._table
        assert row[Tracks.CENTRE].tolist() == [10.0, place, 0.9]
        assert row[Tracks.VELOCITY].tolist() == [0.0, velocity]


NEAR = st.floats(-4.0, 4.0)
SEEN = st.lists(st.tuples(st.sampled_from(["car", "pedestrian"]), NEAR, NEAR), max_size=6)


@settings(deadline=None)
@given(st.lists(SEEN, min_size=2, max_size=4))
def test_whoever_can_be_only_one_is_matched_as_the_assignment_matches(frames):
    """So the shortcut around the assignment changes nothing, crowded or not."""

    def told():
        return [
            (tracks.rows().tolist())
            for tracks in follow(TrackMemory(DT), frames, Frame(1.0, -2.0, 1.84, 0.3))
        ]

    plain = told()
    pairs = tracker.possible_pairs
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tracker, "possible_pairs", lambda *given: (*pairs(*given)[:3], False))
        assert told() == plain

"""Limits of an observation: rows beyond its tables, and numbers that no sensor tells."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.belief import MAX_DETECTIONS, MAX_TRACKS, Belief
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.residual import explained
from care_sim.core.rig import Rig
from care_sim.core.types import Ego, ImageDetections, Tracks
from care_sim.envs.sensing import observation_space
from care_sim.loops.observation_limits import MAX_AGE_S, MAX_SPEED_MPS, Limits
from care_sim.sensors.surround import SURROUND_CAMERAS

RIG = Rig(cameras=SURROUND_CAMERAS, keyframe_s=0.5)
TWO_SIZES = Rig(cameras=(PinholeCamera(320, 180), PinholeCamera(1600, 900)))
LIMITS = Limits(RIG)
SPACE = observation_space(RIG)
STANDING = Ego()
NOWHERE = np.zeros(RIG.grid.shape, np.float32)


def tracks_of(*rows):
    return Tracks.from_rows(np.array(rows, dtype=float).reshape(-1, len(Tracks.COLUMNS)))


def detections_of(*rows):
    return ImageDetections.from_rows(
        np.array(rows, dtype=float).reshape(-1, len(ImageDetections.COLUMNS))
    )


def track(**values):
    row = (
        dict.fromkeys(Tracks.COLUMNS, 0.0)
        | {"x": 10.0, "length": 1.0, "width": 1.0, "height": 1.0}
        | values
    )
    return [row[name] for name in Tracks.COLUMNS]


def detection(**values):
    plain = {"confidence": 0.5, "left": 10, "top": 20, "right": 30, "bottom": 40}
    row = dict.fromkeys(ImageDetections.COLUMNS, 0.0) | plain | values
    return [row[name] for name in ImageDetections.COLUMNS]


def told(tracks=(), detections=(), ego=STANDING, limits=LIMITS):
    return limits.belief(ego, detections_of(*detections), tracks_of(*tracks), NOWHERE)


def read(belief):
    return Belief.from_observation(belief.to_observation())


def random_tables(seed):
    """Up to 700 tracks, nearest first, of few classes, and up to 200 boxes, many where few tracks
    are.
    """
    rng = np.random.default_rng(seed)
    count, boxes = int(rng.integers(0, 700)), int(rng.integers(0, 200))
    places = rng.uniform(-60, 60, (count, 3)) * (1, 1, 0.03)
    places = places[np.argsort(np.hypot(places[:, 0], places[:, 1]), kind="stable")]
    kinds = int(rng.integers(1, 5))
    tracks = [
        track(**{"id": n, "class": rng.integers(kinds), "x": x, "y": y, "z": z})
        for n, (x, y, z) in enumerate(places)
    ]
    half = rng.uniform(0.2, 12)
    middles = rng.uniform((0, 0), (320, 180), (boxes, 2))
    around = np.clip(np.hstack([middles - half, middles + half]), 0, (320, 180, 320, 180))
    columns = ("left", "top", "right", "bottom")
    detections = [
        detection(
            **dict(zip(columns, box, strict=True))
            | {"class": rng.integers(kinds), "camera": rng.integers(6)}
        )
        for box in around
    ]
    return tracks, detections


@given(st.integers(0, 2**32 - 1))
def test_the_rows_left_out_never_change_what_is_explained(seed):
    tracks, detections = random_tables(seed)
    belief = told(tracks, detections)
    shown = read(belief)
    every = tracks_of(*tracks)
    assert (
        explained(shown.detections, shown.tracks, RIG).tolist()
        == explained(
            shown.detections, Tracks.from_rows(every.rows().astype(np.float32)), RIG
        ).tolist()
    )
    assert len(shown.tracks) == min(len(tracks), MAX_TRACKS)
    assert len(shown.detections) == min(len(detections), MAX_DETECTIONS)
    assert (np.diff(belief.tracks.ids) > 0).all(), "nearest first"
    assert shown.tracks.rows().tolist() == belief.tracks.rows().astype(np.float32).tolist(), (
        "and back without loss"
    )
    if len(tracks) <= MAX_TRACKS:
        assert shown.tracks.ids.tolist() == list(range(len(tracks)))


def test_of_the_forecasts_that_explain_nothing_the_furthest_are_left_out():
    aside = [track(id=n, x=0.0, y=1 + n / 10) for n in range(MAX_TRACKS + 44)]
    (u, v), _ = SURROUND_CAMERAS[0].project(np.array([48.0, 0.0, 0.0]))
    last = track(id=999, x=48.0)
    box = detection(left=u - 1, right=u + 1, top=v - 1, bottom=v + 1)
    kept = told([*aside, last], [box]).tracks.ids.tolist()
    assert kept == [*range(MAX_TRACKS - 1), 999]
    assert told([*aside, last]).tracks.ids.tolist() == list(range(MAX_TRACKS))


LARGE = st.floats(-1e12, 1e12)
"""Numbers as they come."""
POSITIVE = st.floats(0, 1e12)
COUNTS = st.integers(0, 2**40)
TRACK = st.tuples(
    COUNTS, st.integers(0, 4), *[LARGE] * 3, *[POSITIVE] * 3, *[LARGE] * 3, COUNTS, COUNTS
)
DETECTION = st.tuples(
    st.integers(0, 4), st.floats(0, 1), *[LARGE] * 4, st.integers(0, 5), POSITIVE, LARGE
)


@given(
    st.builds(Ego, LARGE, LARGE, LARGE),
    st.lists(TRACK, max_size=5),
    st.lists(DETECTION, max_size=5),
)
def test_whatever_is_read_lies_in_the_observation_space(ego, tracks, detections):
    belief = told(tracks, detections, ego)
    assert SPACE.contains(belief.to_observation())
    again = LIMITS.belief(belief.ego, belief.detections, belief.tracks, NOWHERE)
    assert again.tracks.rows().tolist() == belief.tracks.rows().tolist(), (
        "what lies within is left as it is"
    )
    assert again.detections.rows().tolist() == belief.detections.rows().tolist()
    assert again.ego == belief.ego


def test_what_lies_within_is_handed_on_untouched():
    tracks, seen = (
        tracks_of(track(), track(x=-100.0, vy=100.0)),
        detections_of(detection(right=320, bottom=180)),
    )
    belief = LIMITS.belief(Ego(-3.0, 0.2, -9.0), seen, tracks, NOWHERE)
    assert belief.tracks is tracks
    assert belief.detections is seen
    assert belief.ego == Ego(-3.0, 0.2, -9.0)


def test_a_far_or_fast_track_keeps_its_bearing_and_its_heading():
    (far,) = told(
        [track(x=300.0, y=-400.0, z=-20.0, vx=90.0, vy=-240.0, yaw=101 * np.pi + 0.5)]
    ).tracks.rows()
    row = dict(zip(Tracks.COLUMNS, far.tolist(), strict=True))
    assert (row["x"], row["y"], row["z"]) == pytest.approx((75.0, -100.0, -5.0))
    assert (row["vx"], row["vy"]) == pytest.approx((37.5, -MAX_SPEED_MPS))
    assert (np.cos(row["yaw"]), np.sin(row["yaw"])) == pytest.approx((-np.cos(0.5), -np.sin(0.5)))


def test_a_box_is_cut_at_the_edges_of_its_own_picture_and_one_outside_is_left_out():
    boxes = [
        detection(left=-5, top=-7, right=400, bottom=200),
        detection(left=-5, top=-7, right=400, bottom=200, camera=1),
        detection(left=-9, right=-1),
        detection(left=321, right=330),
        detection(top=181, bottom=190),
        detection(age=MAX_AGE_S + 1, yaw_change=40 * np.pi + 0.25),
    ]
    seen = told(detections=boxes, limits=Limits(TWO_SIZES)).detections
    assert seen.boxes.tolist() == [[0, 0, 320, 180], [0, 0, 400, 200], [10, 20, 30, 40]]
    assert (seen.ages[2], seen.yaw_changes[2]) == pytest.approx((MAX_AGE_S, 0.25))
    assert Limits(TWO_SIZES).kept_detections(detections_of(*boxes)).tolist() == [0, 1, 5]


def test_a_car_may_go_backwards():
    assert told(ego=Ego(-4e-5)).ego.speed == -4e-5
    assert told(ego=Ego(-1e19, 1e19, 1e19)).ego == Ego(-100.0, 4 * np.pi, 100.0)

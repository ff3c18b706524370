import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.streets.draft import TIMES, Draft, PlacedBodies, footprints_meet

SQUARE = np.array([[2.0, 2.0]])


def meet(x, y, heading, gap=0.0):
    here, there = np.zeros((1, 3)), np.array([[x, y, heading]])
    return bool(footprints_meet(here, SQUARE, there, SQUARE, np.array([gap]))[0])


@pytest.mark.parametrize(
    ("place", "gap", "meets"),
    [
        ((1.99, 0.0, 0.0), 0.0, True),
        ((2.01, 0.0, 0.0), 0.0, False),
        ((2.2, 0.0, 0.0), 0.3, True),
        ((2.2, 0.0, np.pi / 4), 0.0, True),
        ((2.45, 0.0, np.pi / 4), 0.0, False),
        ((1.9, 1.9, 0.0), 0.0, True),
        ((1.9, 1.9, np.pi / 4), 0.0, False),
    ],
)
def test_rectangles_meet_where_geometry_says(place, gap, meets):
    assert meet(*place, gap=gap) == meets


@pytest.fixture
def draft():
    return Draft(np.random.default_rng(0))


def straight_way(start, speed, y=0.0, heading=0.0):
    x = start + speed * TIMES
    return np.column_stack([x, np.full_like(x, y), np.full_like(x, heading)])


def test_two_cars_do_not_stand_in_each_other(draft):
    assert draft.stand("car", np.zeros(3))
    assert not draft.stand("car", np.array([4.0, 0.0, 0.0]))
    assert draft.stand("car", np.array([4.7, 0.0, 0.0]))
    assert draft.kinds == ["car", "car"]
    assert all(way.shape == (len(TIMES), 3) for way in draft.ways)


def test_reserved_ground_stops_what_stands_but_not_who_walks(draft):
    draft.reserve(np.zeros(3), (20.0, 4.0))
    assert not draft.stand("pedestrian", np.array([5.0, 0.0, 0.0]))
    assert draft.move("pedestrian", straight_way(-10.0, 1.4), 0.1)


def test_nobody_walks_through_a_parked_car_or_into_a_driving_one(draft):
    draft.stand("car", np.array([0.0, 5.0, 0.0]))
    draft.drive("car", straight_way(-50.0, 8.0), 0.5)
    assert not draft.move("pedestrian", straight_way(-10.0, 1.4, y=5.0), 0.1)
    crossing = np.column_stack(
        [np.zeros_like(TIMES), 1.4 * TIMES - 9.0, np.full_like(TIMES, np.pi / 2)]
    )
    hit = crossing + np.array([2.0, 0.0, 0.0])
    assert not draft.move("pedestrian", hit, 0.1)
    later = crossing + np.array([20.0, -8.0, 0.0])
    assert draft.move("pedestrian", later, 0.1)


def test_the_obstructed_way_keeps_walkers_off_and_adds_no_body(draft):
    draft.obstruct(straight_way(0.0, 8.0), (4.0, 1.7), 1.0)
    assert not draft.move("pedestrian", straight_way(2.0, 8.0), 0.1)
    assert draft.kinds == []


POSE = st.tuples(st.floats(-12, 12), st.floats(-12, 12), st.floats(-4, 4))
SIZE = st.tuples(st.floats(0.3, 8), st.floats(0.3, 3))
BERTH = st.floats(0, 1)


@given(
    st.sampled_from([1, 3]),
    st.sampled_from([1, 3]),
    st.lists(st.tuples(st.lists(POSE, min_size=3, max_size=3), SIZE, BERTH), max_size=4),
    st.lists(POSE, min_size=3, max_size=3),
    SIZE,
)
def test_bodies_meet_exactly_where_the_exact_test_says_at_some_time(
    mine, theirs, placed, way, size
):
    bodies = PlacedBodies()
    way = np.array(way)[:mine]
    for other, other_size, berth in placed:
        bodies.add(np.array(other)[:theirs], other_size, berth)

    def at_some_time(other, other_size, berth):
        times = max(mine, theirs)
        poses = np.broadcast_to(way, (times, 3))
        others = np.broadcast_to(np.array(other)[:theirs], (times, 3))
        sizes, other_sizes = (np.broadcast_to(each, (times, 2)) for each in (size, other_size))
        return footprints_meet(poses, sizes, others, other_sizes, np.full(times, berth)).any()

    assert bodies.meets(way, size) == any(at_some_time(*each) for each in placed)


def test_a_berth_counts_from_end_to_end():
    bodies = PlacedBodies()
    bodies.add(np.zeros((1, 3)), (4.0, 0.3), 1.0)
    assert bodies.meets(np.array([[4.9, 0.0, 0.0]]), (4.0, 0.3))
    assert not bodies.meets(np.array([[5.1, 0.0, 0.0]]), (4.0, 0.3))

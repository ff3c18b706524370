"""Cells that aim at the middle of a target, and boxes that the previous picture did not show."""

import math
from dataclasses import replace

import gymnasium
import numpy as np
import pytest

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.cells.sets import CellSets
from care_sim.core.pinhole import PinholeCamera
from care_sim.core.residual import explained, wedges
from care_sim.core.rig import Rig
from care_sim.core.types import Ego
from care_sim.policies.own.box_places import box_places
from care_sim.policies.own.care_aimed import (
    CareAimed,
    aimed,
    have_counterparts,
    standing_still,
)
from tests.helpers.places import EXAMPLES, loaded

AHEAD = PinholeCamera()
"""320 x 180 pixels and 90 degrees: the focal length is 160 pixels, the middle is (160, 90)."""


def rectangle(left, right, top, bottom):
    columns = np.arange(left, right + 1) % 512
    return np.concatenate([np.sort(row * 512 + columns) for row in range(top, bottom + 1)])


@pytest.mark.parametrize("left", [250, 506, 0])
def test_a_set_begins_above_half_its_height_in_its_middle(left):
    """Without margins, rows 9 to 13 of 11 columns: 40% below the top is the edge of rows 10 and
    11. A set over the seam is no other.
    """
    (cells,) = aimed(CellSets.of([rectangle(left, left + 10, 8, 14)]), Rig())
    middle = (left + 5) % 512
    assert {*cells[:2].tolist()} == {10 * 512 + middle, 11 * 512 + middle}
    assert sorted(cells) == sorted(rectangle(left, left + 10, 8, 14))
    last = {row * 512 + (left + side) % 512 for row in (8, 14) for side in (0, 10)}
    assert cells[-1] in last


def test_a_row_further_from_the_aim_comes_after_far_columns_of_a_near_row():
    """Without margins, rows 9 to 13, and 4.5 columns are half a width. Rows 10 and 11 are 0.1
    heights from the aim, rows 9 and 12 are 0.3. At 4.5 half widths a height, their middles come
    where sqrt(1.35**2 - 0.45**2) * 4.5 = 5.7 columns of rows 10 and 11 have come.
    """
    (cells,) = aimed(CellSets.of([rectangle(250, 262, 8, 14)]), Rig())
    near = [row * 512 + column for row in (10, 11) for column in range(251, 262)]
    assert sorted(cells[:22]) == near
    assert sorted(cells[22:24]) == [9 * 512 + 256, 12 * 512 + 256]


def test_each_set_has_its_own_aim():
    sets = [rectangle(100, 104, 8, 12), rectangle(300, 304, 18, 22)]
    together = aimed(CellSets.of(sets), Rig())
    for one, cells in zip(sets, together, strict=True):
        assert np.array_equal(cells, aimed(CellSets.of([one]), Rig())[0])
    assert not len(aimed(CellSets.of([]), Rig()))


def test_a_box_shows_something_where_its_height_fits(seen):
    """A person of 1.76 m at 16 m is 17.6 pixels high, a car of 1.72 m at 32 m 8.6 pixels. Half the
    focal length beside the middle is half the depth beside the axis. A camera that looks left has
    its axis along y. A picture from before a quarter turn to the left shows places further right.
    """
    rig = Rig(cameras=(AHEAD, PinholeCamera(yaw=math.pi / 2)))
    person, car = ("pedestrian", 76, 81.2, 84, 98.8), ("car", 155, 85.7, 165, 94.3)
    assert box_places(seen(person, car), rig) == pytest.approx(np.array([[16, 8, 0], [32, 0, 0]]))
    left = box_places(seen(person, car, camera=1), rig)
    assert left == pytest.approx(np.array([[-8, 16, 0], [0, 32, 0]]))
    turned = box_places(seen(person, car, yaw_change=math.pi / 2), rig)
    assert turned == pytest.approx(np.array([[8, -16, 0], [0, -32, 0]]))
    # From a camera 2 m before the LiDAR, the same box shows something 2 m further.
    before = Rig(cameras=(PinholeCamera(position=(2.0, 0.0, 0.0)),))
    assert box_places(seen(person), before) == pytest.approx(np.array([[18, 8, 0]]))


def test_what_stands_still_comes_nearer_and_turns_away():
    """Half a second at 10 m/s is 5 m; a quarter turn to the left puts what lies ahead right."""
    places = np.array([[20.0, 0.0], [5.0, 3.0]])
    moved = standing_still(places, Ego(10.0, 0.0), 0.5)
    assert moved.tolist() == [[15.0, 0.0], [0.0, 3.0]]
    turned = standing_still(places[:1], Ego(0.0, math.pi), 0.5)
    assert np.allclose(turned, [[0.0, -20.0]])


def found(now, before, on_foot=True, earlier_on_foot=True):
    places = [np.array(each, float).reshape(-1, 2) for each in (now, before)]
    flags = [np.full(len(places[0]), on_foot), np.full(len(places[1]), earlier_on_foot)]
    return have_counterparts((places[0], flags[0]), (places[1], flags[1])).tolist()


def test_counterparts_are_one_to_one_the_nearest_first():
    assert found([[8, 0], [8, 1]], [[8, 1.2]]) == [False, True]
    assert found([[8, 0], [8, 1]], [[8, 1.2], [8, -1]]) == [True, True]


@pytest.mark.parametrize(
    ("now", "before", "is_found"),
    [([8, 0], [8, 2.9], True), ([8, 0], [8, 3.1], False), ([40, 0], [40, 11], True)],
)
def test_a_counterpart_is_within_3_m_or_a_third_of_the_range(now, before, is_found):
    assert found([now], [before]) == [is_found]


def test_nobody_on_foot_is_the_counterpart_of_a_vehicle():
    assert found([[8, 0]], [[8, 0]], on_foot=False) == [False]
    assert found([[8, 0]], [[8, 0]], on_foot=False, earlier_on_foot=False) == [True]
    assert found([], [[8, 0]]) == []
    assert found([[8, 0]], []) == [False]


@pytest.fixture
def person_at(belief_of, seen):
    """Makes a belief whose picture shows a person straight ahead, 0.6 m wide, at a distance."""

    def make(metres, speed=0.0, yaw_rate=0.0, tracks=()):
        high, wide = 160 * 1.76 / metres, 160 * 0.6 / metres
        box = 160 - wide / 2, 90 - high / 2, 160 + wide / 2, 90 + high / 2
        belief = belief_of(tracks, Ego(speed, yaw_rate))
        return replace(belief, detections=seen(("pedestrian", *box)))

    return make


def layers_after(policy, *beliefs):
    """The layers at the last of several keyframes."""
    for belief in beliefs:
        policy.remember(belief)
    return policy.demand(beliefs[-1]).layers


def has_new(policy, *beliefs):
    """Whether the box of the last of several keyframes is new; otherwise it is older."""
    fresh, _, _, older, *_ = layers_after(policy, *beliefs)
    assert len(fresh) + len(older) == 1
    return len(fresh) == 1


@pytest.mark.parametrize(
    ("then", "now", "speed", "yaw_rate", "is_new"),
    [
        # At 30 m/s for half a second, what stands still is 15 m nearer.
        (20, 20, 0, 0, False),
        (20, 5, 30, 0, False),
        (20, 20, 30, 0, True),
        (20, 5, 0, 0, True),
        # A quarter turn leaves what was ahead at the right.
        (20, 20, 0, math.pi, True),
    ],
)
def test_a_box_is_new_where_the_car_has_not_come_nearer_to_an_old_one(
    person_at, then, now, speed, yaw_rate, is_new
):
    policy = CareAimed(Rig(cameras=(AHEAD,), keyframe_s=0.5))
    earlier, belief = person_at(then, speed, yaw_rate), person_at(now, speed, yaw_rate)
    assert has_new(policy, earlier)
    assert has_new(policy, belief) == is_new
    # The picture before the last one no longer counts.
    assert has_new(policy, person_at(45), belief)


def test_an_episode_begins_without_the_picture_of_the_one_before(person_at):
    policy, belief = CareAimed(Rig(cameras=(AHEAD,))), person_at(10)
    assert not has_new(policy, belief, belief)
    policy.reset()
    assert has_new(policy, belief)


def test_a_new_box_has_24_cells_first_and_24_later_and_an_old_box_3(person_at):
    """At 4 m the box is about 25 degrees high and 9 wide: 20 rows and 16 columns with margins."""
    policy, belief = CareAimed(Rig(cameras=(AHEAD,))), person_at(4)
    (fresh,), _, _, older, (rest,), *_ = layers_after(policy, belief)
    assert (len(fresh), len(rest), len(older)) == (24, 24, 0)
    assert len({*fresh.tolist(), *rest.tolist()}) == 48
    fresh, _, _, (older,), rest, *_ = layers_after(policy, belief)
    assert (len(fresh), len(older), len(rest)) == (0, 3, 0)


def test_a_tracked_person_has_a_hull_and_no_box(person_at, tracks_at):
    tracks = tracks_at(("pedestrian", 10.0, 0.0, 0.0, 0.0), z=0.0, size=(0.7, 0.7, 1.76))
    layers = layers_after(CareAimed(Rig(cameras=(AHEAD,))), person_at(10, tracks=tracks.rows()))
    assert [len(layer) for layer in layers[:5]] == [0, 1, 1, 0, 0]


def test_front_hulls_and_rows_without_a_camera(belief_of, car):
    """Row 9 lies at -1.33 degrees, row 10 at -2.67; 0.70 degrees a column."""
    fresh, (front,), (hull,), older, rest, (more,), (second,), (row,), (rows,) = (
        CareAimed(Rig()).demand(belief_of([car(1, 12, 0)])).layers
    )
    assert [len(fresh), len(older), len(rest)] == [0, 0, 0]
    assert sorted(front) == [*range(9 * 512 + 171, 9 * 512 + 341)]
    assert {*front[:2].tolist()} == {9 * 512 + 255, 9 * 512 + 256}
    assert sorted(second) == [*range(10 * 512 + 171, 10 * 512 + 341)]
    assert [len(hull), len(more)] == [3, 8]
    assert not {*hull.tolist()} & {*more.tolist()}
    assert len(row) == 512
    assert len(rows) == 819


def test_what_is_switched_off_is_not_there(environment, encounter, belief_of, car):
    policy = CareAimed(Rig(), front=False, aim=False)
    belief = belief_of([car(1, 12, 0)])
    _, front, (hull,), _, _, _, second, *_ = policy.demand(belief).layers
    assert [len(front), len(second)] == [0, 0]
    listed = policy.rig.listed(policy.rig.hulls(belief.tracks.boxes), "core-spread", 3)
    assert hull.tolist() == listed[0].tolist()
    policy = care_sim.make_policy("care-aimed", environment, new=False)
    for observation in encounter:
        policy(observation)
        assert not len(policy.demanded.layers[3])


def test_sets_follow_the_cell_order_of_the_rig(belief_of, car):
    belief = belief_of([car(1, 12, -9)])
    with gymnasium.make("CARE-Dense-v0", cell_order="rows-down") as env:
        policy = care_sim.make_policy("care-aimed", env)
        (hull,) = policy.demand(belief).layers[2]
        (whole,) = policy.rig.hulls(belief.tracks.boxes)
    assert hull.tolist() == sorted(whole)[:3]


@pytest.mark.parametrize("wrong", [{"hull_cells": 0}, {"aim": 1}, {"new": 1}, {"front": 1}])
def test_wrong_settings_are_refused(wrong):
    with pytest.raises(InvalidInput, match=next(iter(wrong))):
        CareAimed(Rig(), **wrong)


def test_the_example_serves_all_boxes_alike(environment, encounter):
    policy = loaded(EXAMPLES / "aimed_boxes.py").AimedBoxes(environment.unwrapped.rig)
    known = 0
    for observation in encounter:
        belief = policy.rig.read(observation)
        layers = policy.demand(belief).layers
        every = aimed(wedges(belief.detections, policy.rig), policy.rig)
        assert [cells.tolist() for cells in layers[2]] == [cells[:6].tolist() for cells in every]
        known += explained(belief.detections, belief.tracks, policy.rig).sum()
    assert known > 0
    own = care_sim.make_policy("care-aimed", environment).demand(belief).layers
    assert np.array_equal(layers[0][0], own[1][0])
    assert np.array_equal(layers[3][0], own[6][0])

"""Encounters of an ego in the Euro NCAP tests, and when they are over."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.scenarios import make_scenario
from care_sim.scenarios.ncap.meetings import bend_route
from care_sim.scenarios.ncap.table import TESTS, Across, Bend
from care_sim.world.bodies import CATALOGUE
from care_sim.world.world import WORLD_STEP_S
from tests.helpers.ncap_worlds import LEFT_HAND, RIGHT_HAND, built, ends_of

EGO_LENGTH, EGO_WIDTH, _ = CATALOGUE["ego"].size
every_test = pytest.mark.parametrize("name", TESTS)


def driven(world, acceleration=0.0, seconds=20.0):
    """Let the ego drive; gives time and speed of its first contact, and when it was over."""
    over = None
    for _ in range(round(seconds / WORLD_STEP_S)):
        passage = world.advance(acceleration, WORLD_STEP_S)
        over = world.time if over is None and world.is_over() else over
        if passage.impact_speed_mps is not None:
            return (world.time, passage.impact_speed_mps), over
        if over is not None and world.time > over + 2.0:
            break
    return None, over


@every_test
def test_an_ego_that_does_not_brake_hits_when_the_protocol_wants_it(name):
    for speeds in ends_of(name):
        world = built(name, speeds)
        (time, speed), over = driven(world)
        world.close()
        assert speed == pytest.approx(speeds.ego_kph / 3.6)
        assert over is None
        if name == "CCRb":
            continue
        # A car that turns comes to the other's flank at an angle: its corner is a little later.
        late = 0.2 if name == "CCFtap" else WORLD_STEP_S
        assert TESTS[name].start_s - 1e-9 <= time <= TESTS[name].start_s + late + 1e-9


def test_the_gap_to_the_braking_car_is_used_up_when_reckoned():
    """Until both are at rest a car at v behind one that brakes by 4 m/s^2 closes 2 t^2 metres."""
    for speeds in ends_of("CCRb"):
        world = built("CCRb", speeds)
        (time, _), _ = driven(world)
        world.close()
        gap = speeds.ego_kph / 3.6 * 1.0
        braking = (speeds.ego_kph - 2.0) / 3.6 / 4.0
        closed = 2.0 * braking**2
        after = (gap - closed) / ((speeds.ego_kph - 2.0) / 3.6)
        expected = 3.0 + (np.sqrt(gap / 2.0) if gap <= closed else braking + after)
        assert expected <= time <= expected + WORLD_STEP_S + 1e-9


@pytest.mark.parametrize("name", [name for name in TESTS if isinstance(TESTS[name].way, Across)])
def test_the_point_of_the_target_meets_its_share_of_the_egos_width(name):
    test = TESTS[name]
    speeds = ends_of(name)[0]
    world = built(name, speeds)
    x, y, heading = world.first_sighting.pose_at(test.start_s)
    world.close()
    # From the side that it comes from: 0 is that side of the ego, 1 the other.
    along = np.sin(heading)
    point = y - along * test.target.point_m
    assert 0.5 + along * point / EGO_WIDTH == pytest.approx(test.way.overlap)
    front = EGO_LENGTH / 2 + speeds.ego_kph / 3.6 * test.start_s
    assert x - front == pytest.approx(CATALOGUE[test.target.body].size[1] / 2)


@every_test
def test_the_target_gains_its_speed_and_keeps_it(name):
    for speeds in ends_of(name):
        world = built(name, speeds)
        end = TESTS[name].start_s
        places = np.array(
            [world.first_sighting.pose_at(t)[:2] for t in (end - 0.1, end, end + 0.1)]
        )
        world.close()
        if name != "CCRb":
            paces = np.hypot(*np.diff(places, axis=0).T) / 0.1
            assert paces == pytest.approx(speeds.target_kph / 3.6)


@pytest.mark.parametrize("name", [name for name in TESTS if name.startswith("CPTA")])
def test_the_pedestrian_starts_beside_the_lane_that_the_ego_turns_into(name):
    way = TESTS[name].way
    for speeds in ends_of(name):
        world = built(name, speeds, seed=RIGHT_HAND)
        exit_x, _, exit_heading = world.route.pose(world.route.length)
        x, y, heading = world.first_sighting.pose_at(-10.0)
        world.close()
        assert exit_heading == pytest.approx(-np.pi / 2 if way.right else np.pi / 2, abs=1e-3)
        assert np.cos(heading) == pytest.approx(1.0 if way.along else -1.0)
        hip = x - np.cos(heading) * TESTS[name].target.point_m
        assert (exit_x - hip) * np.cos(heading) == pytest.approx(way.distance_m)
        # The road that the ego comes from has its middle half a lane to the left.
        assert y == pytest.approx(1.75 - 9.5 if way.right else 1.75 + 9.5)


@every_test
def test_half_of_the_seeds_are_mirrored_and_nothing_else_is(name):
    speeds = ends_of(name)[0]
    poses = []
    for seed in (RIGHT_HAND, LEFT_HAND):
        sizes = {
            f"{which}_{side}_m": (length, length)
            for which in ("small", "large")
            for side, length in (("length", 4.3), ("width", 1.8))
        }
        world = built(name, speeds, seed=seed, **sizes)
        now = [actor.pose_at(1.0) for actor in world.actors]
        world.advance(0.0, 6.0 if TESTS[name].start_s > 6 else 1.0)
        poses.append(np.array([*now, world.ego.pose]))
        world.close()
    one, other = poses
    assert other[:, 0] == pytest.approx(one[:, 0], abs=1e-9)
    assert other[:, 1] == pytest.approx(-one[:, 1], abs=1e-9)
    assert np.angle(np.exp(1j * (other[:, 2] + one[:, 2]))) == pytest.approx(0.0, abs=1e-9)


@every_test
def test_a_test_is_over_when_the_ego_has_braked_in_time(name):
    for speeds in ends_of(name):
        world = built(name, speeds)
        hit, over = driven(world, acceleration=-8.0)
        world.close()
        # Near enough ahead, not even 8 m/s^2 are enough; but these brake from the beginning.
        assert hit is None
        assert over is not None


def test_a_test_is_over_when_the_pedestrian_has_left_the_way():
    """The ego slows to a walk's pace and rolls on."""
    world = built("CPNA-75", ends_of("CPNA-75")[1])
    world.advance(-5.0, 2.5)
    assert not world.is_over()
    while not world.is_over():
        world.advance(0.0, WORLD_STEP_S)
    tail = abs(world.first_sighting.pose_at(world.time)[1]) - CATALOGUE["adult"].size[0] / 2
    speed = world.ego.speed
    world.close()
    assert speed > 0
    assert tail == pytest.approx(EGO_WIDTH / 2 + 0.2, abs=5.0 / 3.6 * WORLD_STEP_S)


@given(st.floats(5.0, 30.0), st.floats(5.0, 40.0), st.booleans())
def test_a_bend_turns_by_what_it_says(radius, clothoid, right):
    route = bend_route(Bend(radius, clothoid, 90.0 - 2 * clothoid), right, 10.0)
    assert route.pose(10.0)[1:] == pytest.approx((0.0, 0.0))
    assert route.pose(route.length)[2] == pytest.approx(-np.pi / 2 if right else np.pi / 2)
    x, y, _ = route.pose(route.length)
    # The way in and the way out are one another's mirror image.
    assert x - 10.0 == pytest.approx(abs(y), rel=1e-6)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ({"test": "CPNC"}, "test of ncap 'CPNC'"),
        ({"test": "CCFtap", "speed_kph": 30.0}, "speed_kph of CCFtap must be one of 10, 15, 20"),
        ({"mirrored": "half"}, "unknown mirrored of ncap 'half'; known: always, drawn, never"),
        ({"test": "drawn"}, "speed_kph of ncap must be 0 where the test is drawn"),
        ({"speed_kph": 0, "target_kph": 20}, "target_kph of ncap must be 0 where speed_kph is"),
        ({"speed_kph": 0.5}, "speed_kph of ncap must be 0 or at least 1, got 0.5"),
    ],
)
def test_what_the_protocol_does_not_have_is_refused(arguments, told):
    with pytest.raises(InvalidInput, match=told) as refusal:
        make_scenario("ncap", **arguments)
    assert "\n" not in str(refusal.value)


def test_a_drawn_test_is_the_world_of_that_test():
    """Draws of the test do not move what the seed draws in it."""
    for seed in range(12):
        scenario = make_scenario("ncap", test="drawn", speed_kph=0)
        given = scenario.drawn(np.random.default_rng(seed))
        drawn, known = (each.build(np.random.default_rng(seed)) for each in (scenario, given))
        kinds, speeds, boxes = zip(
            *(
                ([one.kind for one in world.actors], world.ego.speed, world.boxes(world.actors))
                for world in (drawn, known)
            ),
            strict=True,
        )
        drawn.close()
        known.close()
        assert kinds[0] == kinds[1]
        assert speeds[0] == speeds[1]
        np.testing.assert_array_equal(*boxes)


def test_every_test_and_each_of_its_speeds_is_drawn_as_often():
    scenario = make_scenario("ncap", test="drawn", speed_kph=0)
    drawn = [scenario.drawn(np.random.default_rng(seed)) for seed in range(4000)]
    counts = Counter(each.test for each in drawn)
    # Each of 21 tests gets 190 of 4,000 draws; four standard deviations are 54.
    assert set(counts) == set(TESTS)
    assert max(abs(count - 4000 / 21) for count in counts.values()) < 54
    for name, test in TESTS.items():
        pairs = {(each.speed_kph, each.target_kph) for each in drawn if each.test == name}
        assert pairs == {(each.ego_kph, each.target_kph) for each in test.variations}


def test_the_child_is_hidden_by_two_cars_of_the_protocols_sizes():
    world = built("CPNCO-50", ends_of("CPNCO-50")[1], seed=RIGHT_HAND)
    small, large, child = world.actors
    x, y, _ = child.pose_at(-10.0)
    world_x = EGO_LENGTH / 2 + 4.0 * 60 / 3.6 + CATALOGUE["child"].size[1] / 2
    (sx, sy, _), (lx, ly, _) = small.pose_at(0.0), large.pose_at(0.0)
    world.close()
    assert (x, y) == pytest.approx((world_x, -4.0))
    assert sx + small.kind.size[0] / 2 == pytest.approx(x - 0.298 / 2 - 1.0)
    assert lx + large.kind.size[0] / 2 == pytest.approx(sx - small.kind.size[0] / 2 - 1.0)
    assert ly + large.kind.size[1] / 2 == pytest.approx(-EGO_WIDTH / 2 - 1.0)
    assert sy == pytest.approx(ly)
    assert 4.1 <= small.kind.size[0] <= 4.4
    assert 4.3 <= large.kind.size[0] <= 4.7
    assert small.label == large.label == 0


@pytest.mark.parametrize("name", ["CBNA-50", "CBNAO-50", "CBFA-50"])
def test_two_cars_stand_in_line_beside_the_bicyclists_way(name):
    world = built(name, ends_of(name)[0], seed=RIGHT_HAND)
    large, small, bicyclist = world.actors
    line, rides_from, _ = bicyclist.pose_at(-10.0)
    far = 1.0 if name == "CBFA-50" else -1.0
    assert np.sign(rides_from) == far
    end = TESTS[name].obstruction.end_m
    for car in (large, small):
        x, y, _ = car.pose_at(0.0)
        length, width, _ = car.kind.size
        assert x + width / 2 == pytest.approx(line - 0.5 / 2 - TESTS[name].obstruction.before_m)
        assert far * y - length / 2 == pytest.approx(end)
        end += length + 0.2
    world.close()


@pytest.mark.parametrize(("name", "side"), [("CCCscp-far", 1.0), ("CCCscp-near", -1.0)])
def test_three_cars_wait_beside_the_ego_on_the_side_of_the_crossing_car(name, side):
    world = built(name, ends_of(name)[0], seed=RIGHT_HAND)
    *cars, crossing = world.actors
    line, comes_from, _ = crossing.pose_at(0.0)
    assert np.sign(comes_from) == side
    front = line - TESTS[name].obstruction.before_m
    for car in cars:
        x, y, _ = car.pose_at(0.0)
        length, width, _ = car.kind.size
        assert x + length / 2 == pytest.approx(front)
        assert side * y - width / 2 == pytest.approx(TESTS[name].obstruction.beside_m)
        front -= length + 1.0
    world.close()

"""What an ego meets in the Euro NCAP tests, and when they are over."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.base.errors import InvalidInput
from care_sim.scenarios import make_scenario
from care_sim.scenarios.ncap.meetings import bend_route
from care_sim.scenarios.ncap.table import TESTS, Across, Ahead, Bend
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


@pytest.mark.parametrize("name", [name for name in TESTS if isinstance(TESTS[name].way, Ahead)])
def test_the_middle_of_the_target_ahead_is_at_its_share_of_the_egos_width(name):
    for seed, right in ((RIGHT_HAND, 1.0), (LEFT_HAND, -1.0)):
        world = built(name, ends_of(name)[0], seed=seed)
        y = world.first_sighting.pose_at(0.0)[1]
        world.close()
        assert 0.5 + right * y / EGO_WIDTH == pytest.approx(TESTS[name].way.overlap)


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


def test_a_pedestrian_is_at_full_speed_after_the_run_up():
    world = built("CPFA-50", ends_of("CPFA-50")[0])
    times = np.arange(-3.0, 4.0, 0.001)
    ways = np.array([world.first_sighting.pose_at(t)[1] for t in times])
    world.close()
    gone = np.abs(ways - ways[0])
    paces = np.gradient(gone, 0.001)
    assert abs(ways[0]) == pytest.approx(6.0)
    assert paces[gone < 1.4].max() < 8.0 / 3.6 - 0.01
    assert paces[gone > 1.6] == pytest.approx(8.0 / 3.6, abs=1e-6)


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


@pytest.mark.parametrize(
    ("seed", "side"), [(RIGHT_HAND, "never"), (LEFT_HAND, "always")], ids=["right", "left"]
)
def test_the_side_can_be_asked_for_and_a_drawn_one_is_told(seed, side):
    """A world of the side that a seed draws is the world of that seed, its cars included."""
    drawn, given, other = (
        make_scenario("ncap", mirrored=mirrored).build(np.random.default_rng(seed))
        for mirrored in ("drawn", side, {"never": "always", "always": "never"}[side])
    )
    seen = [world.boxes(world.actors) for world in (drawn, given, other)]
    assert drawn.drawn == {"mirrored": side}
    assert given.drawn == {}
    for world in (drawn, given, other):
        world.close()
    np.testing.assert_array_equal(seen[0], seen[1])
    np.testing.assert_allclose(seen[2][:, 1], -seen[0][:, 1], atol=1e-9)


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
        ({"test": "CPTAfs-50"}, "speed_kph of CPTAfs-50 must be one of 10, 15, 20"),
        ({"test": "CCFtap", "speed_kph": 30.0}, "speed_kph of CCFtap must be one of 10, 15, 20"),
        ({"speed_kph": 150.0}, r"speed_kph of ncap must lie in \[0, 140\]"),
        ({"mirrored": "half"}, "unknown mirrored of ncap 'half'; known: always, drawn, never"),
        ({"test": "drawn"}, "speed_kph of ncap must be 0 where the test is drawn"),
        ({"speed_kph": 0, "target_kph": 20}, "target_kph of ncap must be 0 where speed_kph is"),
        ({"speed_kph": 0.5}, "speed_kph of ncap must be 0 or at least 1, got 0.5"),
        ({"target_kph": 0.5}, "target_kph of ncap must be 0 or at least 1, got 0.5"),
        ({"test": 5}, "test of ncap must be a name"),
    ],
)
def test_what_the_protocol_does_not_have_is_refused(arguments, told):
    with pytest.raises(InvalidInput, match=told) as refusal:
        make_scenario("ncap", **arguments)
    assert "\n" not in str(refusal.value)


def test_the_target_has_the_speed_that_is_asked_for():
    world = make_scenario("ncap", test="CCCscp-near", speed_kph=40.0, target_kph=50.0).build(
        np.random.default_rng(0)
    )
    (_, before, _), (_, after, _) = (world.first_sighting.pose_at(t) for t in (0.0, 1.0))
    world.close()
    assert abs(after - before) == pytest.approx(50 / 3.6)


def test_the_seeds_draw_what_the_protocol_leaves_open():
    scenario = make_scenario("ncap", test="CPNCO-50", speed_kph=40.0)
    speeds, sides, lengths, ways = [], [], [], []
    for seed in range(40):
        world = scenario.build(np.random.default_rng(seed))
        small, large, child = world.actors
        speeds.append(3.6 * world.ego.speed)
        sides.append(np.sign(child.pose_at(0.0)[1]))
        lengths.append((small.kind.size[0], large.kind.size[0]))
        ways.append((child.pose_at(0.0)[0] - EGO_LENGTH / 2 - 0.149) / world.ego.speed)
        world.close()
    assert 40.0 <= min(speeds) < 40.2 < 40.8 < max(speeds) <= 41.0
    assert 4.0 <= min(ways) < 4.02 < 4.08 < max(ways) <= 4.1
    assert 10 <= sides.count(1.0) <= 30
    assert np.all((np.min(lengths, axis=0) >= (4.1, 4.3)) & (np.max(lengths, axis=0) <= (4.4, 4.7)))


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


def test_one_seed_draws_one_test_however_often_it_is_asked():
    """A seed sequence counts what it spawns, also for the generators that are made of it."""
    scenario = make_scenario("ncap", test="drawn", speed_kph=0)
    seed = np.random.SeedSequence(5)
    drawn = {scenario.drawn(np.random.default_rng(seed)) for _ in range(4)}
    assert len(drawn) == 1


def test_every_test_and_each_of_its_speeds_is_drawn_as_often():
    scenario = make_scenario("ncap", test="drawn", speed_kph=0)
    drawn = [scenario.drawn(np.random.default_rng(seed)) for seed in range(4000)]
    counts = Counter(each.test for each in drawn)
    # Of 4,000 draws from 21 tests, 190 each; four standard deviations are 54.
    assert set(counts) == set(TESTS)
    assert max(abs(count - 4000 / 21) for count in counts.values()) < 54
    for name, test in TESTS.items():
        pairs = {(each.speed_kph, each.target_kph) for each in drawn if each.test == name}
        assert pairs == {(each.ego_kph, each.target_kph) for each in test.variations}


def test_a_given_test_keeps_its_name_where_its_speeds_are_drawn():
    scenario = make_scenario("ncap", test="CCFtap", speed_kph=0)
    drawn = [scenario.drawn(np.random.default_rng(seed)) for seed in range(60)]
    assert {each.test for each in drawn} == {"CCFtap"}
    assert {each.speed_kph for each in drawn} == {10.0, 15.0, 20.0}

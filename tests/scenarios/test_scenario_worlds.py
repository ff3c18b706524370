import numpy as np
import pytest

from care_sim.base.errors import InvalidInput
from care_sim.scenarios import SCENARIOS, make_scenario

every_scenario = pytest.mark.parametrize("name", SCENARIOS)


def built(name, seed, **parameters):
    return make_scenario(name, **parameters).build(np.random.default_rng(seed))


def trace(world, seconds=3.0):
    """Every pose of every body and the ego, once a keyframe."""
    poses = []
    for _ in range(round(seconds / 0.1)):
        poses.append([world.ego.pose, *[actor.pose_at(world.time) for actor in world.actors]])
        world.advance(-1.0, 0.1)
    return np.array(poses)


def traced(name, seed, **parameters):
    world = built(name, seed, **parameters)
    try:
        return trace(world)
    finally:
        world.close()


def actor_named(world, name):
    return next(actor for actor in world.actors if actor.name == name)


@every_scenario
def test_the_same_seed_gives_the_same_world_and_another_another(name):
    assert np.array_equal(traced(name, 4), traced(name, 4))
    assert not np.array_equal(traced(name, 4), traced(name, 5))


@every_scenario
def test_there_is_one_first_sighting_and_it_is_reported(name):
    world = built(name, 0)
    assert world.first_sighting in world.actors
    assert world.first_sighting.label is not None
    world.close()


@every_scenario
def test_nothing_stands_in_anything_else_at_the_start(name):
    for seed in range(5):
        world = built(name, seed)
        bodies = [("ego", world.ego_body)] + [(actor.name, actor.body) for actor in world.actors]
        touching = [
            (one, other)
            for n, (one, first) in enumerate(bodies)
            for other, second in bodies[n + 1 :]
            if world.bullet.clearance(first, second, 0.2) <= 0.0
        ]
        world.close()
        assert touching == []


@pytest.mark.parametrize("vehicles", [0, 12])
def test_vehicles_of_the_dense_street_are_counted_without_the_follower(vehicles):
    alone, street = built("dartout", 0), built("dense", 0, vehicles=vehicles)
    assert len(street.actors) - len(alone.actors) == vehicles + 1
    alone.close()
    street.close()


@pytest.mark.parametrize(
    ("name", "given", "reported"),
    [
        ("dartout", {}, False),
        ("dense", {"occluder": "van"}, False),
        ("dense", {"occluder": "van", "occluder_reported": True}, True),
        ("cutin", {}, True),
        ("cutin", {"occluder_reported": False}, False),
    ],
)
def test_perception_reports_what_hides_somebody_or_not(name, given, reported):
    world = built(name, 0, **given)
    occluder = actor_named(world, "occluder")
    assert (occluder.label is not None) is reported
    assert occluder.kind.name == given.get("occluder", occluder.kind.name)
    world.close()


@pytest.mark.parametrize("occluder", ["trailer", "hoarding"])
def test_what_has_no_class_cannot_be_reported(occluder):
    with pytest.raises(InvalidInput, match=rf"occluder_reported.*{occluder}"):
        make_scenario("dartout", occluder=occluder, occluder_reported=True)


def test_the_person_runs_straight_across_at_the_stated_speed():
    world = built("dartout", 0)
    times = np.arange(0, 6, 0.01)
    poses = np.array([world.first_sighting.pose_at(t) for t in times])
    speeds = np.diff(poses[:, 1]) / 0.01
    world.close()
    assert np.ptp(poses[:, 0]) == 0
    assert 2.6 <= speeds.max() <= 2.8
    assert speeds.min() >= 0


def test_the_car_of_the_cut_in_comes_into_the_egos_lane():
    world = built("cutin", 0)
    start = world.first_sighting.pose_at(0.0)
    world.advance(-3.0, 6.0)
    _, y, heading = world.first_sighting.pose_at(world.time)
    world.close()
    assert start[1:] == pytest.approx((-3.5, 0.0))
    assert y == pytest.approx(0.0, abs=0.6)
    assert abs(heading) < 0.2


@every_scenario
def test_an_unknown_parameter_is_refused_with_the_known_ones(name):
    with pytest.raises(InvalidInput, match=rf"parameter of {name} 'colour'.*duration_s"):
        make_scenario(name, colour=1)


@pytest.mark.parametrize(
    ("name", "parameters", "named"),
    [
        (
            "dartout",
            {"occluder": "bush"},
            r"occluder of dartout 'bush'; known: hoarding, trailer, truck, van",
        ),
        ("dense", {"vehicles": "five"}, "dense"),
        ("dartout", {"run_mps": (3.0, 2.0)}, "run_mps of dartout"),
        ("dartout", {"run_up_mps2": 0.0}, "run_up_mps2 of dartout"),
        ("roundabout", {}, r"scenario 'roundabout'; known: cutin, dartout, dense, drive, ncap"),
    ],
)
def test_an_impossible_value_is_refused_in_one_line(name, parameters, named):
    with pytest.raises(InvalidInput, match=named) as refusal:
        make_scenario(name, **parameters)
    assert "\n" not in str(refusal.value)

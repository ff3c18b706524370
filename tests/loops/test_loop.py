"""Several worlds in a loop: each keeps what is its own when another one begins."""

from contextlib import closing

import numpy as np
import pytest

from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.rig import Rig
from care_sim.loops.episode import Episode, SensorSeeds
from care_sim.loops.loop import Loop
from care_sim.loops.stages.state import Fired
from care_sim.sensors.pictures import FRONT_CAMERA
from care_sim.world.traffic import Traffic
from care_sim.world.world import World

SEEDS = SensorSeeds(*(np.random.SeedSequence(seed) for seed in range(4)))


@pytest.fixture
def loop():
    """Two worlds with a car in view, whose software does not know well where its LiDAR is."""
    rig = Rig(cameras=(FRONT_CAMERA,), sensor_y_m=0.5)
    conditions = ClosedLoopConditions(ego_position_sigma_m=0.5)
    both = Loop([rig] * 2, [conditions] * 2, 1.0)
    both.begin({world: episode(1) for world in range(2)})
    return both


def episode(cars):
    world = World(Traffic((1,), 0, 3.5, 14.0), 10.0)
    for n in range(cars):
        world.add(f"car {n}", "car", (25.0 + 6 * n, 0.0, 0.0))
    return Episode(world, SEEDS, SEEDS.lidar)


@pytest.mark.parametrize("cars", [1, 40])
def test_what_a_world_shows_stays_when_another_begins(loop, cars):
    car = int(loop.state.egos.bodies[0]) + 1
    assert loop.shows(0, car)
    loop.begin({1: episode(cars)})
    assert loop.shows(0, car)


def test_where_a_car_takes_itself_to_be_stays_when_another_world_begins(loop):
    driven = loop.state.driven.poses[0].copy()
    assert (driven != loop.state.sensors.poses[0]).any()
    loop.begin({1: episode(1)})
    assert loop.state.driven.poses[0].tobytes() == driven.tobytes()


@pytest.mark.parametrize("given", [{}, {"camera_latency_s": 0.05}, {"engine": "bullet"}])
@pytest.mark.parametrize("cars", [26, 40])
def test_perception_reports_no_body_that_an_event_adds(cars, given):
    """Tables of bodies begin with 32 rows."""
    loop = Loop([Rig(cameras=(FRONT_CAMERA,))], [ClosedLoopConditions(**given)], 1.0)
    begun = episode(cars)
    with closing(begun.world) as world:
        known = len(world.kinds)
        world.at(0.05, lambda: [world.add(f"{n}", "car", (9.0, 3.0 * n, 0.0)) for n in range(8)])
        loop.begin({0: begun})
        assert loop.arrived.counts[0] or given
        loop.keyframe(Fired.of([np.empty(0, np.int64)]), np.ones(1, np.bool_))
        assert loop.shows(0, known + 1)
        seen = loop.arrived.objects[0, : loop.arrived.counts[0]]
        assert len(loop.world(0).kinds) == known + 8
        assert (seen <= known).all()


@pytest.mark.parametrize("asks", ["target", "all"])
def test_cameras_show_the_same_bodies_whenever_pictures_are_taken(asks):
    """Late pictures leave the keyframe's to be drawn for bodies that somebody asks about."""
    conditions = [ClosedLoopConditions(), ClosedLoopConditions(camera_latency_s=0.12)]
    loop = Loop([Rig(cameras=(FRONT_CAMERA,))] * 2, conditions, 2.0)
    worlds = [episode(0) for _ in range(2)]
    for begun in worlds:
        for n in range(8):
            begun.world.add(f"car {n}", "car", (12.0 + 6 * n, 1.5 * n - 4.0, 0.0))
        begun.world.first_sighting = begun.world.actors[-8]
    loop.begin(dict(enumerate(worlds)))
    target, seen = worlds[0].world.first_sighting.body, []
    bodies = range(len(worlds[0].world.kinds)) if asks == "all" else [target]
    for _ in range(18):
        shown = np.array([[loop.shows(world, body) for body in bodies] for world in range(2)])
        assert shown[0].tolist() == shown[1].tolist()
        in_view = loop.keyframe(Fired.of([np.empty(0, np.int64)] * 2), np.ones(2, np.bool_)).in_view
        assert in_view[0] == in_view[1] == shown[0, bodies.index(target)]
        seen += shown[0].tolist()
    assert {*seen} == {True, False}
    for begun in worlds:
        begun.world.close()

"""The encounter of the paper's scenarios, seen by a full scan and the unimpaired camera of an ego
that never brakes.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.scenarios import make_scenario
from care_sim.sensors.engines.picture_kernels import visible_boxes
from care_sim.sensors.pictures import FRONT_CAMERA, MIN_PIXELS

GRID = AngularGrid()
KEYFRAME = 0.1
FIRST_RETURNS = 3
pytestmark = pytest.mark.slow
every_episode = pytest.mark.parametrize("seed", range(4))
every_hidden = pytest.mark.parametrize("name", ["dartout", "dense", "cutin"])
every_crossing = pytest.mark.parametrize("name", ["dartout", "dense"])


@dataclass(frozen=True)
class Sight:
    returns: int
    pixels: int
    reported: int
    ahead_m: float
    clearance_m: float
    impact: bool

    @property
    def visible(self):
        return self.returns >= FIRST_RETURNS or self.pixels >= MIN_PIXELS


def sight(world):
    """Returns and pixels of the first-sighting actor, of a full scan and the camera; rays outside
    its hull cannot meet it.
    """
    actor, sensor = world.first_sighting, Frame.mounted(world.ego.pose, LIDAR_POSITION)
    box = sensor.boxes_to_local(world.boxes([actor]))
    (hull,) = GRID.hulls(box)
    heading = np.array(
        [
            [np.cos(sensor.yaw), -np.sin(sensor.yaw), 0],
            [np.sin(sensor.yaw), np.cos(sensor.yaw), 0],
            [0, 0, 1],
        ]
    )
    _, ids = world.bullet.cast(sensor.origin, GRID.directions[hull] @ heading.T, GRID.range_m)
    picture = visible_boxes(world.bullet.body_ids(FRONT_CAMERA, sensor))
    others = [other for other in world.actors if other.label is not None and other is not actor]
    shown = picture[picture[:, 5] >= MIN_PIXELS, 0]
    pixels = int(picture[picture[:, 0] == actor.body, 5].sum())
    passage = world.advance(0.0, KEYFRAME)
    return Sight(
        int(np.sum(ids == actor.body)),
        pixels,
        int(np.isin([other.body for other in others], shown).sum()),
        float(box[0, 0]),
        passage.clearance_m,
        passage.impact_speed_mps is not None,
    )


@cache
def episode(name, seed):
    world = make_scenario(name).build(
        np.random.default_rng(np.random.SeedSequence(seed).spawn(4)[0])
    )
    sights = [sight(world) for _ in range(60)]
    world.close()
    return sights


def encounter(name, seed):
    """The keyframes until the ego has drawn level with the actor."""
    sights = episode(name, seed)
    level = next((n for n, one in enumerate(sights) if one.ahead_m < 3.0), len(sights))
    return sights[:level]


@every_episode
@every_hidden
def test_nothing_of_the_actor_is_seen_in_the_first_second(name, seed):
    start = episode(name, seed)[:10]
    assert [one.returns for one in start] == [0] * 10
    assert [one.pixels for one in start] == [0] * 10


@every_episode
@every_crossing
def test_the_person_appears_out_of_full_cover(name, seed):
    """From the first photon to enough for a detection it takes no more than two keyframes."""
    sights = encounter(name, seed)
    first = next(n for n, one in enumerate(sights) if one.returns or one.pixels)
    detectable = next(n for n, one in enumerate(sights) if one.returns >= FIRST_RETURNS)
    assert detectable - first <= 2
    assert 1.0 <= first * KEYFRAME <= 4.0


@every_episode
@every_crossing
def test_an_ego_that_never_brakes_hits_nobody_and_passes_close(name, seed):
    sights = episode(name, seed)
    assert not any(one.impact for one in sights)
    assert 0.3 < min(one.clearance_m for one in sights) < 2.0


@every_episode
@every_crossing
def test_there_is_room_to_brake_when_the_person_appears(name, seed):
    """Less reaction, more than the stopping distance from 30 km/h at 5 m/s^2, so that sensing
    decides.
    """
    first = next(one for one in encounter(name, seed) if one.returns >= FIRST_RETURNS)
    assert 14.0 < first.ahead_m < 18.5


@every_episode
def test_dartout_and_dense_differ_only_in_the_other_vehicles(seed):
    for alone, crowded in zip(encounter("dartout", seed), encounter("dense", seed), strict=True):
        assert (alone.returns, alone.pixels, alone.ahead_m) == (
            crowded.returns,
            crowded.pixels,
            crowded.ahead_m,
        )

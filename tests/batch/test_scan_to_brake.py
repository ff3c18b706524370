"""Scan, proxy, tracks and brake over arrays are those of the single loop, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.batch.scanning import Scanning
from care_sim.batch.tracking import Braking, Tracking
from care_sim.core.types import Tracks
from care_sim.driving.drivers import make_driver
from tests.helpers.side_by_side import SideBySide


def driver_of(loop, rig, conditions):
    """A controller as the loop's own, which has decided already."""
    length, width, _ = loop.world.ego_kind.size
    rules = replace(
        conditions, brake_for_oncoming=conditions.brake_for_oncoming or loop.world.has_oncoming
    )
    cruise = loop.world.ego_motion.speed
    return make_driver(rules, cruise, length / 2 - rig.sensor_x_m, width / 2, rig.keyframe_s)


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("Dense", {}),
        ("Dartout", {"brake_for_oncoming": True, "encroachment_s": (-0.2, -0.1)}),
        ("CutIn", {"budget": 0.03, "floor": False}),
        ("R157", {"budget": 1.0}),
    ],
)
def test_an_episode_is_that_of_the_single_loop(name, arguments):
    played = SideBySide(name, range(3), **arguments)
    state, rig, conditions = played.state, played.rig, played.conditions
    scanning, tracking = Scanning(rig, conditions), Tracking(rig.keyframe_s)
    braking = Braking(rig, conditions, 3)
    drivers = [driver_of(loop, rig, conditions) for loop in played.loops]
    for world, loop in enumerate(played.loops):
        braking.begin(world, loop.world.ego_motion.speed, loop.world.has_oncoming)
    images = np.full((3, *rig.grid.shape), np.nan, np.float32)
    brakes = 0
    while state.live.any():
        live = np.flatnonzero(state.live).tolist()
        actions, fired = played.fired()
        returns = scanning.scan(state, fired)
        scanning.image(fired, returns, images, state.live)
        found = scanning.found(state, returns)
        tracking.update(state, found)
        seen = tracking.seen(state)
        accelerations, on = braking.command(state.live, *seen, state.egos.speeds)
        for world in live:
            loop, cells = played.loops[world], fired.cells[world, : fired.counts[world]]
            scan, bodies = loop._lidar.fire(cells, loop.sensor)
            same(returns.ranges[world, : len(cells)], scan.ranges)
            same(returns.ids[world, : len(cells)], bodies)
            _, _, behind = loop._detection.detect(scan, bodies, loop._local_boxes)
            rows = found.rows[world, : found.counts[world]]
            same(state.reported.bodies[world, rows], behind)
            tracks = Tracks.from_checked_rows(seen.rows[world, : seen.counts[world]].copy())
            command = drivers[world].command(tracks, loop.belief.ego)
            assert (accelerations[world], on[world]) == (command.acceleration, command.braking)
        tracking.predict(state)
        decided = on.copy()
        infos = played.step(actions)
        for world in live:
            loop = played.loops[world]
            assert infos[world]["braking"] == decided[world]
            same(images[world], loop.belief.ranges)
            same(state.tracks.rows[world, : state.tracks.counts[world]], loop._memory._table)
            assert state.tracks.next_ids[world] == loop._memory._next_id
            brakes += decided[world]
    played.close()
    assert brakes > 0 or name == "R157"


def same(ours, theirs):
    assert ours.shape == theirs.shape
    assert ours.dtype == theirs.dtype
    assert ours.tobytes() == theirs.tobytes()

"""Sweeps between keyframes: the mask of a keyframe is held over them, and the detector gets all."""

from dataclasses import replace

import numpy as np
import pytest

from care_sim.core.conditions import Sensing
from care_sim.core.frames import Frame
from care_sim.core.rig import Rig
from care_sim.loops.episode import SensorSeeds
from care_sim.loops.film import Sweep
from care_sim.loops.open_loop import OpenLoop
from care_sim.perception.proxy import ReturnsProxy
from care_sim.sensors.annotated import Cloud
from care_sim.sensors.surround import SURROUND_CAMERAS
from tests.helpers.handmade_film import AHEAD, GRID, WALKER, handmade_film, returns_of

RIG = Rig(cameras=SURROUND_CAMERAS, keyframe_s=0.5)
NOWHERE = np.array([], np.int64)
LEFT, AHEAD_CELL = 40, 300
"""Two cells, one return each of the first sweep."""


class Listener(ReturnsProxy):
    """The proxy, which keeps what it was given."""

    def __init__(self):
        super().__init__()
        self.clouds = []

    def detect(self, cloud, annotations):
        self.clouds.append(cloud)
        return super().detect(cloud, annotations)


def swept(*sweeps):
    """The film by hand with the sweeps before its second keyframe, at 0.5 s."""
    film = handmade_film()
    first, second, *others = film.shots
    return replace(film, shots=(first, replace(second, sweeps=sweeps), *others))


def sweep(time_s, cells, sensor, objects=None, ranges=15.0):
    cells = np.array(cells)
    objects = np.full(len(cells), AHEAD) if objects is None else objects
    return Sweep(time_s, sensor, Cloud(cells, ranges * GRID.directions[cells], objects))


def played(film, *masks, **sensing):
    """The clouds that the detector was given at each keyframe, and the records."""
    listener = Listener()
    seeds = SensorSeeds(*map(np.random.SeedSequence, range(4)))
    loop = OpenLoop(film, RIG, Sensing(**sensing), seeds, listener)
    records = [loop.keyframe(np.sort(np.array(mask, np.int64))) for mask in masks]
    return listener.clouds, records, loop


def test_a_sweep_is_fired_by_the_mask_of_the_keyframe_before_it():
    film = swept(sweep(0.4, [LEFT, AHEAD_CELL], film_sensor()))
    wanted = {(): [], (LEFT,): [LEFT], (LEFT, AHEAD_CELL): [LEFT, AHEAD_CELL]}
    for mask, cells in wanted.items():
        clouds, *_ = played(film, mask, NOWHERE)
        assert clouds[1].cells.tolist() == cells
    # The mask of the keyframe itself comes too late for it.
    clouds, *_ = played(film, NOWHERE, [LEFT, AHEAD_CELL])
    assert len(clouds[1]) == 0


def film_sensor():
    return handmade_film().shots[1].sensor


def test_its_points_are_where_they_lay_in_the_world_and_tell_their_time():
    """The sensor stood 3 m further back, turned left by 90 degrees, and saw a point to its right
    that lies ahead of the keyframe's.
    """
    here = film_sensor()
    there = Frame(here.x - 3.0, here.y, here.z, here.yaw + np.pi / 2)
    to_the_right = GRID.cells_of(np.array([[0.0, -10.0, 0.0]]))
    clouds, *_ = played(swept(sweep(0.35, to_the_right, there, ranges=10.0)), to_the_right, NOWHERE)
    (x, y, z) = clouds[1].points[0]
    wanted = 10.0 * GRID.directions[to_the_right[0]]
    assert (x, y, z) == pytest.approx((-wanted[1] - 3.0, wanted[0], wanted[2]))
    assert clouds[1].times == pytest.approx([-0.15])


def test_all_come_in_the_order_of_their_cells_with_the_keyframes_own_at_time_zero():
    own = returns_of(WALKER, 1)
    sweeps = [sweep(0.5 - 0.1 * n, [LEFT, own[0]], film_sensor()) for n in (2, 1)]
    clouds, *_ = played(swept(*sweeps), [LEFT, own[0]], [own[0]])
    cloud = clouds[1]
    assert (np.diff(cloud.cells) >= 0).all()
    found = {(cell, round(time, 6)) for cell, time in zip(cloud.cells, cloud.times, strict=True)}
    assert found == {(LEFT, -0.2), (LEFT, -0.1), (own[0], -0.2), (own[0], -0.1), (own[0], 0.0)}


def test_returns_of_sweeps_count_for_a_detection_and_no_ray_is_counted_but_the_keyframes_own():
    """Two sweeps and the keyframe hit the walker once each, the sweeps the car too."""
    (cell, *_) = returns_of(WALKER, 1)
    on_both = np.array([AHEAD, WALKER])
    hits = [sweep(t, [LEFT, cell], film_sensor(), on_both, ranges=5.0) for t in (0.3, 0.4)]
    _, records, loop = played(swept(*hits), [LEFT, cell], [cell])
    assert records[1].detections.returns.tolist() == [3], "of the car there are but two"
    assert records[1].fired.tolist() == [cell]
    image = loop.belief.ranges.ravel()
    assert np.flatnonzero(image).tolist() == [cell], "the image is of the keyframe's sweep alone"
    assert image[cell] == 15.0
    _, without, _ = played(handmade_film(), [cell], [cell])
    assert len(without[1].detections.classes) == 0


def test_every_sweep_has_its_own_faults():
    cells = np.arange(0, 4000)
    sweeps = [sweep(t, cells, film_sensor()) for t in (0.3, 0.4)]
    clouds, *_ = played(swept(*sweeps), cells, NOWHERE, lidar_dropout=0.5)
    kept = [set(clouds[1].cells[clouds[1].times == t]) for t in np.unique(clouds[1].times)]
    assert all(1800 < len(one) < 2200 for one in kept)
    assert kept[0] != kept[1]

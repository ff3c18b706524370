"""The numbers that the docstring of the dense street states, recomputed from geometry and Algorithm
1 alone.
"""

from functools import cache

import numpy as np
import pytest

from care_sim.core.allocation import allocate, budget_cells
from care_sim.core.conditions import MIN_RETURNS, Sensing
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.residual import wedges
from care_sim.core.rig import Rig
from care_sim.core.sensor_setup import LIDAR_POSITION
from care_sim.core.types import Demand
from care_sim.scenarios import make_scenario
from care_sim.sensors.camera import CameraDetector
from care_sim.sensors.pictures import FRONT_CAMERA, Picture, class_table, faultless_detections

pytestmark = pytest.mark.slow
GRID = AngularGrid()
RIG = Rig(GRID, (FRONT_CAMERA,))
SEEDS = range(8)


@cache
def appearance(seed):
    """(hulls of perfect tracks, wedges of all camera boxes, the person's wedge) at the first three
    returns.
    """
    world = make_scenario("dense").build(
        np.random.default_rng(np.random.SeedSequence(seed).spawn(4)[0])
    )
    person = world.first_sighting
    while True:
        sensor = Frame.mounted(world.ego.pose, LIDAR_POSITION)
        (around,) = GRID.hulls(sensor.boxes_to_local(world.boxes([person])))
        if np.sum(returns_of(world, sensor, around) == person.body) >= MIN_RETURNS:
            break
        world.advance(0.0, 0.1)
    found = scene(world, sensor, person)
    world.close()
    return found


def returns_of(world, sensor, cells):
    return world.bullet.cast(sensor.origin, GRID.directions[cells], GRID.range_m)[1]


def scene(world, sensor, person):
    ids, counts = np.unique(returns_of(world, sensor, np.arange(GRID.size)), return_counts=True)
    hit = set(ids[counts >= MIN_RETURNS].tolist())
    tracked = [
        actor
        for actor in world.actors
        if actor.label is not None and actor is not person and actor.body in hit
    ]
    boxes = sensor.boxes_to_local(world.boxes(tracked))
    nearest_first = boxes[np.argsort(np.hypot(boxes[:, 0], boxes[:, 1]))]
    labels = {actor.body: actor.label for actor in world.actors if actor.label is not None}
    picture = Picture.of(world.bullet.body_ids(FRONT_CAMERA, sensor))
    camera = CameraDetector(list(labels), Sensing(), 0.1, np.random.SeedSequence(0), [FRONT_CAMERA])
    anywhere = np.zeros((len(labels), 7))
    seen = camera.detect(
        faultless_detections([picture], class_table(labels)), 0.0, anywhere, 0.0
    ).detections
    (of_person,) = [n for n in range(len(seen)) if seen.classes[n] == person.label]
    cells = wedges(seen, RIG)
    return GRID.hulls(nearest_first), cells, cells[of_person]


def fired_on_person(seed, budget, reserve_for_all):
    hulls, cells, person = appearance(seed)
    reserve = cells if reserve_for_all else [person]
    chosen = allocate(Demand(hulls, [reserve]), budget_cells(budget, GRID.size), 0.3)
    return len(set(chosen.tolist()) & set(person.tolist()))


def test_hulls_and_wedges_that_compete():
    hulls, layers = zip(*[appearance(seed)[:2] for seed in SEEDS], strict=True)
    assert np.median([len(one) for one in hulls]) == 8
    assert np.median([len(one) for one in layers]) == 6


def test_the_persons_wedge_is_about_54_cells():
    assert np.mean([len(appearance(seed)[2]) for seed in SEEDS]) == pytest.approx(54, abs=1)


@pytest.mark.parametrize(("budget", "cells"), [(0.03, 24), (0.035, 34), (0.04, 45), (0.05, 54)])
def test_cells_a_reserve_for_every_box_fires_on_the_person(budget, cells):
    assert np.mean([fired_on_person(seed, budget, True) for seed in SEEDS]) == pytest.approx(
        cells, abs=1
    )


@pytest.mark.parametrize("budget", [0.03, 0.035, 0.04, 0.05])
def test_a_reserve_for_the_person_alone_fires_the_whole_wedge(budget):
    for seed in SEEDS:
        assert fired_on_person(seed, budget, False) == len(appearance(seed)[2])

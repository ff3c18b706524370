"""Shared scenes: small tables of tracks and detections, and a simulator that is freed after the test."""

import numpy as np
import pytest
from hypothesis import settings

from care_sim.grid import AngularGrid
from care_sim.types import CLASSES, ImageDetections, Tracks
from care_sim.world.bullet import BulletWorld

settings.register_profile("repeatable", deadline=None, derandomize=True, database=None, max_examples=60)
settings.load_profile("repeatable")


@pytest.fixture(scope="session")
def grid():
    return AngularGrid()


@pytest.fixture
def bullet():
    world = BulletWorld()
    yield world
    world.close()


@pytest.fixture(scope="session")
def tracks_at():
    """Makes tracks from (class name, x, y, vx, vy); ids count from `first_id`."""

    def make(*objects, z=-1.0, size=(2.0, 1.0, 2.0), first_id=0, hits=2):
        rows = [
            [first_id + n, CLASSES.index(name), x, y, z, *size, 0.0, vx, vy, 0, hits]
            for n, (name, x, y, vx, vy) in enumerate(objects)
        ]
        return Tracks.from_rows(np.array(rows, dtype=float).reshape(-1, len(Tracks.COLUMNS)))

    return make


@pytest.fixture(scope="session")
def seen():
    """Makes camera detections from (class name, left, top, right, bottom)."""

    def make(*objects, camera=0, yaw_change=0.0):
        rows = [[CLASSES.index(name), 0.9, *box, camera, 0.0, yaw_change] for name, *box in objects]
        return ImageDetections.from_rows(np.array(rows, dtype=float).reshape(-1, len(ImageDetections.COLUMNS)))

    return make

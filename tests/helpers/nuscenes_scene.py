"""One small scene of one car, and its film."""

import numpy as np

from care_sim.sources.nuscenes.films import nuscenes_film
from care_sim.sources.nuscenes.recordings import split_scenes
from care_sim.sources.nuscenes.tables import Database
from tests.helpers.nuscenes_database import add_recorded_losses, annotated, pose, write

SCENE = "scene-0103"
CAR = annotated("vehicle.car", (20.0, 2.0, 0.85), instance="a")
WORLD = np.array(
    [[18.0, 2.0, 0.8], [18.1, 1.9, 0.5], [18.0, 2.0, 0.3], [30.0, -5.0, 0.1], [0.95, 0.2, 1.4]]
)
"""Points in the world, the car at its origin: three on the rear of CAR, one on the road, one on our
own roof.
"""


def database(folder, samples=None):
    samples = samples or [([CAR], pose(), add_recorded_losses(WORLD))]
    return write(folder / "nuscenes", {SCENE: samples})


def first(root, **options):
    tables = Database(root)
    (scene,) = split_scenes(tables)
    return nuscenes_film(tables, scene, **options)

"""Generated streets as a nuScenes database, with ten sweeps per keyframe: `python -m
tests.helpers.nuscenes_streets FOLDER SCENES`. Scenes have names of the official validation split.

Between two keyframes everything moves evenly. Every sweep is a full scan of the grid.
"""

import sys
from contextlib import closing
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.sensors.engines import ENGINES
from care_sim.sources.nuscenes.recordings import OFFICIAL
from care_sim.streets.street import make_street
from care_sim.world.bodies import CATALOGUE
from care_sim.world.bullet import BulletWorld
from tests.helpers.nuscenes_database import LIDAR, annotated, pose
from tests.helpers.nuscenes_drive import CATEGORIES
from tests.helpers.nuscenes_sweeps import write_swept

SWEEPS, SWEEP_S, KEYFRAME_S = 10, 0.05, 0.5
GRID = AngularGrid()
W, X, Y, Z = LIDAR[1]
FORWARD = Rotation.from_quat([X, Y, Z, W]) * Rotation.from_euler("z", 90, degrees=True)
"""nuScenes' LiDAR has x right and y ahead."""


def write_streets(root, scenes):
    """The folder of the database of the streets 0 to `scenes` - 1."""
    names = OFFICIAL["val"][:scenes]
    return write_swept(root, {name: samples(seed) for seed, name in enumerate(names)})


def samples(seed):
    """Every keyframe of a street, and the sweeps before it."""
    street = make_street(seed)
    with closing(BulletWorld()) as world:
        bodies = np.array(
            [
                world.add(CATALOGUE[kind], tuple(place))
                for kind, place in zip(street.kinds, street.poses[0].tolist(), strict=True)
            ]
        )
        engine = ENGINES["fast"](world, GRID)
        return [_sample(street, k, (world, bodies, engine)) for k in range(len(street.ego))]


def _sample(street, k, scanner):
    ego, places, found, points = _sweep(street, k, 0.0, scanner)
    counts = np.bincount(found[found >= 0], minlength=len(places))
    boxes = [
        _box(CATALOGUE[kind], place, number, int(count))
        for number, (kind, place, count) in enumerate(
            zip(street.kinds, places.tolist(), counts, strict=True)
        )
        if CATALOGUE[kind].label and count
    ]
    earlier = []
    for n in range(SWEEPS - 1 if k else 0, 0, -1):
        then, *_, swept = _sweep(street, k, n * SWEEP_S, scanner)
        earlier.append((n * SWEEP_S, pose(*then), swept))
    return boxes, pose(*ego), points, earlier


def _box(kind, place, number, count):
    x, y, yaw = place
    length, width, height = kind.size
    size = width, length, height
    spot = x, y, height / 2
    return annotated(CATEGORIES[kind.label], spot, size, yaw, str(number), points=count)


def _sweep(street, k, ago_s, scanner):
    """The ego's pose, all poses (n, 3), the body numbers (m,) behind the returns, rows (m, 5)."""
    share = 1 - ago_s / KEYFRAME_S
    ego, places = (_between(poses, k, share) for poses in (street.ego, street.poses))
    world, bodies, engine = scanner
    world.move_all(bodies, places)
    car = Frame(ego[0], ego[1], 0.0, ego[2])
    ranges, ids = engine.cast(car.holding(np.array(LIDAR[0]), FORWARD), np.arange(GRID.size))
    (hit,) = np.isfinite(ranges).nonzero()
    numbers = np.full(bodies.max() + 1, -1)
    numbers[bodies] = np.arange(len(bodies))
    local = GRID.directions[hit] * ranges[hit, None]
    rows = np.column_stack([-local[:, 1], local[:, 0], local[:, 2], np.full(len(hit), 30.0)])
    return (
        ego,
        places,
        numbers[ids[hit]],
        np.column_stack([rows, GRID.rows - 1 - hit // GRID.columns]),
    )


def _between(poses, k, share):
    """The poses a `share` of the way from the keyframe before to keyframe `k`."""
    if share == 1:
        return poses[k]
    last, now = poses[k - 1], poses[k]
    moved = now - last
    moved[..., 2] = (moved[..., 2] + np.pi) % (2 * np.pi) - np.pi
    return last + share * moved


if __name__ == "__main__":
    write_streets(Path(sys.argv[1]), int(sys.argv[2]))

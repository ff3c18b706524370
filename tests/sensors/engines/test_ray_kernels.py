"""Rays that are asked about few parts meet what they would meet if they were asked about all."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.grid import AngularGrid
from care_sim.sensors.engines import ray_kernels as kernels
from care_sim.sensors.engines.solid_kernels import BOX, CYLINDER, SPHERE, meet, solid_of
from care_sim.sensors.engines.window_kernels import Parts, SensorPose, place_parts

GROUND = 0
GRIDS = (
    AngularGrid(columns=128, rows=16),
    AngularGrid(columns=60, rows=9, field_of_view=np.pi / 2, heading=0.3, top=0.3, bottom=-0.5),
    AngularGrid(columns=100, rows=7, field_of_view=np.pi * 4 / 3, heading=2.5),
    AngularGrid.of_elevations([0.2, 0.15, 0.02, 0.0, -0.01, -0.3, -0.31, -1.2], columns=100),
    AngularGrid(columns=90, rows=20, top=1.2, bottom=-1.5, range_m=200.0),
)


@given(st.integers(0, 2**32), st.sampled_from(GRIDS), st.booleans(), st.booleans())
def test_no_ray_misses_what_it_would_meet_if_all_were_tried(seed, grid, tilted, standing):
    draw = np.random.default_rng(seed)
    spread = draw.choice([1.0, 5.0, 30.0, 60.0])
    poses = np.concatenate([draw.normal(size=(6, 3)), draw.normal(size=(6, 4))], axis=1)
    poses[:, :3] *= spread, spread, 1.0
    if standing:
        poses[:, 2:5] = 0.0
    poses[:, 3:] /= np.linalg.norm(poses[:, 3:], axis=1, keepdims=True)
    count = draw.integers(0, 20)
    shapes = draw.choice([BOX, BOX, CYLINDER, SPHERE], count)
    halves = draw.choice([0.05, 0.3, 1.0, 3.0, 10.0], (count, 3)) * draw.uniform(0.5, 1.5)
    halves[shapes != BOX, 1] = halves[shapes != BOX, 0]
    halves[shapes == SPHERE, 2] = halves[shapes == SPHERE, 0]
    offsets = draw.normal(size=(count, 3))
    parts = shapes, halves, offsets, np.sort(draw.integers(0, len(poses), count))
    sensor = np.array([*draw.normal(size=2), 1.84, draw.uniform(-4, 4), 0, 0])
    if tilted:
        sensor[4:] = draw.normal(size=2) * draw.choice([0.001, 0.1, 1.0])
    cells = np.flatnonzero(draw.random(grid.size) < draw.choice([0.05, 0.5, 1.0]))

    spacing, reach = (*grid.spacing,), float(grid.range_m)
    found = kernels.cast_rays(cells, reach, grid.fan, spacing, sensor, parts, poses, GROUND)
    expected = asked_about_all(cells, grid, sensor, Parts(*parts), poses)
    for ours, theirs in zip(found, expected, strict=True):
        assert ours.tobytes() == theirs.tobytes()


def asked_about_all(cells, grid, sensor, parts, poses):
    pose = SensorPose(*sensor)
    # An endless reach places every part.
    placed = place_parts(pose, parts, poses, grid.spacing, np.inf)
    across, down = grid.fan
    rows, columns = np.divmod(cells, grid.columns)
    rays = np.stack(
        [down[rows, 0] * across[columns, 0], down[rows, 0] * across[columns, 1], down[rows, 1]]
    )
    ranges, ids = np.full(len(cells), np.inf), np.full(len(cells), kernels.NO_BODY)
    up = placed.up
    with np.errstate(divide="ignore"):
        road = -pose.z / (up[0] * rays[0] + up[1] * rays[1] + up[2] * rays[2])
    on_road = (road >= 0.0) & (road <= grid.range_m)
    ranges[on_road], ids[on_road] = road[on_road], GROUND
    distances = np.empty(len(cells))
    for part, owner in enumerate(parts.owners):
        solid = solid_of(part, parts, placed.centres, placed.axes)
        meet(solid, rays, distances, len(cells))
        nearer = (distances < ranges) & (distances <= grid.range_m)
        ranges[nearer], ids[nearer] = distances[nearer], owner
    return ranges, ids

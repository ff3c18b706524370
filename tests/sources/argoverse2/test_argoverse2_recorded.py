import functools

import numpy as np
import pytest
from pyarrow import feather

from care_sim.core.grid import AngularGrid
from care_sim.envs.open_loop import FilmEnv
from care_sim.sensors.annotated import NO_OBJECT
from care_sim.sources.argoverse2.recordings import (
    ARGOVERSE2_SENSOR_HEIGHT_M,
    UP_LIDAR,
    argoverse2_film,
)

loaded = functools.cache(argoverse2_film)


@pytest.mark.parametrize(
    "log", ["3bffdcff-c3a7-38b6-a0f2-64196d130958", "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"]
)
def test_real_logs_load(recorded, log):
    movie = loaded(recorded / "argoverse2" / log)
    assert len(movie.shots) == 32
    near = [np.hypot(*shot.annotations.boxes[:, :2].T) < 50 for shot in movie.shots]
    hits = [
        [(shot.cloud.objects == n).sum() >= 3 for n in shot.annotations.objects[inside]]
        for shot, inside in zip(movie.shots, near, strict=True)
    ]
    assert np.mean(np.concatenate(hits)) > 0.75
    assert min(spread(movie)) < 1.0, "a parked car stays in its place while ours moves"


@pytest.mark.parametrize(
    "log", ["3bffdcff-c3a7-38b6-a0f2-64196d130958", "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"]
)
def test_real_logs_stay_within_the_observation_space(recorded, log):
    """The noise of their poses rolls a standing car back, and boxes that jump make tracks race."""
    env = FilmEnv(loaded(recorded / "argoverse2" / log))
    observation, _ = env.reset(seed=0)
    over = False
    while not over:
        assert env.observation_space.contains(observation)
        observation, _, _, over, _ = env.step(np.ones((32, 512), np.float32))
    assert env.observation_space.contains(observation)


def spread(movie):
    """How far the centre of every object that all keyframes hold moves in the world, metres."""
    everywhere = set.intersection(*(set(shot.annotations.objects.tolist()) for shot in movie.shots))
    for n in everywhere:
        rows = [
            s.sensor.boxes_to_world(s.annotations.boxes)[s.annotations.objects == n][0, :2]
            for s in movie.shots
        ]
        yield np.ptp(rows, axis=0).max()


SWEPT = "adcf7d18-0510-35b0-a2fa-b4cea13a6d76"
"""The log with a recorded sweep of its first annotated timestamp; the car stood still."""


@pytest.fixture
def sweep(recorded):
    """Points (n, 3) in the sensor frame, and the laser of each; 0 to 31 are those of `up_lidar`."""
    (path,) = (recorded / "argoverse2" / SWEPT / "sensors" / "lidar").glob("*.feather")
    table = feather.read_table(path)
    points = np.stack([table[axis].to_numpy().astype(float) for axis in "xyz"], axis=1)
    return points - UP_LIDAR, table["laser_number"].to_numpy()


def test_the_mount_is_where_the_recorded_lasers_meet(sweep):
    """Seen from the right place, and from no other, every laser keeps its elevation at all ranges
    and azimuths.
    """

    def spread(shift):
        points = sweep[0] - shift
        ranges = np.linalg.norm(points, axis=1)
        near = (ranges > 3) & (ranges < 15)
        lasers = [
            np.arcsin(points[:, 2] / ranges)[near & (sweep[1] == laser)] for laser in range(32)
        ]
        return np.rad2deg(
            np.median([np.std(elevations) for elevations in lasers if len(elevations) > 50])
        )

    assert spread(np.zeros(3)) < 0.005
    assert min(spread(shift) for shift in 0.1 * np.vstack([np.eye(3), -np.eye(3)])) > 0.015


def test_the_road_lies_where_the_recorded_sweep_has_it(sweep):
    points, _ = sweep
    distance = np.hypot(points[:, 0], points[:, 1])
    counts, edges = np.histogram(
        points[(distance > 4) & (distance < 10), 2], np.arange(-3.0, 1.0, 0.05)
    )
    assert edges[counts.argmax()] + 0.025 == pytest.approx(-ARGOVERSE2_SENSOR_HEIGHT_M, abs=0.05)


def test_cast_returns_lie_where_the_recorded_sweep_has_them(recorded, sweep):
    """On annotated objects half the cast ranges agree with the recorded sweep to 0.4 m: boxes are
    coarse bodies.
    """
    shot = loaded(recorded / "argoverse2" / SWEPT).shots[0]
    points, _ = sweep
    cells = AngularGrid().cells_of(points)
    real = np.full(AngularGrid().size, np.inf)
    np.minimum.at(real, cells[cells >= 0], np.linalg.norm(points, axis=1)[cells >= 0])
    hit = shot.cloud.objects != NO_OBJECT
    gap = np.abs(real[shot.cloud.cells[hit]] - np.linalg.norm(shot.cloud.points[hit], axis=1))
    assert np.median(gap) < 0.4

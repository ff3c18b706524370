"""Cells that are fired several times, at walls whose reflectance and distance are known."""

import numpy as np
import pytest

from care_sim.core.conditions import ReturnSettings, Sensing
from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.loops.truth import told_by
from care_sim.sensors.annotated import Cloud, cloud_of
from care_sim.sensors.beams import Beams, RollingSweep, bundle
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.lidar import Lidar, RecordedLidar
from care_sim.sensors.signal import Signal
from care_sim.world.bodies import CATALOGUE, BodyKind, Part
from care_sim.world.motions import LinearMotion

SENSOR = Frame(0.0, 0.0, 1.84, 0.3)
STATED = {"lidar_stated_range_m": 40.0}


@pytest.fixture(params=sorted(ENGINES))
def engine(request):
    return request.param


@pytest.fixture
def street(bullet):
    bullet.add(CATALOGUE["bus"], (12.0, 4.0, 0.0))
    bullet.add(CATALOGUE["car"], (25.0, -3.0, 0.5))
    bullet.add(CATALOGUE["adult"], (20.0, 1.0, 0.0))
    return bullet


def standing():
    raise AssertionError("without a sweep nobody asks how the world moves")


def cast(world, grid, engine, **settings):
    beams = Beams(world, grid, ReturnSettings(**settings), engine, standing)
    return beams.cast(SENSOR, np.arange(grid.size))


def test_what_returns_is_a_part_of_what_rays_meet(street, grid, engine):
    ranges, bodies = ENGINES[engine](street, grid).cast(SENSOR, np.arange(grid.size))
    scan, found = cast(street, grid, engine, **STATED)
    kept = np.isfinite(scan.ranges)
    assert 0 < kept.sum() < np.isfinite(ranges).sum()
    assert np.array_equal(scan.ranges[kept], ranges[kept])
    assert np.array_equal(found, np.where(kept, bodies, -1))
    assert (scan.intensities[kept] > 0).all()
    assert not scan.intensities[~kept].any()


def test_the_road_is_lost_where_it_is_met_too_flat(street, grid, engine):
    """0.17 h / r^3 falls below 0.1 / 40^2 at r^3 = 0.17 * 1.84 * 16000: 17.1 m."""
    scan, found = cast(street, grid, engine, **STATED)
    road = found == street.ground
    assert scan.ranges[road].max() <= (0.17 * 1.84 * 16000) ** (1 / 3)
    assert scan.ranges[road].max() > 14


def faulty(world, grid, **faults):
    sensing = Sensing(**STATED, **faults)
    beams = Beams(world, grid, sensing, "fast", standing)
    engine = ENGINES["fast"](world, grid)
    return Lidar(grid, engine, sensing, np.random.SeedSequence(0), beams)


def test_faults_come_on_top_of_what_returns(street, grid):
    cells = np.arange(grid.size)
    whole, _ = faulty(street, grid).fire(cells, SENSOR)
    broken = faulty(street, grid, lidar_dropout=0.5, lidar_dead_rows=(9,), lidar_range_sigma=0.1)
    scan, bodies = broken.fire(cells, SENSOR)
    lost = np.isinf(scan.ranges)
    assert lost[np.isinf(whole.ranges)].all()
    assert 0.4 < (~lost).sum() / np.isfinite(whole.ranges).sum() < 0.6
    assert not scan.intensities[lost].any()
    assert (bodies[lost] == -1).all()
    assert np.array_equal(scan.intensities[~lost], whole.intensities[~lost])


GRIDS = [
    AngularGrid(),
    AngularGrid(columns=120, field_of_view=2 * np.pi / 3, heading=0.5),
    AngularGrid.of_elevations([0.2, 0.05, -0.1, -0.3], columns=90),
    AngularGrid(heading=1.0, pitch=-0.3, roll=0.2),
]


@pytest.mark.parametrize("grid", GRIDS)
@pytest.mark.parametrize("divergence", [0.5, 3.0, 10.0])
def test_seven_rays_lie_round_the_direction_of_their_cell(grid, divergence):
    """At the level the bundle has the variance of an evenly lit disc of that diameter."""
    grids = bundle(grid, divergence)
    assert grids[0] == grid
    assert len(grids) == 7
    row = int(np.argmin(np.abs(grid.elevations)))
    cells = row * grid.columns + np.arange(0, grid.columns, 9)
    middle = grid.directions[cells]
    apart = np.array([1000 * (one.directions[cells] - middle) for one in grids])
    radius = divergence / 2
    spread = (apart**2).sum(axis=2)
    assert spread.mean(axis=0) == pytest.approx(np.full(len(cells), radius**2 / 2), rel=0.02)
    assert spread.max() < radius**2
    assert apart.mean(axis=0) == pytest.approx(np.zeros_like(middle), abs=1e-3 * divergence)


@pytest.mark.parametrize(
    "grid",
    [
        AngularGrid(rows=4, top=0.0, bottom=-np.pi / 2),
        # Several rows lie within a beam of straight up and of straight down.
        AngularGrid(rows=512, columns=64, top=np.pi / 2, bottom=-np.pi / 2),
        AngularGrid.of_elevations([np.pi / 2, 1.56, 0.3, -np.pi / 2]),
    ],
    ids=["down", "dense", "listed"],
)
def test_every_row_moves_by_the_same_angle_but_those_that_would_pass_straight_up_or_down(grid):
    grids = bundle(grid, 100.0)
    raised = [one.elevations - grid.elevations for one in grids]
    inner = np.abs(grid.elevations) < np.pi / 2 - 0.05
    for one, moved in zip(grids, raised, strict=True):
        assert moved[inner] == pytest.approx(np.median(moved[inner]), abs=1e-9)
        ends = np.clip(grid.elevations + moved[inner][0], -np.pi / 2, np.pi / 2)
        assert one.elevations == pytest.approx(ends, abs=1e-6)
    highest = max(moved[inner][0] for moved in raised)
    assert highest == pytest.approx(0.05 * np.sqrt(7 / 12) * np.sin(np.pi / 3))


LEVEL = Frame(0.0, 0.0, 1.84, 0.0)
WALL = BodyKind("wall", None, (0.2, 30.0, 6.0), (
    Part("box", (0.2, 30.0, 6.0), (0.0, 0.0, 3.0), (0.5,) * 3),
))  # fmt: skip
POST = BodyKind("post", None, (0.4, 0.4, 4.0), (
    Part("box", (0.4, 0.4, 4.0), (0.0, 0.0, 2.0), (0.5,) * 3),
))  # fmt: skip
LEVEL_ROW = 8
"""The row at 0 degrees."""
every_engine = pytest.mark.parametrize("engine", sorted(ENGINES))


def beams(world, grid, engine, ego=(0.0, 0.0, 0.0), bodies=None, **settings):
    rates = np.zeros((len(world.primitives.poses), 3))
    for body, moves in (bodies or {}).items():
        rates[body] = moves
    motion = LinearMotion((0.0, 0.0, 0.0), np.array(ego, float), rates)
    sweep = ReturnSettings(lidar_sweep_s=0.1, **settings)
    return Beams(world, grid, sweep, engine, lambda: motion)


def column_at(grid, azimuth):
    return int(np.argmin(np.abs(grid.azimuths - azimuth)))


@pytest.mark.parametrize("columns", [512, 100, 7])
def test_every_cell_fires_once_and_in_the_sweep(columns):
    grid = AngularGrid(columns=columns)
    cells = np.arange(0, grid.size, 3)
    sweep = RollingSweep(grid, 0.1)
    seconds, parts = zip(*sweep.instants(cells), strict=True)
    assert sorted(np.concatenate(parts).tolist()) == list(range(len(cells)))
    told = sweep.seconds(cells)
    for instant, part in zip(seconds, parts, strict=True):
        assert (told[part] == instant).all()
    # Its own instant is that of the middle of its column, and that of its group is near.
    own = -0.1 * (cells % columns + 0.5) / columns
    assert np.abs(told - own).max() <= 0.1 / min(columns, 64) / 2
    assert -0.1 < told.min() < told.max() < 0


def test_the_sensor_turns_to_the_right_from_behind_to_behind(grid):
    left, ahead, right = (
        RollingSweep(grid, 0.1).seconds(np.array([column_at(grid, azimuth)])).item()
        for azimuth in (np.pi / 2, 0.0, -np.pi / 2)
    )
    assert [left, ahead, right] == pytest.approx([-0.075, -0.05, -0.025], abs=1e-3)


@every_engine
def test_where_nothing_moves_a_sweep_is_a_scan(bullet, grid, engine):
    bullet.add(WALL, (20.0, 0.0, 0.3))
    cells = np.arange(grid.size)
    ranges, bodies = ENGINES[engine](bullet, grid).cast(LEVEL, cells)
    scan, met = beams(bullet, grid, engine).cast(LEVEL, cells)
    assert np.array_equal(scan.ranges, ranges)
    assert np.array_equal(met, bodies)


@every_engine
def test_ahead_the_way_of_half_a_sweep_is_added(bullet, grid, engine):
    """A wall ahead whose face is at 19.9 m; the ego came 20 m/s times 0.05 s nearer since."""
    bullet.add(WALL, (20.0, 0.0, 0.0))
    cell = np.array([LEVEL_ROW * grid.columns + column_at(grid, 0.0)])
    scan, _ = beams(bullet, grid, engine, ego=(20.0, 0.0, 0.0)).cast(LEVEL, cell)
    assert scan.ranges == pytest.approx([19.9 + 20 * -scan.times.item()], abs=2e-3)
    assert scan.times == pytest.approx([-0.05], abs=1e-3)


@every_engine
def test_who_crosses_is_seen_where_it_was(bullet, grid, engine):
    """10 m ahead, 8 m/s to the left: 0.4 m further right than it is at the keyframe."""
    post = bullet.add(POST, (10.0, 0.0, 0.0))
    cells = LEVEL_ROW * grid.columns + np.arange(grid.columns)
    scan, met = beams(bullet, grid, engine, bodies={post: (0.0, 8.0, 0.0)}).cast(LEVEL, cells)
    hit = met == post
    sides = (grid.directions[cells][hit] * scan.ranges[hit, None])[:, 1]
    assert sides.mean() == pytest.approx(-0.4, abs=0.07)


def off_the_wall(bullet, grid, **settings):
    """How far returns lie from the face of a wall 20 m ahead; the ego drives and turns."""
    wall = bullet.add(WALL, (20.0, 0.0, 0.0))
    cast = beams(bullet, grid, "fast", ego=(15.0, 1.0, 0.4), **settings)
    scan, met = cast.cast(LEVEL, np.arange(grid.size))
    cloud = cloud_of(cast.compensated(scan, LEVEL), met, grid)
    assert (cloud.times < 0).all()
    return np.abs(cloud.points[cloud.objects == wall, 0] - 19.9)


def test_compensated_points_of_what_stands_lie_on_it(bullet, grid):
    assert off_the_wall(bullet, grid, lidar_compensated=True).max() < 1e-9


def test_without_compensation_they_are_smeared(bullet, grid):
    """By what 15 m/s drive in the 30 to 70 ms since the sensor looked there, and by the turn."""
    apart = off_the_wall(bullet, grid)
    assert 0.3 < apart.min() < apart.max() < 1.2


STATED_M = 10.0
AHEAD = 8 * 512 + 256
"""The cell on the level row, with its middle straight ahead of `sensor`."""


def sensor(grid):
    return Frame(0.0, 0.0, 1.84, -float(grid.azimuths[256]))


def lidar(world, grid, **sensing):
    """A LiDAR in a world where all stands still."""
    told = Sensing(**sensing)
    still = LinearMotion((0.0, 0.0, 0.0), np.zeros(3), np.zeros((len(world.primitives.poses), 3)))
    beams = Beams(world, grid, told, "fast", lambda: still) if told.shapes_beams else None
    return Lidar(grid, ENGINES["fast"](world, grid), told, np.random.SeedSequence(3), beams)


def met(world, grid, shots, **weather):
    """Whether a cell that is fired so many times at what lies straight ahead returns."""
    settings = {"lidar_stated_range_m": STATED_M, **weather}
    scan, _ = lidar(world, grid, **settings).fire(np.full(shots, AHEAD), sensor(grid))
    assert scan.cells.tolist() == [AHEAD]
    return bool(np.isfinite(scan.ranges).all())


@pytest.mark.parametrize(("shots", "metres"), [(1, 10), (2, 10 * np.sqrt(2)), (4, 20), (9, 30)])
def test_reach_grows_with_the_root_of_the_shots(bullet, grid, shots, metres):
    wall = bullet.add(WALL, (metres + 0.1 - 0.02, 0.0, 0.0))
    assert met(bullet, grid, shots)
    assert shots == 1 or not met(bullet, grid, shots - 1)
    bullet.move_all(np.array([wall]), np.array([[metres + 0.1 + 0.02, 0.0, 0.0]]))
    assert not met(bullet, grid, shots)


def test_the_shots_that_are_needed_are_the_fewest_that_suffice():
    signal = Signal(ReturnSettings(lidar_stated_range_m=STATED_M, visibility_m=50.0))
    ranges = np.linspace(1, 40, 300)
    intensities = signal.intensities(np.full(300, 0.3), ranges)
    needed = signal.shots_needed(intensities, ranges)
    assert needed.min() == 1
    assert needed.max() > 100
    assert signal.suffices(intensities, ranges, needed).all()
    more = needed > 1
    assert not signal.suffices(intensities[more], ranges[more], needed[more] - 1).any()
    nothing = signal.shots_needed(np.zeros(2), np.array([5.0, np.inf]))
    assert np.isinf(nothing).all()


def test_in_a_sweep_every_cell_keeps_its_own_shots(bullet, grid):
    """Where nothing moves a sweep returns what a scan at one instant does."""
    bullet.add(WALL, (18.0, 0.0, 0.0))
    row = 8 * 512 + np.arange(206, 306)
    fired = np.repeat(row, np.tile([1, 4], 50))
    stated = {"lidar_stated_range_m": STATED_M}
    at_once, _ = lidar(bullet, grid, **stated).fire(fired, sensor(grid))
    rolling, _ = lidar(bullet, grid, **stated, lidar_sweep_s=0.1).fire(fired, sensor(grid))
    assert np.array_equal(at_once.ranges, rolling.ranges)
    returned = np.isfinite(at_once.ranges)
    assert returned[1::2].sum() > 20
    assert not returned[::2].any()


@pytest.fixture
def near(bullet):
    """Everything within reach of a first shot."""
    bullet.add(WALL, (8.0, 0.0, 0.0))
    return bullet


def test_noise_falls_with_the_root_of_the_shots(near, grid):
    """The same draw, halved with four shots."""
    cells = np.arange(9 * 512, 10 * 512)
    true = lidar(near, grid).fire(cells, sensor(grid))[0].ranges
    hit = np.isfinite(true)
    once, four = (
        lidar(near, grid, lidar_range_sigma=0.1).fire(fired, sensor(grid))[0].ranges[hit]
        for fired in (cells, np.repeat(cells, 4))
    )
    assert np.abs(once - true[hit]).mean() > 0.05
    assert four - true[hit] == pytest.approx((once - true[hit]) / 2, abs=1e-12)


def test_noise_of_a_recorded_return_falls_alike(grid):
    cells = np.arange(0, grid.size, 5)
    cloud = Cloud(cells, grid.directions[cells] * 20.0, np.full(len(cells), 1))
    once, four = (
        np.linalg.norm(
            RecordedLidar(grid, Sensing(lidar_range_sigma=0.1), np.random.SeedSequence(1))
            .fire(np.repeat(cells, shots), cloud)
            .points,
            axis=1,
        )
        - 20.0
        for shots in (1, 4)
    )
    assert four == pytest.approx(once / 2, abs=1e-12)


def test_what_a_return_tells_stands_beside_every_shot_of_its_cell():
    fired = np.array([2, 5, 5, 5, 9, 9])
    told = told_by(fired, np.array([5, 5, 9]), intensities=np.array([0.4, 0.1, 0.2]), times_s=None)
    assert {name: values.tolist() for name, values in told.items()} == {
        "intensities": [0.0, 0.4, 0.4, 0.4, 0.2, 0.2]
    }
    nothing = told_by(fired, np.empty(0, np.int64), intensities=np.empty(0))
    assert nothing["intensities"].tolist() == [0.0] * 6

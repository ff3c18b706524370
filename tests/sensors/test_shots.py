"""Cells that are fired several times, at walls whose reflectance and distance are known."""

import numpy as np
import pytest
from scipy.optimize import brentq

from care_sim.core.conditions import ReturnSettings, Sensing
from care_sim.core.frames import Frame
from care_sim.loops.truth import told_by
from care_sim.sensors.annotated import Cloud
from care_sim.sensors.beams import Beams
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.lidar import Lidar, RecordedLidar
from care_sim.sensors.signal import Signal
from care_sim.world.bodies import BodyKind, Part
from care_sim.world.motions import LinearMotion

WALL = BodyKind("wall", None, (0.2, 30.0, 6.0), (
    Part("box", (0.2, 30.0, 6.0), (0.0, 0.0, 3.0), (0.5,) * 3),
))  # fmt: skip
"""Of dark paint, 10%: the target that is stated."""
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


def test_fog_takes_from_what_more_shots_add(bullet, grid):
    """With four shots r^2 exp(2 * 3.912 r / 50) is four times 10^2: 9.5 m, and 20 in clear air."""
    reach = brentq(lambda r: r**2 * np.exp(2 * 3.912 * r / 50) - 4 * STATED_M**2, 1, 20)
    assert reach == pytest.approx(9.5, abs=0.01)
    wall = bullet.add(WALL, (reach + 0.1 - 0.02, 0.0, 0.0))
    assert met(bullet, grid, 4, visibility_m=50.0)
    assert not met(bullet, grid, 3, visibility_m=50.0)
    bullet.move_all(np.array([wall]), np.array([[reach + 0.1 + 0.02, 0.0, 0.0]]))
    assert not met(bullet, grid, 4, visibility_m=50.0)
    assert met(bullet, grid, 4)


def test_the_end_of_the_grid_stays_the_end(bullet, grid):
    bullet.add(WALL, (grid.range_m + 1.0, 0.0, 0.0))
    assert not met(bullet, grid, 100)


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


def test_an_echo_of_a_part_of_a_beam_is_noticed_with_more_shots(bullet, grid):
    """Four of seven rays lie on a board at 10 m, 5.7% of 10%: at 11 m stated two shots suffice."""
    bullet.add(WALL, (10.1, 15.0, 0.0))
    wide = lidar(bullet, grid, lidar_stated_range_m=11.0, lidar_divergence_mrad=10.0)
    half_on = Frame(0.0, 0.0, 1.84, 0.0005 - float(grid.azimuths[256]))
    ranges = [wide.fire(np.full(n, AHEAD), half_on)[0].ranges.item() for n in (1, 2)]
    assert ranges == pytest.approx([np.inf, 10.0], abs=1e-3)


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


@pytest.mark.parametrize(
    "sensing", [{}, {"lidar_dropout": 0.3, "lidar_crosstalk": 0.3}, {"lidar_sweep_s": 0.1}]
)
def test_without_strength_and_noise_more_shots_change_nothing(near, grid, sensing):
    cells = np.arange(5 * 512, 15 * 512)
    once, bodies = lidar(near, grid, **sensing).fire(cells, sensor(grid))
    more, found = lidar(near, grid, **sensing).fire(np.repeat(cells, 3), sensor(grid))
    assert np.array_equal(once.cells, more.cells)
    assert np.array_equal(once.ranges, more.ranges)
    assert np.array_equal(bodies, found)


def test_what_a_return_tells_stands_beside_every_shot_of_its_cell():
    fired = np.array([2, 5, 5, 5, 9, 9])
    told = told_by(fired, np.array([5, 5, 9]), intensities=np.array([0.4, 0.1, 0.2]))
    assert {name: values.tolist() for name, values in told.items()} == {
        "intensities": [0.0, 0.4, 0.4, 0.4, 0.2, 0.2]
    }
    nothing = told_by(fired, np.empty(0, np.int64), intensities=np.empty(0))
    assert nothing["intensities"].tolist() == [0.0] * 6

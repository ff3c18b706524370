import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.conditions import ReturnSettings, Sensing
from care_sim.core.frames import Frame
from care_sim.sensors.beams import Beams
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.lidar import Lidar
from care_sim.sensors.signal import echoes_of, reported
from care_sim.world.bodies import BodyKind, Part

SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
GONE = np.inf


def beam(*rays):
    """One beam of rays (range, intensity, body)."""
    columns = (np.array(column)[:, None] for column in zip(*rays, strict=True))
    return echoes_of(*columns)


def test_rays_on_one_surface_are_one_echo_as_strong_as_it():
    echoes = beam(*[(10.0, 0.3, 4)] * 7)
    assert echoes.beams.tolist() == [0]
    assert echoes.ranges == pytest.approx([10.0])
    assert echoes.intensities == pytest.approx([0.3])
    assert echoes.bodies.tolist() == [4]


def test_half_a_beam_is_half_as_strong():
    echoes = beam(*[(10.0, 0.4, 4)] * 2, *[(GONE, 0.0, -1)] * 2)
    assert echoes.intensities == pytest.approx([0.2])


def test_what_is_more_than_a_metre_apart_gives_two_echoes():
    """Of equal intensity, the nearer one is the stronger: 1 / r^2."""
    echoes = beam((20.0, 0.4, 5), (10.0, 0.4, 4), (20.0, 0.4, 5), (10.0, 0.4, 4))
    assert echoes.ranges == pytest.approx([10.0, 20.0])
    assert echoes.intensities == pytest.approx([0.2, 0.2])
    assert echoes.bodies.tolist() == [4, 5]
    for kept, ranges in (("strongest", [10]), ("last", [20]), ("both", [10, 20])):
        assert reported(echoes, kept).ranges == pytest.approx(ranges)


def test_a_bright_surface_behind_may_be_the_strongest():
    echoes = beam((10.0, 0.1, 4), (20.0, 0.8, 5))
    assert reported(echoes, "strongest").bodies.tolist() == [5]


def test_beside_a_strongest_that_is_the_last_both_has_the_second_strongest():
    echoes = beam((10.0, 0.05, 4), (20.0, 0.4, 5), (30.0, 0.8, 6), (GONE, 0.0, -1))
    assert reported(echoes, "strongest").bodies.tolist() == [5]
    assert reported(echoes, "both").bodies.tolist() == [5, 6]
    brighter = beam((10.0, 0.05, 4), (20.0, 0.4, 5), (30.0, 1.0, 6), (30.0, 1.0, 6))
    assert reported(brighter, "strongest").bodies.tolist() == [6]
    assert reported(brighter, "both").bodies.tolist() == [5, 6]
    assert len(reported(beam((10.0, 0.4, 4)), "both").beams) == 1


def test_what_is_nearer_melts_into_one_echo_between():
    """At the edge of a body 0.6 m before a wall, of the same brightness."""
    echoes = beam((10.0, 0.4, 4), (10.6, 0.4, 5))
    assert 10.0 < echoes.ranges.item() < 10.3
    assert echoes.bodies.tolist() == [4]


def test_a_beam_that_meets_nothing_has_no_echo():
    assert len(beam(*[(GONE, 0.0, -1)] * 3).beams) == 0


ray = st.tuples(st.floats(0.5, 50) | st.just(GONE), st.floats(0, 1), st.integers(1, 5))


@given(st.lists(st.lists(ray, min_size=3, max_size=3), min_size=1, max_size=5))
def test_echoes_keep_order_power_and_places(beams):
    table = np.array(beams, float)
    ranges, intensities, bodies = table[..., 0].T, table[..., 1].T, table[..., 2].T.astype(int)
    echoes = echoes_of(ranges, intensities, bodies)
    same = echoes.beams[1:] == echoes.beams[:-1]
    assert (np.diff(echoes.beams) >= 0).all()
    assert (np.diff(echoes.ranges)[same] > 0).all()
    assert {*echoes.beams.tolist()} == {*np.flatnonzero(np.isfinite(ranges).any(axis=0)).tolist()}
    met = np.isfinite(ranges)
    power = np.where(met, np.maximum(intensities, 1e-12), 0) / np.where(met, ranges, 1) ** 2 / 3
    assert (echoes.intensities / echoes.ranges**2).sum() == pytest.approx(power.sum())
    both = reported(echoes, "both")
    for kept in ("strongest", "last"):
        one = reported(echoes, kept)
        assert one.beams.tolist() == sorted({*echoes.beams.tolist()})
        assert {*one.ranges.tolist()} <= {*both.ranges.tolist()}


def post(metres):
    part = Part("box", (0.2, metres, 4.0), (0.0, 0.0, 2.0), (0.5,) * 3)
    return BodyKind("post", None, part.size, (part,))


@pytest.fixture
def edge(bullet):
    """The right edge of a board 10 m ahead, straight ahead of the car, and a wall at 20 m."""
    board = bullet.add(post(2.0), (10.1, 1.0, 0.0))
    wall = bullet.add(post(30.0), (20.1, 0.0, 0.0))
    return bullet, board, wall


def fired(world, grid, engine, heading, **settings):
    """A wide beam straight ahead of a sensor that looks by `heading` to the left."""
    beams = Beams(world, grid, ReturnSettings(lidar_divergence_mrad=10.0, **settings), engine, None)
    cell = np.array([8 * grid.columns + 256])
    ahead = heading - grid.azimuths[256]
    return beams.cast(Frame(0.0, 0.0, 1.84, ahead), cell)


@pytest.mark.parametrize("engine", sorted(ENGINES))
def test_at_an_edge_a_beam_meets_both(edge, grid, engine):
    world, board, wall = edge
    scan, bodies = fired(world, grid, engine, 0.0005, lidar_returns="both")
    assert scan.cells.tolist() == [8 * 512 + 256] * 2
    assert scan.ranges == pytest.approx([10.0, 20.0], abs=1e-3)
    assert bodies.tolist() == [board, wall]
    # Four of seven rays lie on the board.
    assert scan.intensities == pytest.approx([0.1 * 4 / 7, 0.1 * 3 / 7], rel=1e-3)
    strongest, _ = fired(world, grid, engine, 0.0005)
    last, _ = fired(world, grid, engine, 0.0005, lidar_returns="last")
    assert (strongest.ranges.item(), last.ranges.item()) == pytest.approx((10, 20), abs=1e-3)


def test_off_the_edge_a_beam_is_whole(edge, grid):
    world, board, wall = edge
    for heading, body, metres in ((0.01, board, 10), (-0.01, wall, 20)):
        scan, bodies = fired(world, grid, "fast", heading, lidar_returns="both")
        assert bodies.tolist() == [body]
        assert scan.ranges == pytest.approx([metres], abs=2e-3)


def test_an_edge_that_is_too_weak_is_not_noticed(edge, grid):
    """At 10 m a whole board of 10% returns from 10 m on; four sevenths of it do not."""
    world, *_ = edge
    stated = {"lidar_stated_range_m": 11.0, "lidar_returns": "both"}
    scan, bodies = fired(world, grid, "fast", 0.0005, **stated)
    assert np.isinf(scan.ranges).all()
    assert bodies.tolist() == [-1]


def test_a_scan_with_two_returns_of_a_cell_keeps_its_order_under_faults(edge, grid):
    world, _, wall = edge
    sensing = Sensing(
        lidar_divergence_mrad=20.0, lidar_returns="both", lidar_dropout=0.3, lidar_crosstalk=0.3
    )
    beams = Beams(world, grid, sensing, "fast", None)
    engine = ENGINES["fast"](world, grid)
    lidar = Lidar(grid, engine, sensing, np.random.SeedSequence(1), beams)
    cells = np.arange(grid.size)
    scan, bodies = lidar.fire(cells, SENSOR)
    again = np.diff(scan.cells) == 0
    assert again.sum() > 20
    assert np.array_equal(np.unique(scan.cells), cells)
    # A cell is lost with both, and never has a ghost beside a return.
    lost = np.isinf(scan.ranges)
    assert np.array_equal(lost[1:][again], lost[:-1][again])
    assert (bodies[1:][again & ~lost[1:]] >= 0).all()
    peeked = lidar.peek(SENSOR)
    assert np.array_equal(peeked.cells, cells)
    assert lidar.hits(wall, cells, SENSOR) > 0

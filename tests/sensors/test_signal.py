import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_sim.core.conditions import ReturnSettings, Sensing
from care_sim.core.frames import Frame
from care_sim.sensors.beams import Beams
from care_sim.sensors.engines import ENGINES
from care_sim.sensors.lidar import Lidar
from care_sim.sensors.signal import (
    Signal,
    brightness,
    echoes_of,
    rain_extinction,
    reported,
)
from care_sim.world.bodies import CATALOGUE, REFLECTANCES, BodyKind, Part
from care_sim.world.bullet import NO_BODY, pybullet

METRES = np.linspace(1, 200, 2000)


def seen_to(brightness, **settings):
    """The farthest of METRES from which a surface is noticed; of those before it all are."""
    signal = Signal(ReturnSettings(lidar_stated_range_m=40.0, **settings))
    bright = np.full(len(METRES), brightness)
    noticed = signal.suffices(signal.intensities(bright, METRES), METRES)
    assert not noticed[np.argmin(noticed) :].any()
    return METRES[np.argmin(noticed) - 1]


def test_the_stated_target_is_seen_from_the_stated_range_and_no_farther():
    assert seen_to(0.1) == pytest.approx(40, abs=0.1)
    assert seen_to(0.8, lidar_stated_reflectance=0.8) == pytest.approx(40, abs=0.1)


def test_fog_takes_the_light_twice_on_its_way_there_and_back():
    """At the range where rho / r^2 times exp(-2 * 3.912 r / V) is 0.1 / 40^2."""
    reached = seen_to(0.5, visibility_m=50.0)
    assert 0.5 / reached**2 * np.exp(-2 * 3.912 * reached / 50) == pytest.approx(
        0.1 / 40**2, rel=0.05
    )


def test_without_a_stated_range_everything_in_reach_is_noticed_and_nothing_else():
    signal = Signal(ReturnSettings())
    ranges = np.array([1.0, 49.0, np.inf])
    assert signal.suffices(signal.intensities(np.zeros(3), ranges), ranges).tolist() == [
        True,
        True,
        False,
    ]


@pytest.mark.filterwarnings("error")
def test_the_least_range_in_the_thickest_fog_is_a_number():
    signal = Signal(ReturnSettings(lidar_stated_range_m=0.01, visibility_m=0.01, rain_mm_h=1000.0))
    ranges = np.array([1e-6, 1.0, 1e6, np.inf])
    intensities = signal.intensities(np.ones(4), ranges)
    assert np.isfinite(intensities).all()
    assert signal.suffices(intensities, ranges).tolist() == [True, False, False, False]


@given(st.floats(0, 1), st.floats(0.5, 200), st.floats(10, 5000), st.floats(0.1, 100))
def test_weather_never_brightens(brightness, metres, visibility, rain):
    bright, ranges = np.array([brightness]), np.array([metres])
    clear, fog, both = (
        Signal(ReturnSettings(lidar_stated_range_m=40.0, **weather)).intensities(bright, ranges)
        for weather in (
            {},
            {"visibility_m": visibility},
            {"visibility_m": visibility, "rain_mm_h": rain},
        )
    )
    assert 0 <= both <= fog <= clear == brightness


def test_rain_takes_what_the_itu_says_from_a_kilometre():
    """1.076 dB at 1 mm/h, and ten times the decibels at 10^(1 / 0.67) = 31.1 mm/h."""
    for rain, decibels in ((1.0, 1.076), (10 ** (1 / 0.67), 10.76)):
        left = math.exp(-rain_extinction(rain) * 1000)
        assert -10 * math.log10(left) == pytest.approx(decibels)


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


def test_what_is_more_than_a_metre_apart_gives_two_echoes():
    """With equal intensity the nearer one is the stronger: 1 / r^2."""
    echoes = beam((20.0, 0.4, 5), (10.0, 0.4, 4), (20.0, 0.4, 5), (10.0, 0.4, 4))
    assert echoes.ranges == pytest.approx([10.0, 20.0])
    assert echoes.intensities == pytest.approx([0.2, 0.2])
    assert echoes.bodies.tolist() == [4, 5]
    for kept, ranges in (("strongest", [10]), ("last", [20]), ("both", [10, 20])):
        assert reported(echoes, kept).ranges == pytest.approx(ranges)


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


EYE = SENSOR.origin


def bright(world, ray, eye=EYE):
    """Reflectance times cosine where one ray ends."""
    ray = np.array([ray], float) / np.linalg.norm(ray)
    ranges, bodies = world.cast(np.array(eye), ray, 50.0)
    return brightness(world.primitives, np.array(eye), ray, ranges, bodies).item()


def one_part(shape, size, centre=(0.0, 0.0, 1.5), material="timber"):
    return BodyKind("thing", None, size, (Part(shape, size, centre, (0.5,) * 3, material),))


def test_the_road_is_of_asphalt_and_met_at_its_slope(bullet):
    """Down at 45 degrees the cosine is sqrt(1/2); straight down it is 1."""
    assert bright(bullet, (1, 0, -1)) == pytest.approx(0.17 * np.sqrt(0.5))
    assert bright(bullet, (0, 0, -1)) == pytest.approx(0.17)


def test_a_ball_is_met_obliquely_towards_its_rim(bullet):
    """A ray that passes the centre by b meets a ball of radius R where the cosine is
    sqrt(1 - (b / R)^2).
    """
    bullet.add(one_part("sphere", (3.0, 3.0, 3.0)), (10.0, 0.0, 0.0))
    for passed in (0.0, 0.6, 1.2):
        assert bright(bullet, (1, 0, 0), (0.0, passed, 1.5)) == pytest.approx(
            0.25 * np.sqrt(1 - (passed / 1.5) ** 2), abs=1e-3
        )


def test_a_drum_has_a_side_and_a_lid(bullet):
    bullet.add(one_part("cylinder", (2.0, 2.0, 1.0), (0.0, 0.0, 0.5)), (10.0, 0.0, 0.0))
    assert bright(bullet, (1, 0, 0), (0.0, 0.5, 0.5)) == pytest.approx(0.25 * np.sqrt(0.75), 1e-2)
    assert bright(bullet, (1, 0, -1), (7.0, 0.0, 4.0)) == pytest.approx(0.25 * np.sqrt(0.5), 1e-3)


def test_parts_of_a_body_have_their_own_materials(bullet):
    """A car at 10 m, seen from behind: the boot below the waist, above it the window."""
    bullet.add(CATALOGUE["car"], (10.0, 0.0, 0.0))
    assert bright(bullet, (1, 0, 0), (0.0, 0.0, 0.5)) == pytest.approx(REFLECTANCES["dark paint"])
    assert bright(bullet, (1, 0, 0), (0.0, 0.0, 1.4)) == pytest.approx(REFLECTANCES["glass"])


def test_incidence_is_that_of_the_normals_of_pybullet(bullet, grid):
    """Every kind of body, some turned and one tilted, by every cell that meets one."""
    places = np.random.default_rng(3).uniform(-25, 25, (len(CATALOGUE), 2))
    for (x, y), kind in zip(places, CATALOGUE.values(), strict=True):
        if np.hypot(x, y) > 8 and max(kind.size) < 20:
            bullet.add(kind, (x, y, x))
    bullet.add(one_part("box", (2.0, 3.0, 2.0)), Frame(6.0, 2.0, 0.3, 0.5, 0.3, -0.4))
    ranges, bodies = bullet.cast(EYE, grid.directions, 50.0)
    ends = EYE + grid.directions * 50.0
    ours = brightness(bullet.primitives, EYE, grid.directions, ranges, bodies)
    checked = np.flatnonzero((bodies != NO_BODY) & (bodies != bullet.ground))[::7]
    hits = [
        pybullet.rayTest(EYE.tolist(), ends[n].tolist(), physicsClientId=bullet._client.number)[0]
        for n in checked
    ]
    normals = np.array([hit[4] for hit in hits])
    cosines = -(normals * grid.directions[checked]).sum(axis=1)
    # Divided by the cosine of PyBullet's normal there must be left a reflectance of the table.
    left = ours[checked] / cosines
    apart = np.abs(left[:, None] - np.array([*REFLECTANCES.values()])).min(axis=1)
    assert len(checked) > 300
    assert np.quantile(apart, 0.99) < 1e-3

"""The engine `fast` held to Bullet's answers, and to ones that can be reckoned by hand."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.sensors.engines import ENGINES, Fast
from care_sim.world.bodies import CATALOGUE, BodyKind, Part
from care_sim.world.bullet import NO_BODY, BulletWorld
from tests.parity.engines import Engines
from tests.parity.rays import GRAZING, LOST, SAME, TOLERANCE, UNEXPLAINED, compare
from tests.parity.scenes import random_scenes

COARSE = AngularGrid(columns=180, rows=24)
SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
GREY = (0.5, 0.5, 0.5)
KINDS = {
    **CATALOGUE,
    "pole": BodyKind(
        "pole", None, (0.3, 0.3, 4.0), (Part("cylinder", (0.3, 0.3, 4.0), (0.0, 0.0, 2.0), GREY),)
    ),
    "drum": BodyKind(
        "drum", None, (3.0, 3.0, 1.0), (Part("cylinder", (3.0, 3.0, 1.0), (1.0, 0.0, 0.5), GREY),)
    ),
    "ball": BodyKind(
        "ball", None, (2.0, 2.0, 2.0), (Part("sphere", (2.0, 2.0, 2.0), (0.0, 0.5, 1.0), GREY),)
    ),
}


def rays(grid=COARSE):
    """Every cell of a grid."""
    return np.arange(grid.size)


def cast(world, sensor, grid=COARSE, cells=None):
    return ENGINES["fast"](world, grid).cast(sensor, rays(grid) if cells is None else cells)


def ahead(world, sensor):
    """Range and body of the level ray along the heading of a frame."""
    grid = AngularGrid(columns=4, rows=3, top=0.5, bottom=-0.5)
    ranges, ids = cast(
        world, replace(sensor, yaw=sensor.yaw - np.pi / 4), grid, np.array([grid.columns + 2])
    )
    return float(ranges[0]), int(ids[0])


def assert_parity(kinds, frames, sensor, lost=0):
    """Every cell of a grid answered as Bullet does, asked in millimetres, but for rays that graze
    or that it lost.
    """
    with closing(BulletWorld()) as world:
        for kind, frame in zip(kinds, frames, strict=True):
            world.add(kind, frame)
        engines = Engines.of(world, COARSE)
        with closing(engines.exact):
            compared = compare(engines, sensor, rays())
    assert not np.any(compared.on_exact == UNEXPLAINED)
    assert np.sum(compared.on_exact == LOST) <= lost
    assert np.isin(1, compared.fast[1])


@pytest.mark.parametrize(
    ("kind", "frame", "sensor"),
    [
        ("bus", Frame(0.0, 0.0, 0.0, 0.0), Frame(0.3, 0.1, 5.0, 0.0)),
        ("bus", Frame(0.0, 0.0, 0.0, 0.0), Frame(0.0, 0.0, 5.0, 0.0)),
        ("terrace", Frame(10.0, 6.0, 0.0, 0.1), Frame(0.0, 0.0, 1.84, 0.0)),
        ("drum", Frame(0.0, 0.0, 1.5, 0.0), Frame(0.8, 0.1, 1.0, 0.3, 0.1, -0.4)),
        ("pedestrian", Frame(-3.0, 0.05, 0.0, 0.7), Frame(0.0, 0.0, 1.84, 0.0, 0.1, 0.1)),
        ("ball", Frame(-2.0, 0.0, 0.5, 0.3, 1.0, -0.5), Frame(0.0, 0.0, 1.2, 2.0)),
        ("van", Frame(4.0, -1.0, 1.0, 2.0, -0.7, 0.2), Frame(0.0, 0.0, 2.5, 0.0, -0.1, 0.2)),
    ],
)
def test_bullet_in_millimetres_answers_the_same_around_one_body(kind, frame, sensor):
    assert_parity([KINDS[kind]], [frame], sensor, lost=3 if frame.roll else 0)


@pytest.mark.parametrize("heading", [0.0, 1.2])
def test_a_tilted_grid_is_answered_as_bullet_does(bullet, heading):
    """By itself, and on a car that leans."""
    grid = replace(COARSE, heading=heading, pitch=0.2, roll=-0.15)
    bullet.add(CATALOGUE["bus"], (9.0, 3.0, 0.4))
    bullet.add(CATALOGUE["car"], (-6.0, -2.0, 2.0))
    for sensor in (SENSOR, replace(SENSOR, yaw=0.7, roll=0.05, pitch=-0.03)):
        ours, theirs = (
            ENGINES[name](bullet, grid).cast(sensor, rays(grid)) for name in ("fast", "bullet")
        )
        same = ours[1] == theirs[1]
        assert np.count_nonzero(~same) < 5
        assert len({*ours[1].tolist()}) == 4
        hit = same & np.isfinite(ours[0])
        # Bullet tells surfaces of bodies to a few millimetres.
        off = np.abs(ours[0][hit] - theirs[0][hit])
        assert np.mean(off < 1e-6) > 0.99
        assert off.max() < 0.01


def test_bullet_in_millimetres_answers_the_same_in_random_scenes():
    tally = random_scenes(7, 600, lambda done: None)
    on_bullet, on_exact = tally.verdicts.sum(axis=1)
    assert on_exact.sum() > 12_000
    assert on_exact[[TOLERANCE, UNEXPLAINED]].tolist() == [0, 0]
    assert on_exact[[GRAZING, LOST]].sum() < 1e-3 * on_exact.sum()
    assert on_bullet[UNEXPLAINED] == 0
    assert on_bullet[SAME] > 0.98 * on_bullet.sum()


@pytest.mark.parametrize(
    ("kind", "pose", "distance"),
    [
        ("bus", (30.0, 0.0, 0.0), 30 - 11.19 / 2),
        ("trailer", (20.0, 0.0, np.pi / 2), 20 - 2.55 / 2),
        ("pole", (10.0, 0.09, 1.0), 10 - 0.12),
        ("ball", (8.0, -0.5, 0.0), 8 - np.sqrt(1 - 0.84**2)),
    ],
)
def test_a_body_at_a_known_distance(bullet, kind, pose, distance):
    body = bullet.add(KINDS[kind], pose)
    assert ahead(bullet, SENSOR) == (pytest.approx(distance, abs=1e-12), body)


def test_a_moved_body_is_met_where_it_was_put_and_a_transparent_one_never(bullet):
    bus = bullet.add(CATALOGUE["bus"], (30.0, 0.0, 0.0))
    ego = bullet.add(CATALOGUE["ego"], (5.0, 0.0, 0.0), transparent=True)
    for x in (20.0, 40.0):
        bullet.move(bus, (x, 0.0, 0.0))
        bullet.move(ego, (x / 4, 0.0, 0.2))
        assert ahead(bullet, replace(SENSOR, z=1.0)) == (pytest.approx(x - 11.19 / 2), bus)


def test_nothing_beyond_the_reach(bullet):
    body = bullet.add(CATALOGUE["trailer"], (56.0, 0.0, 0.0))
    assert ahead(bullet, SENSOR)[1] == body
    bullet.move(body, (56.1, 0.0, 0.0))
    assert ahead(bullet, SENSOR) == (np.inf, NO_BODY)


def test_a_part_far_off_its_body_is_met_up_to_the_reach(bullet):
    """A post 10 m behind the middle of its body, with its near side 49.9 and then 50.1 m away."""
    post = Part("box", (1.0, 1.0, 4.0), (-10.0, 0.0, 2.0), GREY)
    body = bullet.add(BodyKind("trailing post", None, (21.0, 1.0, 4.0), (post,)), (60.4, 0.0, 0.0))
    assert ahead(bullet, SENSOR) == (pytest.approx(49.9), body)
    bullet.move(body, (60.6, 0.0, 0.0))
    assert ahead(bullet, SENSOR) == (np.inf, NO_BODY)


def test_the_road_is_met_only_where_there_is_one(bullet):
    sensor = Frame(3.0, -2.0, 1.84, 0.6, roll=0.03, pitch=-0.02)
    fall = -sensor.vectors_to_world(COARSE.directions)[:, 2]
    within = fall * 50.0 >= 1.84
    ranges, ids = cast(bullet, sensor)
    assert np.array_equal(ids, np.where(within, bullet.ground, NO_BODY))
    assert ranges[within] == pytest.approx(1.84 / fall[within], rel=1e-12)
    with closing(BulletWorld(ground=False)) as bare:
        assert np.isinf(cast(bare, sensor)[0]).all()


def test_some_cells_in_any_order_answer_as_in_the_full_scan(bullet):
    bullet.add(CATALOGUE["bus"], (-10.0, 0.0, 0.3))
    bullet.add(CATALOGUE["car"], (8.0, -3.0, 0.5))
    ranges, ids = cast(bullet, SENSOR)
    shuffled = np.random.default_rng(0).permutation(COARSE.size)
    for cells in (shuffled, shuffled[:400], np.sort(shuffled[:400]), shuffled[:0], rays()[::7]):
        some = cast(bullet, SENSOR, cells=cells)
        assert np.array_equal(some[0], ranges[cells])
        assert np.array_equal(some[1], ids[cells])


def test_whole_numbers_in_a_frame_do_no_harm(bullet):
    bullet.add(CATALOGUE["bus"], (10.0, 0.0, 0.3))
    assert np.array_equal(
        cast(bullet, Frame(0, 0, 2, 0))[0], cast(bullet, Frame(0.0, 0.0, 2.0, 0.0))[0]
    )


@pytest.mark.parametrize("shape", ["box", "cylinder", "sphere"])
def test_from_within_a_solid_its_surface_is_not_met(bullet, shape):
    bullet.add(
        BodyKind(
            "hull", None, (6.0, 6.0, 6.0), (Part(shape, (6.0, 6.0, 6.0), (0.0, 0.0, 3.0), GREY),)
        ),
        SENSOR,
    )
    bus = bullet.add(CATALOGUE["bus"], (20.0, 0.0, 0.0))
    assert ahead(bullet, replace(SENSOR, x=0.7, z=2.0)) == (
        pytest.approx(20 - 0.7 - 11.19 / 2),
        bus,
    )


@pytest.mark.parametrize(("aside", "met"), [(1e-9, False), (-1e-9, True)])
def test_an_edge_is_exact_to_a_nanometre(bullet, aside, met):
    bus = bullet.add(CATALOGUE["bus"], (20.0, 0.0, 0.0))
    assert (ahead(bullet, replace(SENSOR, z=3.47 + aside))[1] == bus) == met


@pytest.mark.parametrize("cells", [[-1, 3], [3, 180 * 24]])
def test_cells_that_the_grid_does_not_have_are_refused(bullet, cells):
    with pytest.raises(IndexError, match=r"cells must lie in 0\.\.4319"):
        Fast(bullet, AngularGrid(columns=180, rows=24)).cast(
            Frame(0.0, 0.0, 1.84, 0.0), np.array(cells)
        )


@pytest.mark.parametrize(
    "grid",
    [
        AngularGrid(60, 24, field_of_view=np.deg2rad(120.0)),
        AngularGrid(150, 24, field_of_view=np.deg2rad(300.0), heading=2.5),
        AngularGrid.of_elevations(np.deg2rad([12.0, 3.0, 1.0, 0.5, -1.0, -2.5, -8.0, -25.0]), 180),
    ],
    ids=["forward", "wide and turned", "listed rows"],
)
@pytest.mark.parametrize("sensor", [SENSOR, Frame(1.0, -0.5, 2.2, 2.8, 0.05, -0.1)])
def test_any_grid_is_answered_as_bullet_does(grid, sensor):
    """Bodies all round, some across the edges of the field of view, one around the sensor."""
    frames = [Frame(8 * np.cos(a), 8 * np.sin(a), 0.0, 2 * a) for a in np.arange(0.0, 6.2, 0.4)]
    with closing(BulletWorld()) as world:
        for n, frame in enumerate(frames):
            world.add(KINDS[("car", "pedestrian", "pole", "van")[n % 4]], frame)
        world.add(KINDS["terrace"], Frame(-20.0, -30.0, 0.0, 0.5))
        ranges, ids = cast(world, sensor, grid)
        expected, theirs = ENGINES["bullet"](world, grid).cast(sensor, rays(grid))
    same = ids == theirs
    assert same.mean() > 0.995
    assert ranges[same] == pytest.approx(expected[same], abs=0.01)
    assert len(set(ids.tolist())) > 5

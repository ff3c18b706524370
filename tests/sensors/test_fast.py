"""The engine `fast` held to Bullet's answers, and to ones that can be reckoned by hand.

Bullet finds surfaces by iteration and stops within 1 mm: it widens round parts and edges by as much. Told every
length in millimetres it stops within 1 micrometre: that is the reference here.
"""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import Phase, assume, example, given, settings
from hypothesis import strategies as st

from care_sim.frames import Frame
from care_sim.grid import AngularGrid
from care_sim.sensors.engines import ENGINES
from care_sim.world.bodies import CATALOGUE, BodyKind, Part
from care_sim.world.bullet import NOTHING, BulletWorld

MM = 1000.0
COARSE = AngularGrid(columns=180, rows=24)
SENSOR = Frame(0.0, 0.0, 1.84, 0.0)
GREY = (0.5, 0.5, 0.5)
KINDS = {
    **CATALOGUE,
    "pole": BodyKind("pole", None, (0.3, 0.3, 4.0), (Part("cylinder", (0.3, 0.3, 4.0), (0.0, 0.0, 2.0), GREY),)),
    "drum": BodyKind("drum", None, (3.0, 3.0, 1.0), (Part("cylinder", (3.0, 3.0, 1.0), (1.0, 0.0, 0.5), GREY),)),
    "ball": BodyKind("ball", None, (2.0, 2.0, 2.0), (Part("sphere", (2.0, 2.0, 2.0), (0.0, 0.5, 1.0), GREY),)),
}


def rays(grid=COARSE):
    """Every cell of a grid."""
    return np.arange(grid.size)


def cast(world, sensor, grid=COARSE, cells=None):
    return ENGINES["fast"](world, grid).cast(sensor, rays(grid) if cells is None else cells)


def ahead(world, sensor):
    """Range and body of the level ray along the heading of a frame."""
    grid = AngularGrid(columns=4, rows=3, top=0.5, bottom=-0.5)
    ranges, ids = cast(world, replace(sensor, yaw=sensor.yaw - np.pi / 4), grid, np.array([grid.columns + 2]))
    return float(ranges[0]), int(ids[0])


def in_millimetres(kind):
    def scaled(triple):
        return tuple(MM * value for value in triple)

    parts = tuple(replace(part, size=scaled(part.size), centre=scaled(part.centre)) for part in kind.parts)
    return replace(kind, size=scaled(kind.size), parts=parts)


def reference(bodies, sensor, directions, reach=50.0):
    """Bullet's answer to world `directions` (n, 3) from the origin of `sensor`, reckoned in millimetres."""
    with closing(BulletWorld()) as world:
        for kind, frame in bodies:
            world.add(in_millimetres(kind), replace(frame, x=MM * frame.x, y=MM * frame.y, z=MM * frame.z))
        ranges, ids = world.cast(MM * sensor.origin, directions, MM * reach)
    return ranges / MM, ids


def contested(bodies, sensor, direction, distance, body):
    """Whether Bullet, asked about rays a micrometre aside, gives this answer: the ray grazes an edge, or Bullet lost
    it, which happens inside the faces of tilted bodies.
    """
    aside = np.linalg.svd(direction[None])[2][1:]
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    nudges = np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ aside * 1e-6 / min(distance, 50.0)
    moved = direction + nudges
    ranges, ids = reference(bodies, sensor, moved / np.linalg.norm(moved, axis=1)[:, None])
    return np.any((ids == body) & np.isclose(ranges, distance, rtol=0, atol=1e-3))


@st.composite
def scenes(draw):
    """Up to eight bodies within 60 m of a sensor, which stands in none, standing or turned in any way."""
    near = st.floats(-40.0, 40.0)
    turn = st.one_of(st.just(0.0), st.floats(-1.5, 1.5))
    yaw = st.floats(-3.1, 3.1)
    frames = st.builds(Frame, near, near, st.floats(0.0, 6.0), yaw, turn, turn)
    kinds = st.sampled_from(sorted(set(KINDS) - {"terrace"})).map(KINDS.__getitem__)
    bodies = draw(st.lists(st.tuples(kinds, frames), min_size=1, max_size=8, unique_by=lambda body: body[1]))
    lean = st.one_of(st.just(0.0), st.floats(-0.2, 0.2))
    sensor = draw(st.builds(Frame, near, near, st.floats(0.3, 8.0), yaw, lean, lean))
    assume(not any(holds(kind, frame, sensor.origin) for kind, frame in bodies))
    return bodies, sensor


def holds(kind, frame, point):
    """Whether a point lies in the box around a part: Bullet does not say whether rays from within meet it."""
    local = frame.vectors_to_local(point - frame.origin)
    return any(np.all(np.abs(local - part.centre) <= np.array(part.size) / 2) for part in kind.parts)


def differing(bodies, sensor, grid=COARSE):
    """How many rays Bullet answers otherwise, in body or by a millimetre; each of them must be contested."""
    with closing(BulletWorld()) as world:
        for kind, frame in bodies:
            world.add(kind, frame)
        ranges, ids = cast(world, sensor, grid)
    directions = sensor.vectors_to_world(grid.directions)
    expected, hit = reference(bodies, sensor, directions)
    (differ,) = np.nonzero((ids != hit) | ~np.isclose(ranges, expected, rtol=0, atol=1e-3))
    for ray in differ:
        assert contested(bodies, sensor, directions[ray], ranges[ray], ids[ray])
    return len(differ)


@settings(max_examples=30, phases=(Phase.explicit, Phase.generate))
@given(scenes())
@example(([(KINDS["bus"], Frame(0.0, 0.0, 0.0, 0.0))], Frame(0.3, 0.1, 5.0, 0.0)))
@example(([(KINDS["terrace"], Frame(10.0, 6.0, 0.0, 0.1))], Frame(0.0, 0.0, 1.84, 0.0)))
@example(([(KINDS["drum"], Frame(0.0, 0.0, 1.5, 0.0))], Frame(0.8, 0.1, 1.0, 0.3, 0.1, -0.4)))
def test_bullet_in_millimetres_answers_the_same(scene):
    assert differing(*scene) <= 10


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
    assert ahead(bullet, SENSOR) == (np.inf, NOTHING)


def test_the_road_is_met_only_where_there_is_one(bullet):
    sensor = Frame(3.0, -2.0, 1.84, 0.6, roll=0.03, pitch=-0.02)
    fall = -sensor.vectors_to_world(COARSE.directions)[:, 2]
    within = fall * 50.0 >= 1.84
    ranges, ids = cast(bullet, sensor)
    assert np.array_equal(ids, np.where(within, bullet.ground, NOTHING))
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
    assert np.array_equal(cast(bullet, Frame(0, 0, 2, 0))[0], cast(bullet, Frame(0.0, 0.0, 2.0, 0.0))[0])

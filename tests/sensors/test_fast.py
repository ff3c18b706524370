"""The engine `fast` held to Bullet's answers, and to ones that can be reckoned by hand.

Bullet finds a round part by iteration and stops 1 mm before its surface. Told every length in millimetres it stops
1 micrometre before it: that is the reference here.
"""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given
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
    """The ray of every cell, straight ahead among them in the grid of the hand-built scenes."""
    return np.arange(grid.size)


def cast(world, sensor, grid=COARSE, cells=None):
    return ENGINES["fast"](world, grid).cast(sensor, rays(grid) if cells is None else cells)


def level(columns=4, reach=50.0):
    """A grid whose middle row is level, with a column exactly to the left (its first angle is half a column)."""
    return AngularGrid(columns, 3, 0.5, -0.5, reach)


def ahead(world, sensor):
    """Range and body of one level ray along the frame's diagonal azimuth, turned so that it points along x."""
    grid = level()
    turned = replace(sensor, yaw=sensor.yaw - np.pi / 4)
    ranges, ids = cast(world, turned, grid, np.array([grid.columns + 2]))
    return float(ranges[0]), int(ids[0])


def millimetres(kind):
    def scaled(triple):
        return tuple(MM * value for value in triple)

    parts = tuple(replace(part, size=scaled(part.size), centre=scaled(part.centre)) for part in kind.parts)
    return replace(kind, size=scaled(kind.size), parts=parts)


def enlarged(frame):
    return replace(frame, x=MM * frame.x, y=MM * frame.y, z=MM * frame.z)


def reference(bodies, sensor, directions, reach=50.0):
    """Bullet's answer to world `directions` (n, 3) from the origin of `sensor`, reckoned in millimetres."""
    with closing(BulletWorld()) as world:
        for kind, frame in bodies:
            world.add(millimetres(kind), enlarged(frame))
        ranges, ids = world.cast(MM * sensor.origin, directions, MM * reach)
    return ranges / MM, ids


def grazing(bodies, sensor, direction, distance, body):
    """Whether a ray moved aside by a micrometre at `distance` meets `body` in Bullet's world."""
    aside = np.linalg.svd(direction[None])[2][1:]
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    nudges = np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ aside * 1e-6 / distance
    moved = direction + nudges
    _, ids = reference(bodies, sensor, moved / np.linalg.norm(moved, axis=1)[:, None])
    return body in ids


@st.composite
def scenes(draw):
    """Up to eight bodies within 60 m of a sensor, standing or turned in any way."""
    near = st.floats(-40.0, 40.0)
    turn = st.one_of(st.just(0.0), st.floats(-1.5, 1.5))
    yaw = st.floats(-3.1, 3.1)
    frames = st.builds(Frame, near, near, st.floats(0.0, 6.0), yaw, turn, turn)
    kinds = st.sampled_from(sorted(set(KINDS) - {"terrace"})).map(KINDS.__getitem__)
    bodies = draw(st.lists(st.tuples(kinds, frames), min_size=1, max_size=8))
    lean = st.one_of(st.just(0.0), st.floats(-0.2, 0.2))
    return bodies, draw(st.builds(Frame, near, near, st.floats(0.3, 8.0), yaw, lean, lean))


def check_parity(bodies, sensor, grid=COARSE):
    """Ids equal but for grazing rays, ranges within a millimetre; returns how many rays grazed."""
    with closing(BulletWorld()) as world:
        for kind, frame in bodies:
            world.add(kind, frame)
        ranges, ids = cast(world, sensor, grid)
    directions = sensor.vectors_to_world(grid.directions)
    expected, hit = reference(bodies, sensor, directions)
    same = ids == hit
    for ray in np.flatnonzero(~same):
        distance = min(ranges[ray], expected[ray])
        assert grazing(bodies, sensor, directions[ray], distance, ids[ray])
    found = same & (ids != NOTHING)
    assert np.array_equal(np.isinf(ranges[same]), np.isinf(expected[same]))
    assert np.abs(ranges[found] - expected[found]).max(initial=0.0) < 1e-3
    return int((~same).sum())


@given(scenes())
@example(([(KINDS["drum"], Frame(0.0, 0.0, 2.0, 0.0))], Frame(0.2, 0.1, 1.0, 0.3)))
@example(([(KINDS["bus"], Frame(0.0, 0.0, 0.0, 0.0))], Frame(0.0, 0.0, 5.0, 0.0)))
@example(([(KINDS["terrace"], Frame(10.0, 6.0, 0.0, 0.1))], Frame(0.0, 0.0, 1.84, 0.0)))
def test_bullet_in_millimetres_answers_the_same(scene):
    check_parity(*scene)

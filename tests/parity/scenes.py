"""Engines compared in random scenes: bodies of any kind in any pose around a sensor in any pose,
and rays aimed mostly at the bodies.

The order of the draws decides what a scene of a number is.
"""

from contextlib import closing
from typing import Any, NamedTuple

import numpy as np

from care_sim.core.frames import Frame
from care_sim.core.grid import AngularGrid
from care_sim.core.types import CLASSES
from care_sim.world.bodies import CATALOGUE, BodyKind, Part, sized
from care_sim.world.bullet import BulletWorld
from tests.parity.engines import Engines
from tests.parity.rays import RayCounts, compare, ray_groups

_BODIES = 8
"""Bodies of a scene at the most."""
SCENES_PER_CAST = 100
"""Scenes that share their bodies, each in other places: a world of Bullet takes a while to make."""
SCENE_GRIDS = (
    AngularGrid(),
    AngularGrid(columns=180, rows=24),
    AngularGrid(columns=2048, rows=128, range_m=30.0),
)
_AIMED, _STRAY = 24, 8
"""Rays of a scene towards points in and just around parts, and rays anywhere."""
_AROUND = 1.05
"""The points lie in the box around a part, made larger by this factor."""
_UNCLEAR_M = 0.001
"""Bullet leaves open what a ray meets that starts so close to a surface, or within a sphere."""
AWAY = Frame(1000.0, 1000.0, 0.0, 0.0)
"""Where bodies stand that a scene does not use: beyond the reach of every grid."""


class RandomScene(NamedTuple):
    """`frames` of all bodies, body by body, and `cells` fired from `sensor`."""

    frames: tuple[Frame, ...]
    sensor: Frame
    cells: Any


def random_scenes(seed, number, done):
    """Verdicts on the rays of the first `number` scenes of a seed; `done` is called with the number
    compared so far.
    """
    counts = RayCounts()
    for first in range(0, number, SCENES_PER_CAST):
        some = range(first, min(first + SCENES_PER_CAST, number))
        cast = first // SCENES_PER_CAST
        kinds = draw_bodies(seed, cast)
        grid = SCENE_GRIDS[cast % len(SCENE_GRIDS)]
        with closing(BulletWorld()) as world:
            bodies = [world.add(kind, (0.0, 0.0, 0.0)) for kind in kinds]
            engines = Engines.of(world, grid)
            with closing(engines.exact):
                for scene_number in some:
                    scene = draw_scene(seed, scene_number, kinds, grid)
                    for body, frame in zip(bodies, scene.frames, strict=True):
                        world.move(body, frame)
                    compared = compare(engines, scene.sensor, scene.cells)
                    groups = ray_groups(kinds, scene.frames)
                    counts.add(compared, groups, {"scene": scene_number})
        done(some.stop)
    return counts


def draw_bodies(seed, cast):
    """The bodies that `SCENES_PER_CAST` scenes share: of the catalogue, of another size, or single
    primitives.
    """
    rng = np.random.default_rng((seed, 0, cast))
    return tuple(_draw_kind(rng) for _ in range(_BODIES))


def _draw_kind(rng):
    made = rng.integers(3)
    if made == 0:
        return CATALOGUE[rng.choice(sorted(CATALOGUE))]
    if made == 1:
        label = CLASSES[rng.integers(len(CLASSES))]
        x, y, z = (np.array(CATALOGUE[label].size) * rng.uniform(0.5, 1.5, 3)).tolist()
        return sized(label, label, (x, y, z))
    # From 5 cm to 12 m, every order of size as often.
    x, y, z = np.exp(rng.uniform(np.log(0.05), np.log(12.0), 3)).tolist()
    centre = tuple(rng.uniform(-1.0, 1.0, 3).tolist())
    shapes = ("box", (x, y, z)), ("cylinder", (x, x, z)), ("sphere", (x, x, x))
    shape, size = shapes[rng.integers(3)]
    return BodyKind(shape, None, size, (Part(shape, size, centre, (0.5, 0.5, 0.5)),))


def draw_scene(seed, number, kinds, grid):
    """The scene of a number: some of the bodies anywhere, the first of them in a place that is hard
    for an engine.
    """
    rng = np.random.default_rng((seed, 1, number))
    while _is_unclear(scene := _draw_scene(rng, kinds, grid), kinds):
        pass
    return scene


def _draw_scene(rng, kinds, grid):
    # In half of the scenes the sensor leans, by up to 11 degrees; in half the bodies are tilted, by
    # up to 86.
    lean = 0.2 if rng.random() < 0.5 else 0.0
    sensor = Frame(*_place(rng), float(rng.uniform(0.3, 6.0)), *_turn(rng, lean))
    tilt = 1.5 if rng.random() < 0.5 else 0.0
    used = int(rng.integers(1, _BODIES + 1))
    frames = [
        Frame(*_place(rng), float(rng.uniform(0.0, 4.0)) if tilt else 0.0, *_turn(rng, tilt))
        for _ in range(used)
    ]

    # The first body goes where engines are most likely to differ: its point `here` comes to the
    # sensor's point `there`.
    here, there = _SITUATIONS[rng.integers(len(_SITUATIONS))](rng, kinds[0].parts[0], grid)
    first = frames[0]
    world = sensor.origin + sensor.vectors_to_world(there)
    x, y, z = (world - first.vectors_to_world(here)).tolist()
    frames[0] = Frame(x, y, z, first.yaw, first.roll, first.pitch)

    # Ascending cells: those of points in and around the bodies, and some anywhere.
    points = []
    for body in rng.integers(used, size=_AIMED):
        part = kinds[body].parts[rng.integers(len(kinds[body].parts))]
        points.append(
            frames[body].origin + frames[body].vectors_to_world(_within(rng, part, _AROUND))
        )
    cells = grid.cells_of(sensor.vectors_to_local(np.array(points) - sensor.origin))
    stray = rng.integers(grid.size, size=_STRAY)
    cells = np.unique(np.concatenate([cells[cells >= 0], stray]))
    return RandomScene((*frames, *[AWAY] * (_BODIES - used)), sensor, cells)


def _is_unclear(scene, kinds):
    """Whether rays start where Bullet's answer means nothing."""
    for kind, frame in zip(kinds, scene.frames, strict=True):
        sensor = frame.vectors_to_local(scene.sensor.origin - frame.origin)
        for part in kind.parts:
            outside = _outside(part, sensor - part.centre)
            if outside <= _UNCLEAR_M and (part.shape == "sphere" or outside >= -_UNCLEAR_M):
                return True
    return False


def _outside(part, point):
    """How far a point is beyond the surface of a part at the origin; negative within it."""
    half = np.array(part.size) / 2
    if part.shape == "sphere":
        return float(np.linalg.norm(point) - half[0])
    if part.shape == "cylinder":
        return float(max(np.hypot(point[0], point[1]) - half[0], abs(point[2]) - half[2]))
    return float(np.max(np.abs(point) - half))


def _place(rng):
    x, y = rng.uniform(-30.0, 30.0, 2).tolist()
    return x, y


def _turn(rng, most):
    yaw, roll, pitch = (rng.uniform(-1.0, 1.0, 3) * (np.pi, most, most)).tolist()
    return yaw, roll, pitch


def _within(rng, part, share):
    """A point of the box around a part, which is enlarged by the factor `share`."""
    return np.array(part.centre) + share * np.array(part.size) / 2 * rng.uniform(-1.0, 1.0, 3)


def _surface(rng, part, gap):
    """A point `gap` metres outside a face of the box around a part."""
    point = _within(rng, part, 1.0)
    axis = rng.integers(3)
    side = rng.choice((-1.0, 1.0))
    point[axis] = part.centre[axis] + side * (part.size[axis] / 2 + gap)
    return point


def _anywhere(rng, part, grid):
    return np.array(part.centre), np.append(rng.uniform(-25.0, 25.0, 2), rng.uniform(-3.0, 3.0))


def _overhead(rng, part, grid):
    height = rng.choice((-1.0, 1.0)) * (max(part.size) / 2 + rng.uniform(0.0, 3.0))
    return np.array(part.centre), np.append(rng.uniform(-2.0, 2.0, 2), height)


def _behind(rng, part, grid):
    """Behind the sensor, on the seam between the first and the last column."""
    reach = max(part.size) + rng.uniform(0.0, 20.0)
    return np.array(part.centre), np.array([-reach, rng.uniform(-0.5, 0.5), rng.uniform(-3.0, 3.0)])


def _at_the_reach(rng, part, grid):
    ray = grid.directions[rng.integers(grid.size)]
    return _surface(rng, part, 0.0), ray * (grid.range_m + rng.uniform(-0.5, 0.5))


def _touching(rng, part, grid):
    """The sensor 1 mm to 10 cm before a face of the box around a part."""
    return _surface(rng, part, 10 ** rng.uniform(-3.0, -1.0)), np.zeros(3)


def _inside(rng, part, grid):
    return _within(rng, part, 1.0), np.zeros(3)


_SITUATIONS = (_anywhere, _overhead, _behind, _at_the_reach, _touching, _inside)
"""Each gives a point of a body's frame, and where it shall be in the sensor's."""

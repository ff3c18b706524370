"""Random scenes: bodies in any pose around a sensor in any pose, and rays aimed mostly at the
bodies.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from care_sim.core.frames import Floats, Frame
from care_sim.core.grid import AngularGrid, Cells
from care_sim.measure.parity.bodies import draw_kind
from care_sim.world.bodies import BodyKind, Part

BODIES = 8
SCENES_A_CAST = 100
"""Scenes in which the same bodies stand otherwise: a world of Bullet is not made in a moment."""
GRIDS = (
    AngularGrid(),
    AngularGrid(columns=180, rows=24),
    AngularGrid(columns=2048, rows=128, range_m=30.0),
)
AIMED, STRAY = 24, 8
"""Rays of a scene towards points in and just around parts, and anywhere."""
AROUND = 1.05
UNCLEAR_M = 0.001
"""Bullet does not say what a ray meets that starts so close to a surface, or within a sphere."""
AWAY = Frame(1000.0, 1000.0, 0.0, 0.0)
"""Where bodies wait that a scene does not use."""


@dataclass(frozen=True)
class Scene:
    """`frames` of all bodies, body by body, and `cells` fired from `sensor`."""

    frames: tuple[Frame, ...]
    sensor: Frame
    cells: Cells


def draw_bodies(seed: int, cast: int) -> tuple[BodyKind, ...]:
    """The bodies that `SCENES_A_CAST` scenes share."""
    rng = np.random.default_rng((seed, 0, cast))
    return tuple(draw_kind(rng) for _ in range(BODIES))


def draw_scene(seed: int, number: int, kinds: tuple[BodyKind, ...], grid: AngularGrid) -> Scene:
    """The scene of a number: some of the bodies anywhere, the first of them in a place that asks
    for care.
    """
    rng = np.random.default_rng((seed, 1, number))
    while _is_unclear(scene := _draw_scene(rng, kinds, grid), kinds):
        pass
    return scene


def _draw_scene(rng: np.random.Generator, kinds: tuple[BodyKind, ...], grid: AngularGrid) -> Scene:
    lean = 0.2 if rng.random() < 0.5 else 0.0
    sensor = Frame(*_place(rng), float(rng.uniform(0.3, 6.0)), *_turn(rng, lean))
    tilt, used = 1.5 if rng.random() < 0.5 else 0.0, int(rng.integers(1, BODIES + 1))
    frames = [_stand(rng, tilt) for _ in range(used)]
    situation = SITUATIONS[rng.integers(len(SITUATIONS))]
    here, there = situation(rng, kinds[0].parts[0], grid)
    frames[0] = _put(frames[0], here, sensor.origin + sensor.vectors_to_world(there))
    everything = (*frames, *[AWAY] * (BODIES - used))
    return Scene(everything, sensor, _aim(rng, kinds[:used], frames, sensor, grid))


def _is_unclear(scene: Scene, kinds: tuple[BodyKind, ...]) -> bool:
    for kind, frame in zip(kinds, scene.frames, strict=True):
        sensor = frame.vectors_to_local(scene.sensor.origin - frame.origin)
        for part in kind.parts:
            outside = _outside(part, sensor - part.centre)
            if outside <= UNCLEAR_M and (part.shape == "sphere" or outside >= -UNCLEAR_M):
                return True
    return False


def _outside(part: Part, point: Floats) -> float:
    """How far a point is beyond the surface of a part at the origin; negative within it."""
    half = np.array(part.size) / 2
    if part.shape == "sphere":
        return float(np.linalg.norm(point) - half[0])
    if part.shape == "cylinder":
        return float(max(np.hypot(point[0], point[1]) - half[0], abs(point[2]) - half[2]))
    return float(np.max(np.abs(point) - half))


def _place(rng: np.random.Generator) -> tuple[float, float]:
    x, y = rng.uniform(-30.0, 30.0, 2).tolist()
    return x, y


def _turn(rng: np.random.Generator, most: float) -> tuple[float, float, float]:
    yaw, roll, pitch = (rng.uniform(-1.0, 1.0, 3) * (np.pi, most, most)).tolist()
    return yaw, roll, pitch


def _stand(rng: np.random.Generator, tilt: float) -> Frame:
    return Frame(*_place(rng), float(rng.uniform(0.0, 4.0)) if tilt else 0.0, *_turn(rng, tilt))


def _put(frame: Frame, here: Floats, world: Floats) -> Frame:
    """The frame, turned as it is, that has its point `here` at the point `world`."""
    x, y, z = (world - frame.vectors_to_world(here)).tolist()
    return Frame(x, y, z, frame.yaw, frame.roll, frame.pitch)


Situation = Callable[[np.random.Generator, Part, AngularGrid], tuple[Floats, Floats]]
"""A point of a body's frame, and where it shall be in the sensor's."""


def _anywhere(rng: np.random.Generator, part: Part, grid: AngularGrid) -> tuple[Floats, Floats]:
    return np.array(part.centre), np.append(rng.uniform(-25.0, 25.0, 2), rng.uniform(-3.0, 3.0))


def _overhead(rng: np.random.Generator, part: Part, grid: AngularGrid) -> tuple[Floats, Floats]:
    height = rng.choice((-1.0, 1.0)) * (max(part.size) / 2 + rng.uniform(0.0, 3.0))
    return np.array(part.centre), np.append(rng.uniform(-2.0, 2.0, 2), height)


def _behind(rng: np.random.Generator, part: Part, grid: AngularGrid) -> tuple[Floats, Floats]:
    """On the seam between the first and the last column."""
    reach = max(part.size) + rng.uniform(0.0, 20.0)
    return np.array(part.centre), np.array([-reach, rng.uniform(-0.5, 0.5), rng.uniform(-3.0, 3.0)])


def _at_the_reach(rng: np.random.Generator, part: Part, grid: AngularGrid) -> tuple[Floats, Floats]:
    ray = grid.directions[rng.integers(grid.size)]
    return _surface(rng, part, 0.0), ray * (grid.range_m + rng.uniform(-0.5, 0.5))


def _touching(rng: np.random.Generator, part: Part, grid: AngularGrid) -> tuple[Floats, Floats]:
    """The sensor 1 mm to 10 cm before a face of the box around a part."""
    return _surface(rng, part, 10 ** rng.uniform(-3.0, -1.0)), np.zeros(3)


def _inside(rng: np.random.Generator, part: Part, grid: AngularGrid) -> tuple[Floats, Floats]:
    return _within(rng, part, 1.0), np.zeros(3)


SITUATIONS: tuple[Situation, ...] = (
    _anywhere,
    _overhead,
    _behind,
    _at_the_reach,
    _touching,
    _inside,
)


def _within(rng: np.random.Generator, part: Part, share: float) -> Floats:
    return np.array(part.centre) + share * np.array(part.size) / 2 * rng.uniform(-1.0, 1.0, 3)


def _surface(rng: np.random.Generator, part: Part, gap: float) -> Floats:
    """A point `gap` metres outside a face of the box around a part."""
    point, axis, side = _within(rng, part, 1.0), rng.integers(3), rng.choice((-1.0, 1.0))
    point[axis] = part.centre[axis] + side * (part.size[axis] / 2 + gap)
    return point


def _aim(
    rng: np.random.Generator,
    kinds: tuple[BodyKind, ...],
    frames: list[Frame],
    sensor: Frame,
    grid: AngularGrid,
) -> Cells:
    """Ascending cells."""
    points = []
    for body in rng.integers(len(kinds), size=AIMED):
        part = kinds[body].parts[rng.integers(len(kinds[body].parts))]
        points.append(
            frames[body].origin + frames[body].vectors_to_world(_within(rng, part, AROUND))
        )
    cells = grid.cells_of(sensor.vectors_to_local(np.array(points) - sensor.origin))
    stray = rng.integers(grid.size, size=STRAY)
    return np.unique(np.concatenate([cells[cells >= 0], stray]))

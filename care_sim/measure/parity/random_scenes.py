"""Engines compared in random scenes."""

from collections.abc import Callable
from contextlib import closing

from care_sim.measure.parity.answers import Millimetres
from care_sim.measure.parity.scenes import SCENE_GRIDS, SCENES_PER_CAST, draw_bodies, draw_scene
from care_sim.measure.parity.tally import AgreementCounts, ray_groups
from care_sim.measure.parity.verdicts import Engines, compare
from care_sim.sensors.engines import ENGINES
from care_sim.world.bullet import BulletWorld


def random_scenes(seed: int, number: int, done: Callable[[int], None]) -> AgreementCounts:
    """Verdicts on the rays of the first `number` scenes of a seed; `done` is called with
    the number compared so far.
    """
    tally = AgreementCounts()
    for first in range(0, number, SCENES_PER_CAST):
        some = range(first, min(first + SCENES_PER_CAST, number))
        _compare_scenes(seed, some, tally)
        done(some.stop)
    return tally


def _compare_scenes(seed: int, numbers: range, tally: AgreementCounts) -> None:
    """Compare scenes that share their bodies; `numbers` lie within one cast."""
    cast = numbers.start // SCENES_PER_CAST
    kinds = draw_bodies(seed, cast)
    grid = SCENE_GRIDS[cast % len(SCENE_GRIDS)]
    with closing(BulletWorld()) as world, closing(Millimetres(kinds, grid)) as exact:
        bodies = [world.add(kind, (0.0, 0.0, 0.0)) for kind in kinds]
        engines = Engines(ENGINES["fast"](world, grid), ENGINES["bullet"](world, grid), exact)
        for number in numbers:
            scene = draw_scene(seed, number, kinds, grid)
            for body, frame in zip(bodies, scene.frames, strict=True):
                world.move(body, frame)
            exact.place(scene.frames)
            compared = compare(engines, scene.sensor, scene.cells)
            tally.add(compared, ray_groups(kinds, scene.frames), {"scene": number})

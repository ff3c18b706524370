"""Engines compared in random scenes."""

from collections.abc import Callable
from contextlib import closing

from care_sim.core.grid import AngularGrid
from care_sim.measure.parity.answers import Millimetres
from care_sim.measure.parity.scenes import GRIDS, SCENES_A_CAST, draw_bodies, draw_scene
from care_sim.measure.parity.tally import AgreementCounts, groups
from care_sim.measure.parity.verdicts import Engines, compare
from care_sim.sensors.engines import ENGINES
from care_sim.world.bodies import BodyKind
from care_sim.world.bullet import BulletWorld


def random_scenes(seed: int, number: int, done: Callable[[int], None]) -> AgreementCounts:
    """Verdicts on the rays of the first `number` scenes of a seed; `done` hears how many are
    compared.
    """
    tally = AgreementCounts()
    for first in range(0, number, SCENES_A_CAST):
        some = range(first, min(first + SCENES_A_CAST, number))
        compare_scenes(seed, some, tally)
        done(some.stop)
    return tally


def compare_scenes(seed: int, numbers: range, tally: AgreementCounts) -> None:
    """Compare scenes that share their bodies."""
    cast = numbers.start // SCENES_A_CAST
    kinds, grid = draw_bodies(seed, cast), GRIDS[cast % len(GRIDS)]
    with closing(BulletWorld()) as world, closing(Millimetres(kinds, grid)) as exact:
        bodies = [world.add(kind, (0.0, 0.0, 0.0)) for kind in kinds]
        engines = Engines(ENGINES["fast"](world, grid), ENGINES["bullet"](world, grid), exact)
        for number in numbers:
            _compare_scene(seed, number, kinds, grid, (world, bodies, engines, exact), tally)


def _compare_scene(
    seed: int,
    number: int,
    kinds: tuple[BodyKind, ...],
    grid: AngularGrid,
    stage: tuple[BulletWorld, list[int], Engines, Millimetres],
    tally: AgreementCounts,
) -> None:
    world, bodies, engines, exact = stage
    scene = draw_scene(seed, number, kinds, grid)
    for body, frame in zip(bodies, scene.frames, strict=True):
        world.move(body, frame)
    exact.place(scene.frames)
    compared = compare(engines, scene.sensor, scene.cells)
    tally.add(compared, groups(kinds, scene.frames), {"scene": number})

"""How much of an entry's score is the camera's? The suite again, with a camera that sees nothing.

    python docs/examples/blind_camera.py results/leaderboard/care-sector.json ... place.json

The last file is the entry over which the leads are told. About two minutes an entry on two cores;
what is finished stays in `runs/blind-camera`, and the same command goes on.
"""

import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from care_sim.base.errors import InvalidInput
from care_sim.study.benchmark.player import Player, player_in
from care_sim.study.benchmark.result import BenchmarkResult, ResultRow
from care_sim.study.benchmark.result_file import read_result
from care_sim.study.benchmark.tasks import MEASURED, Entry, Task, configurations
from care_sim.study.benchmark.worlds import PARTS, World, published_worlds

BLIND = "blind"
WORKERS = 2


def blind_tasks(entry: Entry, worlds: Sequence[World]) -> list[Task]:
    """The entry in every world, where the camera misses every object."""
    tasks = []
    for part in PARTS:
        own = [world for world in worlds if world.part == part]
        given = {"false_negative_rate": 1.0, **entry.conditions}
        configs = configurations(part, [world.seed for world in own], entry.policy, **given)
        tasks += [Task(world, BLIND, config) for world, config in zip(own, configs, strict=True)]
    return tasks


def blinded(
    results: Sequence[BenchmarkResult], worlds: Sequence[World], player: Player
) -> list[BenchmarkResult]:
    """What the same entries reach in `worlds` without a camera."""
    tasks = [blind_tasks(result.entry, worlds) for result in results]
    # All at once, so that the entries share the film of a street.
    rows = iter(player.rows([task.config for own in tasks for task in own]))
    played = [[(task, next(rows)) for task in own] for own in tasks]
    if player.failures:
        raise SystemExit(f"{len(player.failures)} plays failed: {player.failures[0]}")
    return [
        replace(result, rows=tuple(ResultRow.of(task, row) for task, row in own if row))
        for result, own in zip(results, played, strict=True)
    ]


def as_measured(blind: BenchmarkResult) -> BenchmarkResult:
    """Its rows where those under the measured camera stand, so that the two pair by world."""
    return replace(blind, rows=tuple(row._replace(camera=MEASURED) for row in blind.rows))


def main(files: Sequence[str]) -> None:
    """Play and print, in percent and points."""
    if not files:
        raise SystemExit("give the result files of one entry or more")
    try:
        seeing = [read_result(Path(file)) for file in files]
    except InvalidInput as error:
        raise SystemExit(str(error)) from None
    with player_in(Path("runs/blind-camera"), WORKERS) as player:
        blind = blinded(seeing, published_worlds(), player)
    print("| | score | blind | the camera's | blind, minus the last | drives | tests | streets |")
    print("|---|---|---|---|---|---|---|---|")
    unseeing = [as_measured(result) for result in blind]
    for own, dark in zip(seeing, unseeing, strict=True):
        intervals = [own.score(), dark.score(), own.lead(dark), dark.lead(unseeing[-1])]
        told = ["{:.1f} [{:.1f}, {:.1f}]".format(*interval) for interval in intervals]
        parts = [f"{dark.part_score(part):.1f}" for part in PARTS]
        print("|", " | ".join([own.entry.name, *told, *parts]), "|")


if __name__ == "__main__":
    main(sys.argv[1:])

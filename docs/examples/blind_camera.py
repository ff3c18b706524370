"""How much of an entry's score is the camera's? The suite again, with a camera that sees nothing.

    python docs/examples/blind_camera.py results/data/leaderboard/care-sector.json ... place.json

The last file is the entry over which the leads are told. About two minutes an entry on two cores;
what is finished stays in `runs/blind-camera`, and the same command goes on. Every play is a row of
`plays.csv` there. Such a table before the files is read in the place of playing.
"""

import csv
import sys
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from care_sim.base.errors import InvalidInput
from care_sim.base.files import replacing
from care_sim.study.benchmark.play import Player, player_in
from care_sim.study.benchmark.result import BenchmarkResult, ResultRow, read_result
from care_sim.study.benchmark.suite import BLIND, MEASURED, PARTS, World, published_worlds, tasks_of

FOLDER = Path("runs/blind-camera")
WORKERS = 2


def blinded(
    results: Sequence[BenchmarkResult], worlds: Sequence[World], player: Player
) -> list[BenchmarkResult]:
    """What the same entries reach in `worlds` with a blind camera."""
    tasks = [tasks_of(result.entry, worlds, [BLIND]) for result in results]
    # All at once, so that the entries share the film of a street.
    rows = iter(player.rows([task.config for own in tasks for task in own]))
    played = [[(task, next(rows)) for task in own] for own in tasks]
    if player.failures:
        raise SystemExit(f"{len(player.failures)} plays failed: {player.failures[0]}")
    return [
        replace(result, rows=tuple(ResultRow.of(task, row) for task, row in own if row))
        for result, own in zip(results, played, strict=True)
    ]


def write_plays(path: Path, blind: Sequence[BenchmarkResult]) -> None:
    """A row a play."""
    rows = [(result.entry.full_name, *row) for result in blind for row in result.rows]
    with replacing(path) as unfinished, unfinished.open("w", newline="") as file:
        csv.writer(file).writerows([("entry", *ResultRow._fields), *rows])


def read_plays(path: Path, results: Sequence[BenchmarkResult]) -> list[BenchmarkResult]:
    """What a table says that the same entries reach."""
    rows = defaultdict(list)
    with path.open(newline="") as file:
        for entry, part, camera, world, reached, reachable, made in list(csv.reader(file))[1:]:
            numbers = int(world), int(reached), int(reachable)
            rows[entry].append(ResultRow(part, camera, *numbers, made))
    names = [result.entry.full_name for result in results]
    if lacking := [name for name in names if name not in rows]:
        raise SystemExit(f"{path} has no plays of {', '.join(lacking)}")
    return [replace(own, rows=tuple(rows[name])) for own, name in zip(results, names, strict=True)]


def as_measured(blind: BenchmarkResult) -> BenchmarkResult:
    """Its rows where those under the measured camera stand, so that the two pair by world."""
    return replace(blind, rows=tuple(row._replace(camera=MEASURED) for row in blind.rows))


def table(seeing: Sequence[BenchmarkResult], blind: Sequence[BenchmarkResult]) -> list[str]:
    """The lines of a table, in percent and points; leads are over the last, bold where the interval
    excludes zero.
    """
    unseeing = [as_measured(result) for result in blind]
    lines = [
        "| | score | blind | the camera's | blind, minus the last | drives | tests | streets |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for own, dark in zip(seeing, unseeing, strict=True):
        lead = dark.lead(unseeing[-1])
        intervals = [dark.score(), own.lead(dark), lead]
        told = ["{:.1f} [{:.1f}, {:.1f}]".format(*interval) for interval in intervals]
        if lead.low > 0 or lead.high < 0:
            told[-1] = f"**{told[-1]}**"
        parts = [f"{dark.part_score(part):.1f}" for part in PARTS]
        cells = [own.entry.name, f"{own.score().mean:.1f}", *told, *parts]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def main(files: Sequence[str]) -> None:
    """Play or read, and print."""
    told = [file for file in files[:1] if Path(file).suffix == ".csv"]
    if len(files) == len(told):
        raise SystemExit("give the result files of one entry or more")
    try:
        seeing = [read_result(Path(file)) for file in files[len(told) :]]
    except InvalidInput as error:
        raise SystemExit(str(error)) from None
    if told:
        blind = read_plays(Path(told[0]), seeing)
    else:
        with player_in(FOLDER, WORKERS) as player:
            blind = blinded(seeing, published_worlds(), player)
        write_plays(FOLDER / "plays.csv", blind)
    print("\n".join(table(seeing, blind)))


if __name__ == "__main__":
    main(sys.argv[1:])

"""Entries play the benchmark."""

from collections.abc import Sequence

from care_sim.policies import tags_of
from care_sim.study.benchmark.made_by import made_by
from care_sim.study.benchmark.player import Player
from care_sim.study.benchmark.result import BenchmarkResult, ResultRow
from care_sim.study.benchmark.tasks import Entry, tasks_of
from care_sim.study.benchmark.worlds import World


def played(
    entries: Sequence[Entry],
    worlds: Sequence[World],
    player: Player,
    quick: bool = False,
    sealed: str | None = None,
) -> list[BenchmarkResult]:
    """The results of the entries that finished every task, in their order.

    Raises InvalidInput for an entry that cannot be made.
    """
    tasks = {entry: tasks_of(entry, worlds) for entry in entries}
    # All at once, so that the entries share the film of a street, which takes longer than a play.
    configs = [task.config for own in tasks.values() for task in own]
    row_of = dict(zip(configs, player.rows(configs), strict=True))
    results = []
    for entry, own in tasks.items():
        rows = [(task, row_of[task.config]) for task in own]
        if all(row for _, row in rows):
            kept = tuple(ResultRow.of(task, row) for task, row in rows if row)
            results.append(
                BenchmarkResult(entry, tags_of(entry.policy), kept, quick, sealed, made_by(entry))
            )
    return results

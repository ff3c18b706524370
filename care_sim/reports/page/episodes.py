"""The episodes of a page: those played again, and whether they equal the results."""

import math
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor, Future, as_completed
from dataclasses import dataclass

from care_sim.reports.page.played_rows import config_of, in_open_loop, play_config_of
from care_sim.reports.page.replay import Replay, replayed
from care_sim.sources.scenes import Source
from care_sim.study.episode_play import result_or_reason
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.progress import shown_progress
from care_sim.study.run_config import FULL, Row
from care_sim.study.runner import DIED

_TOLERANCE = 1e-6
"""Machines of different kinds may differ in the last bits."""


@dataclass(frozen=True)
class Episode:
    """A row of the results and its replay, or in one line why there is none."""

    row: Row
    ending: Replay | str

    @property
    def replay(self) -> Replay | None:
        """None of an episode that could not be played."""
        return self.ending if isinstance(self.ending, Replay) else None

    @property
    def identical(self) -> bool:
        """Whether the replay fired, measured and moved as the episode did (its hash), and ends as
        the row does.
        """
        # Both are asked for: the hash holds what happened, the outcomes how it was scored.
        if self.replay is None or self.differences:
            return False
        return bool(self.replay.row["episode_hash"] == self.row.get("episode_hash"))

    @property
    def differences(self) -> list[str]:
        """The outcomes in which the replay departs from the row, each as NAME THEN -> NOW."""
        if self.replay is None:
            return []
        # Older files lack the later columns.
        told = [name for name in self.replay.ending if name in self.row]
        pairs = {name: (self.row[name], self.replay.row[name]) for name in told}
        return [
            f"{name} {_text(was)} → {_text(now)}"
            for name, (was, now) in pairs.items()
            if not _equal(was, now)
        ]


def episodes_to_watch(rows: Sequence[Row], most: int) -> list[Row]:
    """Return at most this many rows: all of the first seed, in the open loop of the first scene,
    then of the next. So policies can be watched side by side. Within a scene the full scan comes
    first, then budget by budget.
    """
    scenes = {name: n for n, name in enumerate(dict.fromkeys(row.get("scene") for row in rows))}

    def turn(row: Row) -> tuple[float, ...]:
        if not in_open_loop(row):
            return (row["seed"],)
        budget = 0.0 if row["policy"] == FULL else row["budget"]
        return row["floor_seed"], scenes[row["scene"]], budget

    # The sort is stable: what comes at one turn keeps its order.
    return sorted(rows, key=turn)[:most]


def replay_episodes(
    rows: Sequence[Row],
    workers: int,
    make_executor: ExecutorFactory = processes,
    source: Source | None = None,
) -> list[Episode]:
    """Play the episodes of rows again, in processes, and show on stderr how far they are. `source`
    is where the scenes of recordings are found. An interrupt does not wait for episodes that have
    not begun.
    """
    if not rows:
        return []
    executor = make_executor(min(workers, len(rows)))
    try:
        # Each by itself: what was played before the death of a worker stays.
        futures = [executor.submit(result_or_reason, _replay_of, row, source) for row in rows]
        with shown_progress(len(rows), "episodes") as show:
            for done, _ in enumerate(as_completed(futures), 1):
                show(done, "")
        return [Episode(row, _ending(future)) for row, future in zip(rows, futures, strict=True)]
    finally:
        # After an interrupt the episodes that wait are not begun. Episodes that are being played
        # end first.
        executor.shutdown(cancel_futures=True)


def _replay_of(row: Row, source: Source | None) -> Replay:
    return replayed(play_config_of(row, source) if in_open_loop(row) else config_of(row))


def _ending(future: Future[Replay | str]) -> Replay | str:
    try:
        return future.result()
    except BrokenExecutor:
        return DIED


def _equal(was: object, now: object) -> bool:
    if isinstance(was, float) and isinstance(now, float):
        return math.isclose(was, now, rel_tol=_TOLERANCE, abs_tol=_TOLERANCE)
    return was == now


def _text(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else "none" if value is None else f"{value}"

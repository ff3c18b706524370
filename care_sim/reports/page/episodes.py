"""The episodes of a page: which are played again, and whether they go as they did when the results
were made.
"""

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Future, as_completed
from dataclasses import dataclass

from care_sim.loops.records import Outcome
from care_sim.reports.page.replay import Replay, replayed
from care_sim.sensors.setups import setup_of_columns
from care_sim.study.episode_config import PLAIN_FIELDS, EpisodeConfig
from care_sim.study.episode_play import result_or_reason
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.parameters import Parameters
from care_sim.study.progress import Show, rounded_duration, shown_progress
from care_sim.study.run_config import Row
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
        pairs = {
            name: (self.row[name], self.replay.row[name]) for name in Outcome.__dataclass_fields__
        }
        return [
            f"{name} {_text(was)} → {_text(now)}"
            for name, (was, now) in pairs.items()
            if not _equal(was, now)
        ]


def episodes_to_watch(rows: Sequence[Row], most: int) -> list[Row]:
    """At most so many rows: all of the first seed, then those of the next, so that policies can be
    seen side by side.
    """
    # The sort is stable: within a seed the rows keep their order.
    return sorted(rows, key=lambda row: row["seed"])[:most]


def played_again(
    rows: Sequence[Row], workers: int, make_executor: ExecutorFactory = processes
) -> list[Episode]:
    """Play the episodes of rows again, in processes, and show on stderr how far they are. An
    interrupt does not wait for episodes that have not begun.
    """
    if not rows:
        return []
    executor = make_executor(min(workers, len(rows)))
    try:
        # Each by itself: what was played before the death of a worker stays.
        futures = [executor.submit(result_or_reason, _replay_of, row) for row in rows]
        with shown_progress(len(rows), "episodes") as show:
            follow(futures, show)
        return [Episode(row, _ending(future)) for row, future in zip(rows, futures, strict=True)]
    finally:
        # After an interrupt the episodes that wait are not begun. Those that are being played end
        # first.
        executor.shutdown(cancel_futures=True)


def follow(
    futures: Sequence[Future[Replay | str]],
    show: Show,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Wait for all, and show how many have ended and how long the others should take."""
    started = clock()
    for done, _ in enumerate(as_completed(futures), 1):
        left_s = (clock() - started) / done * (len(futures) - done)
        show(done, f"{rounded_duration(left_s)} left")


def config_of(row: Row) -> EpisodeConfig:
    """The configuration that a row was played with. Raises InvalidInput for one that this version
    does not accept, and for a sensor set-up that is neither told nor comes with it.
    """
    # A condition that the file's version did not know, or the row does not tell, is the default.
    plain = {name: row[name] for name in PLAIN_FIELDS if row.get(name) is not None}
    for name in ("detector", "keyframe_s"):
        if row.get(name) is not None:
            plain[name] = row[name]
    plain["sensor"] = setup_of_columns(row)
    for kind in ("detector", "scenario", "policy"):
        plain[f"{kind}_parameters"] = _parameters(row, kind)
    return EpisodeConfig(**plain)


def _parameters(row: Row, kind: str) -> Parameters:
    named = (
        (name.removeprefix(f"{kind}."), value)
        for name, value in row.items()
        if name.startswith(f"{kind}.")
    )
    # A column holds nothing in the rows whose scenario or policy lacks the parameter.
    return tuple((name, value) for name, value in named if value is not None)


def _replay_of(row: Row) -> Replay:
    return replayed(config_of(row))


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

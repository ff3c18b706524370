"""Plays of the benchmark: entries, the screening of worlds, and replays of results.

The screening decides which worlds count: those in which sensing decides something. A drive or a
test counts where a car that detects nothing collides and the full scan does not: what lies between
them is left to the choice of cells. A street counts with the first sightings that the full scan
finds at once. Two plays decide, and none of a policy that is scored.

A replay checks that a result is what its policy does: it plays a random tenth of the episodes
again.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from random import Random

from care_sim.base.errors import InvalidInput
from care_sim.policies import tags_of
from care_sim.study.benchmark.result import BenchmarkResult, ResultRow, is_made_alike, made_by
from care_sim.study.benchmark.suite import (
    IDEAL,
    MEASURED,
    PARTS,
    SIZES,
    STREETS,
    Entry,
    Salt,
    Task,
    World,
    candidates,
    configurations,
    publish_worlds,
    reached,
    tasks_of,
)
from care_sim.study.executors import ExecutorFactory, processes
from care_sim.study.journal import Journal
from care_sim.study.play_config import PlayConfig
from care_sim.study.progress import run_with_progress
from care_sim.study.results_formats import EPISODES, PLAYS
from care_sim.study.run_config import FULL, Row, RunConfig
from care_sim.study.runner import Failure

BENCHMARK_JOURNAL = "benchmark.jsonl"
"""Not the journal of a study, which a folder may hold too."""
_STUDY = "benchmark"


class Player:
    """Plays what its journal does not hold yet; `failures` are the tasks that did not finish."""

    def __init__(self, journal: Journal, workers: int, make_executor: ExecutorFactory):
        self.failures: list[Failure] = []
        self._journal = journal
        self._workers = workers
        self._make_executor = make_executor

    def rows(self, configs: Sequence[RunConfig]) -> list[Row | None]:
        """The row of every configuration; None of one that failed."""
        # A copy has no key yet: its digest is of the code as it is when this run asks for it.
        asked = {config: config.changed() for config in configs}
        plays = [own for own in asked.values() if isinstance(own, PlayConfig)]
        episodes = [own for own in asked.values() if not isinstance(own, PlayConfig)]
        for kind, own in ((EPISODES, episodes), (PLAYS, plays)):
            if own:
                self.failures += run_with_progress(
                    own, self._journal, self._workers, self._make_executor, kind
                )
        found = {row["digest"]: row for row in self._journal.rows}
        return [found.get(asked[config].key) for config in configs]


@contextmanager
def player_in(
    folder: Path, workers: int, make_executor: ExecutorFactory = processes
) -> Iterator[Player]:
    """A player whose journal lies in a folder. Raises InvalidInput where it cannot be written."""
    if folder.is_file():
        raise InvalidInput(f"{folder} is a file, a folder is wanted")
    try:
        journal = Journal(folder / BENCHMARK_JOURNAL, _STUDY)
    except OSError as error:
        raise InvalidInput(f"cannot write results to {folder}: {error.strerror}") from error
    with journal:
        yield Player(journal, workers, make_executor)


_BLIND = {"min_returns": 10**9}
"""More returns than there are cells: a car that detects nothing, whatever it fires."""
_UNASKED = "random"
"""The policy of that car, which chooses nothing."""


def screened_worlds(player: Player, salt: Salt | None = None) -> list[World]:
    """The first worlds of every part that count: of the published seeds, or of a salt.

    Raises InvalidInput where one cannot be played.
    """
    return [world for part in PARTS for world in _screened(part, player, salt)]


def publish_screened(folder: Path, workers: int) -> None:
    """For maintainers: find the worlds that count, and make them those that everybody plays."""
    with player_in(folder, workers) as player:
        publish_worlds(screened_worlds(player))


def _screened(part: str, player: Player, salt: Salt | None) -> list[World]:
    found: list[World] = []
    waiting = candidates(part, salt)
    # As many at a time as are still missing: the journal keeps what was looked at.
    while missing := SIZES[part] - len(found):
        drawn = [*islice(waiting, missing)]
        most = reachable(part, [seed for _, seed in drawn], player)
        found += [
            World(part, *named, each) for named, each in zip(drawn, most, strict=True) if each
        ]
    return found


def reachable(part: str, seeds: list[int], player: Player) -> list[int]:
    """What there is to reach in the worlds of these seeds."""
    full = _rows(player, part, seeds, FULL)
    if part == STREETS:
        return [reached(part, row) for row in full]
    blind = _rows(player, part, seeds, _UNASKED, **_BLIND)
    return [
        int(row["collision"] and not seen["collision"])
        for seen, row in zip(full, blind, strict=True)
    ]


def _rows(player: Player, part: str, seeds: list[int], policy: str, **given: int) -> list[Row]:
    rows = player.rows(configurations(part, seeds, policy, **given))
    if player.failures:
        raise InvalidInput(f"a world could not be screened: {player.failures[0]}")
    return [row for row in rows if row is not None]


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


ONE_IN = {MEASURED: 6, IDEAL: 30}
"""One episode in so many is drawn, of both together a tenth: mostly of those that make the score,
for who makes rows up makes up those. How sure it is: `docs/benchmark.md`."""


@dataclass(frozen=True)
class Replay:
    """The number of rows that were played again, those of them that went otherwise, how many
    reached as much with another hash where that is no fault, what failed, and what else the file
    says falsely.
    """

    played: int
    differing: tuple[ResultRow, ...]
    detours: int
    failures: tuple[Failure, ...]
    false: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether all is as the file says."""
        return not (self.differing or self.failures or self.false)


def replayed(
    result: BenchmarkResult,
    player: Player,
    rng: Random,
    salt: Salt | None = None,
    worlds: Sequence[World] = (),
) -> Replay:
    """Play a random tenth of a result again; `worlds` are those that the salt draws.

    A row goes otherwise where another number is reached. By the very code, libraries and machine
    that the file names it goes otherwise also where the episode has another hash: others may round
    the last bit of a direction otherwise, and fire other cells.

    Raises InvalidInput for a sealed one without its salt, and where its policy cannot be made.
    """
    check_salt(result, salt)
    tasks = {row: _task(result, row, salt) for row in _drawn(result, rng)}
    false = [*_false_tags(result), *(_false_worlds(result, worlds) if salt else ())]
    configs = [task.config for task in tasks.values()]
    for config in configs[:1]:
        config.try_out()
    rows = player.rows(configs)
    others = {
        told: again
        for (told, task), row in zip(tasks.items(), rows, strict=True)
        if row and (again := ResultRow.of(task, row)) != told
    }
    # Who makes up a score must make up what was reached. What made the file is its own word: who
    # names another maker goes without the check of hashes, and not without this.
    alike = is_made_alike(result)
    differing = tuple(
        told for told, again in others.items() if alike or again.reached != told.reached
    )
    detours = len(others) - len(differing)
    return Replay(len(tasks), differing, detours, tuple(player.failures), tuple(false))


def check_salt(result: BenchmarkResult, salt: Salt | None) -> None:
    """Raise InvalidInput unless the salt is the one that drew the result's worlds."""
    if result.sealed != (salt.digest if salt else None):
        raise InvalidInput(
            f"the worlds of {result.entry.name} are "
            + (f"sealed by the salt {result.sealed[:12]}" if result.sealed else "published")
            + ": give --sealed the file of that salt, or none"
        )


def _drawn(result: BenchmarkResult, rng: Random) -> list[ResultRow]:
    by_camera = {camera: [r for r in result.rows if r.camera == camera] for camera in ONE_IN}
    return [
        row
        for camera, own in by_camera.items()
        for row in rng.sample(own, -(-len(own) // ONE_IN[camera]))
    ]


def _false_tags(result: BenchmarkResult) -> list[str]:
    tags = tags_of(result.entry.policy)
    if {*tags} == {*result.tags}:
        return []
    return [f"it says that the policy is {', '.join(result.tags)}, and it is {', '.join(tags)}"]


def _false_worlds(result: BenchmarkResult, worlds: Sequence[World]) -> list[str]:
    due = {(world.part, world.number, world.reachable) for world in worlds}
    others = [told for told in result.worlds if told not in due]
    if not others:
        return []
    part, number, most = others[0]
    return [
        f"{len(others)} of its worlds are not what the salt draws, the first world {number} of the "
        f"{part} with {most} to reach"
    ]


def _task(result: BenchmarkResult, row: ResultRow, salt: Salt | None) -> Task:
    seed = salt.seed(row.part, row.world) if salt else row.world
    world = World(row.part, row.world, seed, row.reachable)
    (task,) = tasks_of(result.entry, [world], [row.camera])
    return task

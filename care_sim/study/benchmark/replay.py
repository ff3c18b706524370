"""Whether a result is what its policy does: a random tenth of its episodes is played again."""

from dataclasses import dataclass
from random import Random

from care_sim.base.errors import InvalidInput
from care_sim.study.benchmark.player import Player
from care_sim.study.benchmark.result import BenchmarkResult, ResultRow
from care_sim.study.benchmark.tasks import Task, tasks_of
from care_sim.study.benchmark.worlds import Salt, World
from care_sim.study.runner import Failure

_SHARE = 10
"""One episode in so many. Who has made up a twentieth of 480 rows passes once in 13 times, a tenth
once in 208."""


@dataclass(frozen=True)
class Replay:
    """The rows that were played again, those of them that went otherwise, and what failed."""

    played: int
    differing: tuple[ResultRow, ...]
    failures: tuple[Failure, ...]

    @property
    def holds(self) -> bool:
        """Whether all went as the file says."""
        return not (self.differing or self.failures)


def replayed(
    result: BenchmarkResult, player: Player, rng: Random, salt: Salt | None = None
) -> Replay:
    """Play a random tenth of a result again. Raises InvalidInput for a sealed one without its
    salt, and where its policy cannot be made.
    """
    if result.sealed != (salt.digest if salt else None):
        raise InvalidInput(
            f"the worlds of {result.entry.name} are "
            + (f"sealed by the salt {result.sealed[:12]}" if result.sealed else "published")
            + ": give --sealed the file of that salt, or none"
        )
    drawn = rng.sample(result.rows, -(-len(result.rows) // _SHARE))
    tasks = [_task(result, row, salt) for row in drawn]
    rows = player.rows([task.config for task in tasks])
    found = [
        ResultRow.of(task, row) if row else None for task, row in zip(tasks, rows, strict=True)
    ]
    differing = tuple(
        told for told, again in zip(drawn, found, strict=True) if again and again != told
    )
    return Replay(len(drawn), differing, tuple(player.failures))


def _task(result: BenchmarkResult, row: ResultRow, salt: Salt | None) -> Task:
    seed = salt.seed(row.part, row.world) if salt else row.world
    world = World(row.part, row.world, seed, row.reachable)
    (task,) = tasks_of(result.entry, [world], [row.camera])
    return task

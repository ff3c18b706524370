"""Whether a result is what its policy does: a random tenth of its episodes is played again."""

from collections.abc import Sequence
from dataclasses import dataclass
from random import Random

from care_sim.base.errors import InvalidInput
from care_sim.policies import tags_of
from care_sim.study.benchmark.made_by import is_made_alike
from care_sim.study.benchmark.player import Player
from care_sim.study.benchmark.result import BenchmarkResult, ResultRow
from care_sim.study.benchmark.tasks import IDEAL, MEASURED, Task, tasks_of
from care_sim.study.benchmark.worlds import Salt, World
from care_sim.study.runner import Failure

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
    rows = player.rows([task.config for task in tasks.values()])
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

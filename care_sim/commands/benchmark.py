"""`care-sim benchmark`: the official suite, one result file for every policy."""

import re
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.errors import BrokenPolicy, InvalidInput, print_lines, report_problems
from care_sim.base.files import JSON, check_output
from care_sim.commands.shared.run_study import summary
from care_sim.commands.shared.selection import check_values, playable, policy_parameters
from care_sim.commands.shared.study_command import DONE, FAILED, console
from care_sim.core.defaults import AS_DEMANDED
from care_sim.policies import tags_of
from care_sim.policies.isolation import isolated_policies
from care_sim.reports.leaderboard import leaderboard_table
from care_sim.study.benchmark.play import played
from care_sim.study.benchmark.player import player_in
from care_sim.study.benchmark.screening import screened_worlds
from care_sim.study.benchmark.tasks import Entry, Task, tasks_of
from care_sim.study.benchmark.worlds import (
    Salt,
    World,
    published_worlds,
    quick_tenth,
)
from care_sim.study.executors import MOST_WORKERS, WORKERS, processes
from care_sim.study.run_config import parameters_for

_OUT = Path("runs/benchmark")


@dataclass(frozen=True, kw_only=True)
class Benchmark:
    """Play the official suite: one score, and a result file.

    The suite is drives, Euro NCAP tests and streets at 1% of the cells: 480 plays an entry, 48 with
    --quick. `care-sim leaderboard` makes the table.
    """

    policy: tuple[str, ...] = ()
    """Names of `care-sim policies`, or MODULE:OBJECT for one of a file here, such as mine:Mine of
    mine.py; `all` stands for all but the controls."""
    policy_parameters: tuple[str, ...] = ()
    """Parameters of the policies as NAME=VALUE; of one among several as POLICY.NAME=VALUE."""
    cell_order: str = AS_DEMANDED
    """In which order the cells of a set are taken, a part of the entry: the policy's own, or one of
    rows-down, rows-up, columns, random, spread, core-spread."""
    name: str = ""
    """What you call the entry, for its line in tables, where one policy is played alone."""
    quick: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """The first tenth of the worlds alone: a trial, and no line of the leaderboard."""
    sealed: Path | None = None
    """For whoever runs a competition: a file with a secret salt, which draws other worlds. The
    journal in the folder holds their seeds; the result files do not."""
    out: Path = _OUT
    """Folder of the result files; what is finished stays there, and the same command goes on."""
    workers: int = bounded(WORKERS, 1, MOST_WORKERS)
    """Processes that play at the same time."""

    def __post_init__(self) -> None:
        check_fields(self)

    @isolated_policies()
    def __call__(self) -> int:
        """Run it."""
        check_values(self, "policy")
        if self.quick and self.sealed:
            raise InvalidInput("a sealed set is played whole: give either quick or sealed")
        if self.sealed and self.out == _OUT:
            raise InvalidInput(
                f"a sealed set leaves its seeds in the folder: give --out one that only you read, "
                f"not {_OUT}"
            )
        salt = Salt.read(self.sealed) if self.sealed else None
        entries, left_out = self._entries()
        for entry in entries:
            check_output(self._file(entry), JSON)
        print_lines(f"Results go to {self.out}", file=sys.stderr)
        with player_in(self.out, self.workers, processes) as player:
            worlds = screened_worlds(player, salt) if salt else self._published()
            results = played(entries, worlds, player, self.quick, salt.digest if salt else None)
        for result in results:
            result.write(self._file(result.entry))
        if results:
            console().print(leaderboard_table(results).rich())
            print_lines(*(f"Result: {self._file(result.entry)}" for result in results))
        failed = [f"failed: {line}" for line in summary(player.failures, "plays")]
        report_problems([*failed, *left_out])
        return FAILED if failed or left_out else DONE

    def _published(self) -> Sequence[World]:
        return quick_tenth(published_worlds()) if self.quick else published_worlds()

    def _entries(self) -> tuple[list[Entry], list[str]]:
        """What takes part, and a line for each policy that cannot be made."""
        given = policy_parameters(self.policy_parameters, self.policy)

        def entry(name: str) -> Entry:
            return Entry(name, parameters_for(name, given), self.cell_order, self.name)

        # One world of every part is enough to see whether a policy can be made.
        tried = [*{world.part: world for world in published_worlds()}.values()]
        policies, left_out = playable(self.policy, lambda name: _tasks(entry(name), tried))
        if not policies:
            raise InvalidInput("none of the policies can be played")
        entries = [entry(name) for name in policies]
        if self.name and len(entries) > 1:
            raise InvalidInput("--name names one entry, and several policies are given")
        for each in entries:
            each.check()
        return entries, left_out

    def _file(self, entry: Entry) -> Path:
        kind = ".quick" if self.quick else ".sealed" if self.sealed else ""
        name = re.sub(r"[^\w.=-]+", "-", entry.full_name)
        return self.out / f"{name}{kind}.json"


def _tasks(entry: Entry, worlds: Sequence[World]) -> list[Task]:
    """The tasks of an entry. Raises BrokenPolicy for one that knows the truth."""
    if {"privileged", "non-causal"} & {*tags_of(entry.policy)}:
        raise BrokenPolicy(f"policy {entry.policy} knows the truth, and the benchmark plays none")
    return tasks_of(entry, worlds)

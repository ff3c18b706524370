"""B90 of entries: which worlds are played at which budgets, and the result of an entry.

The worlds are streets, drives and tests of the closed loop, and recorded drives
(`care_sim.study.benchmark.recorded`). The score is `care_sim.evaluation.smallest_budget`. A street
needs no screening: one in which a full scan detects nothing adds nothing to any count.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from care_sim.base.files import JSON, replacing
from care_sim.core.arrays import Floats
from care_sim.core.conditions import KITTI_CAMERA
from care_sim.evaluation.counts import EPISODE_COUNTS, NEEDLESS, SCENE_COUNTS, scene_counts
from care_sim.evaluation.smallest_budget import (
    BUDGETS,
    Counts,
    PartCounts,
    SmallestBudget,
    reaching,
    resampled_budgets,
    shares,
    smallest_budget,
)
from care_sim.policies import tags_of
from care_sim.study.benchmark.maker import made_by
from care_sim.study.benchmark.play import Player
from care_sim.study.benchmark.recorded import RECORDED_PARTS, RecordedDrive, drive_plays
from care_sim.study.benchmark.suite import (
    DRIVES,
    FIRST_SEED,
    LATE,
    STREETS,
    TESTS,
    TIGHT_TESTS,
    Entry,
    Salt,
    configurations,
    episode_seeds,
)
from care_sim.study.rows.parameters import Parameters
from care_sim.study.rows.reading import is_avoided, stops_for_nothing
from care_sim.study.run_config import FULL, Row, RunConfig
from care_sim.study.scene_play import DECISION_MS

BUDGET_MARK = "care_sim_b90"
"""The key by which a file is known; its value is the version of the score."""
BUDGET_VERSION = 1
MAIN_DETECTOR = "centerpoint"
"""The detector under which entries are ranked."""
STREETS_PLAYED, QUICK_STREETS = 80, 24
"""Streets of the score, and those of a trial. On 80 streets, the interval of `care-aimed`, which
leads there, is a fifth of its B90, and on emerging newcomers alone a third."""
EPISODES_PLAYED = {DRIVES: 24, TESTS: 40, TIGHT_TESTS: 80}
"""Worlds of the closed loop, where they are played too."""
REFERENCE_ENTRIES = (
    Entry("care-sector"),
    Entry("care-sector", (("residual", False),)),
    Entry("care-sightlines"),
    Entry("care-aimed"),
    Entry("learned-sets"),
    Entry("ppo"),
    Entry("care", cell_order="core-spread"),
    Entry("care"),
    Entry("all-camera", cell_order="core-spread"),
    Entry("boxes"),
    Entry("place"),
    Entry("tuned-place"),
    Entry("history"),
    Entry("history-rows"),
    Entry("rows"),
    Entry("fan"),
    Entry("after-shoouri"),
    Entry("after-ancha"),
    Entry("after-gofer"),
)
"""The published entries."""
FILMED = (STREETS, *RECORDED_PARTS)
"""Parts of the open loop."""
COUNTS = dict.fromkeys(FILMED, SCENE_COUNTS) | dict.fromkeys(EPISODES_PLAYED, EPISODE_COUNTS)
_DECIMALS = 3


class BudgetRow(NamedTuple):
    """The counts (k) of a world: of the full scan, and of the entry at every budget. The world is a
    seed, a number of a sealed set, or the name of a recorded drive.
    """

    part: str
    world: int | str
    full: tuple[float, ...]
    got: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class BudgetResult:
    """Counts of an entry at every budget, world by world, under a detector.

    `quick` is a trial on a few streets. `made_by` are versions and machine. `sealed` is the digest
    of the salt that drew the worlds. `policy_ms` are p50 and p99 of a decision of the policy on
    streets, each the median over its plays, in milliseconds.
    """

    entry: Entry
    tags: tuple[str, ...]
    detector: str
    rows: tuple[BudgetRow, ...]
    quick: bool
    made_by: Mapping[str, Any]
    sealed: str | None = None
    policy_ms: tuple[float, ...] = ()
    detector_parameters: Parameters = ()

    @property
    def detector_name(self) -> str:
        """The detector with its parameters."""
        given = ", ".join(f"{name}={value}" for name, value in self.detector_parameters)
        return f"{self.detector} ({given})" if given else self.detector

    @property
    def worlds(self) -> tuple[tuple[str, int | str], ...]:
        """Part and name of its worlds."""
        return tuple((row.part, row.world) for row in self.rows)

    @cached_property
    def counts(self) -> Counts:
        """Counts of all parts, from which the score follows."""
        return [
            PartCounts(
                COUNTS[part],
                np.array([row.got for row in self.rows if row.part == part], float),
                np.array([row.full for row in self.rows if row.part == part], float),
            )
            for part in self.parts
        ]

    @property
    def parts(self) -> tuple[str, ...]:
        """Its parts, in their order."""
        return tuple(dict.fromkeys(part for part, _ in self.worlds))

    def of_part(self, part: str) -> "BudgetResult":
        """Return the result in the worlds of one of its parts."""
        return replace(self, rows=tuple(row for row in self.rows if row.part == part))

    @cached_property
    def draws(self) -> Floats:
        """B90 (resamples,) of drawn worlds."""
        return resampled_budgets(self.counts)

    @cached_property
    def score(self) -> SmallestBudget:
        """B90 of the entry."""
        return smallest_budget(self.counts, self.draws)

    @property
    def held_back_by(self) -> str:
        """The count that reaches 90% last, with its part where there are several, and how many more
        reach it no earlier. If counts never reach it, the one with the least share at the largest
        budget stands for them, with this share. Empty if the smallest budget is enough.
        """
        names = [(part, name) for part in self.parts for name in COUNTS[part]]
        needed = reaching(self.counts)
        if needed.max() <= BUDGETS[0]:
            return ""
        last = np.flatnonzero(needed == needed.max()).tolist()
        worst, reached = last[0], ""
        # Needless stops are no share of anything.
        shared = [place for place in last if names[place][1] != NEEDLESS]
        if np.isinf(needed.max()) and shared:
            levels = shares(self.counts)[-1]
            worst = min(shared, key=lambda place: levels[place])
            reached = f", {levels[worst]:.1%} at {BUDGETS[-1]:.0%}"
        part, name = names[worst]
        text = f"{part}: {name}" if len(self.parts) > 1 else name
        return f"{text}{reached} (+{len(last) - 1})" if len(last) > 1 else text + reached

    def cut_to(self, worlds: Iterable[tuple[str, int | str]]) -> "BudgetResult | None":
        """Return the result in these worlds, in their order; None where one is missing."""
        own = dict(zip(self.worlds, self.rows, strict=True))
        kept = [own.get(world) for world in worlds]
        rows = tuple(row for row in kept if row is not None)
        return replace(self, rows=rows) if len(rows) == len(kept) else None

    def content(self) -> dict[str, Any]:
        """Return the result as plain data. The score in it is for people; readers use the rows."""
        return {
            BUDGET_MARK: BUDGET_VERSION,
            "entry": self.entry.name,
            "b90_percent": [_percent(value) for value in self.score],
            "held_back_by": self.held_back_by,
            **asdict(self.entry),
            "tags": self.tags,
            "detector": self.detector,
            "detector_parameters": self.detector_parameters,
            "quick": self.quick,
            "sealed": self.sealed,
            "policy_ms": self.policy_ms,
            "made_by": self.made_by,
            "budgets": BUDGETS,
            "counts": {part: COUNTS[part] for part in self.parts},
            "columns": BudgetRow._fields,
            "rows": self.rows,
        }

    def write(self, path: Path) -> None:
        """Write the result, one line per world."""
        head = self.content()
        rows = ",\n  ".join(json.dumps(row) for row in head.pop("rows"))
        opened = json.dumps(head, indent=1).removesuffix("\n}")
        with replacing(path, JSON) as unfinished:
            unfinished.write_text(f'{opened},\n "rows": [\n  {rows}\n ]\n}}\n', encoding="utf-8")


def _percent(budget: float) -> float | str:
    return round(100 * budget, 2) if np.isfinite(budget) else "never"


Worlds = Mapping[str, Sequence[Any]]
"""The seeds or drives of every part that is played."""


def budget_worlds(
    quick: bool = False,
    closed_loop: bool = False,
    recorded: Sequence[RecordedDrive] = (),
    without_streets: bool = False,
) -> Worlds:
    """Return the streets, fewer for a trial, and the recorded drives; with `closed_loop` the first
    drives and tests too.
    """
    streets = QUICK_STREETS if quick else STREETS_PLAYED
    episodes = {part: [*episode_seeds(part)[:number]] for part, number in EPISODES_PLAYED.items()}
    worlds: Worlds = {
        STREETS: [] if without_streets else [FIRST_SEED + n for n in range(streets)],
        **{part: [each for each in recorded if each.part == part] for part in RECORDED_PARTS},
        **(episodes if closed_loop else {}),
    }
    return {part: own for part, own in worlds.items() if own}


def budget_tasks(
    entry: Entry,
    part: str,
    worlds: Sequence[Any],
    detector: str,
    detector_parameters: Parameters = (),
) -> list[list[RunConfig]]:
    """Return per world the full scan and the entry at every budget. Raises InvalidInput for an
    entry or a detector that cannot be played.
    """
    common: dict[str, Any] = {
        "detector": detector,
        "detector_parameters": detector_parameters,
        "camera_profile": KITTI_CAMERA,
    }
    # Films have a picture every 0.5 s and none that is 0.12 s old.
    common |= {} if part in FILMED else LATE
    plays = drive_plays if part in RECORDED_PARTS else partial(configurations, part)
    full = plays(worlds, FULL, **common)
    own = [plays(worlds, entry.policy, budget, **common, **entry.conditions) for budget in BUDGETS]
    return [[*world] for world in zip(full, *own, strict=True)]


def play_budgets(
    entries: Sequence[Entry],
    player: Player,
    detector: str,
    worlds: Worlds,
    quick: bool = False,
    salt: Salt | None = None,
    detector_parameters: Parameters = (),
) -> list[BudgetResult]:
    """Play the entries; return the results of those that finished every play, in their order. With
    a `salt` the worlds are numbers, whose seeds the salt draws.
    """
    named = [
        (part, world.name if isinstance(world, RecordedDrive) else world)
        for part, own in worlds.items()
        for world in own
    ]
    played = {
        part: [salt.seed(part, number) for number in own] if salt else own
        for part, own in worlds.items()
    }
    tasks = {
        entry: [
            task
            for part, own in played.items()
            for task in budget_tasks(entry, part, own, detector, detector_parameters)
        ]
        for entry in entries
    }
    # All at once, so that the entries share the film of a street and its full scan.
    configs = [*dict.fromkeys(config for own in tasks.values() for task in own for config in task)]
    row_of = dict(zip(configs, player.rows(configs), strict=True))
    results = []
    for entry, own in tasks.items():
        rows = [[row for config in task if (row := row_of[config])] for task in own]
        if all(len(world) == len(task) for world, task in zip(rows, own, strict=True)):
            results.append(
                BudgetResult(
                    entry,
                    tags_of(entry.policy),
                    detector,
                    tuple(_row(*world, got) for world, got in zip(named, rows, strict=True)),
                    quick,
                    made_by(entry, detector_parameters),
                    salt.digest if salt else None,
                    _policy_ms(
                        [own for (part, _), own in zip(named, rows, strict=True) if part == STREETS]
                    ),
                    detector_parameters,
                )
            )
    return results


def _row(part: str, world: int | str, rows: Sequence[Row]) -> BudgetRow:
    full, *got = (counts_of(part, row) for row in rows)
    return BudgetRow(part, world, full, tuple(got))


def _policy_ms(streets: Sequence[Sequence[Row]]) -> tuple[float, ...]:
    """Return p50 and p99 of a decision on streets, medians over plays; nothing without streets. The
    first play of a process compiles code, which the median leaves out.
    """
    times = [[row[name] for name in DECISION_MS] for _full, *got in streets for row in got]
    return tuple(np.median(times, axis=0).round(_DECIMALS).tolist()) if times else ()


def counts_of(part: str, row: Row) -> tuple[float, ...]:
    """Return the counts of a play, in the order of `COUNTS`."""
    if part in FILMED:
        return tuple(round(value, _DECIMALS) for value in scene_counts(row).values())
    return float(is_avoided(row)), float(stops_for_nothing(row))

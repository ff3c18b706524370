"""The validation of a world: whether it discriminates between policies, the evidence, and every
policy in every world.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS, quartiles
from care_sim.reports.engine.contrasts import Contrast, contrast_of_rows
from care_sim.reports.engine.controls import BEST_CONTROL
from care_sim.reports.engine.measures import AVOIDED, DETECTION
from care_sim.reports.engine.parts import PolicyRows
from care_sim.reports.engine.tables import under_headings
from care_sim.reports.formatting import interval, mean, median, tag_notes
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.study.designs.validate import CAMERA_POLICIES, MEMORISER, is_training
from care_sim.study.rows.reading import (
    Setting,
    detections,
    is_avoided,
    is_missed,
    preventable,
    setting_of,
)
from care_sim.study.run_config import FULL, Row

BEST_CAMERA = "best camera policy"
HINDSIGHT = "control in hindsight"
"""The best control by the very test seeds it is then compared on: a choice in its favour."""
_SEPARATED = ("care", "all-camera", "history")
"""The paper's reserves, of which each pair has to be told apart."""
_CHOSEN = (BEST_CAMERA, BEST_CONTROL, HINDSIGHT)
_BY_NAME = ("all-camera", "care", "history", "random", MEMORISER)
_PAIRS = (
    ("1: ", BEST_CAMERA, BEST_CONTROL),
    ("1: ", BEST_CAMERA, HINDSIGHT),
    ("2: ", FULL, BEST_CONTROL),
    *(("3: ", *pair) for pair in combinations(_SEPARATED, 2)),
    ("", MEMORISER, BEST_CAMERA),
    ("", FULL, BEST_CAMERA),
)
"""The leads behind the answers, and what the memoriser has."""


@dataclass(frozen=True)
class Lead:
    """Lead of one policy over another on the test seeds: first detection in metres, and collisions
    that a full scan prevents in points; None where they share no such seed.
    """

    detection: Contrast | None
    avoided: Contrast | None

    @property
    def counting(self) -> list[float]:
        """The differences that count, whoever they favour."""
        return [each.mean for each in (self.detection, self.avoided) if each and each.counts]

    @property
    def leads(self) -> bool:
        """Whether one difference counts for the first, and none against it."""
        return bool(self.counting) and min(self.counting) > 0


class WorldPlays(PolicyRows):
    """The rows of a validation of one world, by policy and budget.

    The choices are by training seeds and everything else is of test seeds, the choice in hindsight
    included. A policy is named by itself or by a role: `BEST_CAMERA`, `BEST_CONTROL`, `HINDSIGHT`.
    """

    def __init__(self, setting: Setting, rows: Sequence[Row]):
        super().__init__(rows)
        self.setting = setting
        self.test_rows = [row for row in rows if not is_training(row)]
        self._test = PolicyRows(self.test_rows)
        training = PolicyRows([row for row in rows if is_training(row)])
        self._choices = {
            BEST_CAMERA: (training, CAMERA_POLICIES),
            BEST_CONTROL: (training, self.controls),
            HINDSIGHT: (self._test, self.controls),
        }

    def named(self, role: str, budget: float) -> str | None:
        """The policy of a role at a budget; None where nobody was played to choose from."""
        return _best(*self._choices[role], budget) if role in self._choices else role

    def best_control(self, budget: float) -> str | None:
        """The best control that a car can have, by the training seeds."""
        return self.named(BEST_CONTROL, budget)

    def played(self, role: str, budget: float) -> list[Row]:
        """The test rows of a policy at a budget; the full scan has one budget."""
        policy = self.named(role, budget)
        return self._test.of(policy, budget) if policy else []

    def lead(self, ours: str, theirs: str, budget: float) -> Lead:
        """Return the lead of one policy over another at a budget."""
        a, b, full = (self.played(role, budget) for role in (ours, theirs, FULL))
        avoided = contrast_of_rows(AVOIDED, preventable(full, a), preventable(full, b))
        return Lead(contrast_of_rows(DETECTION, a, b), avoided)

    def answers(self, budget: float) -> tuple[bool, bool, bool]:
        """Whether the best camera policy leads the best control, whether the full scan does, and
        whether each two of the paper's reserves are apart. A world discriminates where all three
        are so.
        """
        return (
            self.lead(BEST_CAMERA, BEST_CONTROL, budget).leads,
            self.lead(FULL, BEST_CONTROL, budget).leads,
            all(self.lead(*pair, budget).counting for pair in combinations(_SEPARATED, 2)),
        )

    @property
    def has_too_few(self) -> bool:
        """Whether there are too few test seeds for any difference to count."""
        return len({row["seed"] for row in self.test_rows}) < FEWEST_PAIRS


def played_worlds(rows: Sequence[Row]) -> list[WorldPlays]:
    """The worlds of a validation, the first of them as it is and the others with a factor
    changed.
    """
    # All plays of a policy have its parameters: it goes by its name.
    plain = [{n: row[n] for n in row if not n.startswith("policy.")} for row in rows]
    placed = [(setting_of(row), row) for row in plain]
    # The full scan does not feel every condition: its rows may stand in a plainer setting, and
    # belong to each that differs from it in those alone.
    settings = dict.fromkeys(setting for setting, row in placed if row["policy"] != FULL)
    worlds = {
        setting: [
            row
            for own, row in placed
            if own == (setting.for_full() if row["policy"] == FULL else setting)
        ]
        for setting in settings or dict.fromkeys(setting for setting, _ in placed)
    }
    return [WorldPlays(setting, own) for setting, own in worlds.items()]


def _best(plays: PolicyRows, policies: Sequence[str], budget: float) -> str | None:
    """The policy that avoids the most collisions, then the one with the earliest detection, over
    the seeds that all have played; of equals the first.
    """
    by_seed = {
        policy: {row["seed"]: row for row in rows}
        for policy in policies
        if (rows := plays.of(policy, budget))
    }
    shared = sorted(set.intersection(*map(set, by_seed.values()))) if by_seed else []

    def rank(policy: str) -> tuple[int, float]:
        rows = [by_seed[policy][seed] for seed in shared]
        distances = [found.value for found in detections(rows)]
        return sum(not is_avoided(row) for row in rows), -float(np.mean(distances or [0.0]))

    return min(by_seed, key=rank, default=None)


def validation_tables(rows: Sequence[Row]) -> list[Table]:
    """The verdicts and the collisions world by world, then for each world what they rest on and
    what every policy reaches.
    """
    worlds = played_worlds(rows)
    verdicts, hits = (
        {world.setting.label: [make(world, each) for each in world.budgets] for world in worlds}
        for make in (_verdict, _hits)
    )
    return [
        Table(
            "Does the world discriminate?",
            ("budget", *_CHOSEN, "1: leads", "by, m", "by, points", "2: to win", "3: apart",
             "discriminates"),
            under_headings(verdicts),
            (f"Too few: fewer than {FEWEST_PAIRS} test seeds.",),
            files_only=_CHOSEN[2:],
            whole=_CHOSEN,
        ),
        Table(
            "Who is hit?",
            ("budget", "full: lost", "full: hit", *_CHOSEN, *_BY_NAME, "runs into full"),
            under_headings(hits),
            ("Episodes with a collision. Lost: the full scan hits, or never detects the actor.",),
        ),
        *map(_lead_table, worlds),
        *map(_level_table, worlds),
    ]  # fmt: skip


def validation_closing(rows: Sequence[Row]) -> list[str]:
    """Which seeds were played, and which worlds discriminate."""
    seeds = {
        name: sorted({row["seed"] for row in rows if is_training(row) is training})
        for name, training in (("test", False), ("training", True))
    }
    told = " and ".join(
        f"{counted(len(own), f'{name} seed')} from {own[0]} to {own[-1]}"
        for name, own in seeds.items()
        if own
    )
    worlds = played_worlds(rows)
    if all(world.has_too_few for world in worlds):
        return [f"Played: {told}, too few for a verdict."]
    found = [
        f"{world.setting.label} at {', '.join(map(percent, budgets))}"
        for world in worlds
        if not world.has_too_few
        and (budgets := [each for each in world.budgets if all(world.answers(each))])
    ]
    listed = f": {'; '.join(found)}" if found else ""
    verdict = f"Worlds that discriminate: {len(found)} of {len(worlds)}{listed}."
    return [f"Played: {told}.", verdict]


def _verdict(world: WorldPlays, budget: float) -> TableRow:
    def answer(so: bool) -> str:
        return "too few" if world.has_too_few else Bold("yes") if so else "no"

    leads, to_win, apart = world.answers(budget)
    lead = world.lead(BEST_CAMERA, BEST_CONTROL, budget)
    return (
        percent(budget),
        *(world.named(role, budget) or "" for role in _CHOSEN),
        answer(leads),
        mean(lead.detection),
        mean(lead.avoided),
        *map(answer, (to_win, apart, leads and to_win and apart)),
    )


def _hits(world: WorldPlays, budget: float) -> TableRow:
    full = world.played(FULL, budget)
    played = (world.played(role, budget) for role in (FULL, *_CHOSEN, *_BY_NAME))
    return (
        percent(budget),
        _share([row["collision"] or is_missed(row) for row in full]),
        *(_share([row["collision"] for row in rows]) for rows in played),
        _ran_into(full),
    )


def _ran_into(full: Sequence[Row]) -> str:
    """On how many seeds a body runs into the car of the full scan, which body and how fast; empty
    where none does. Seeing more does not avoid that.
    """
    hit = [row for row in full if row.get("hit_at_front") is False]
    if not hit:
        return ""
    kinds = ", ".join(sorted({row["hit_kind"] for row in hit}))
    # Older files lack the column.
    speeds = [row["closing_speed_mps"] for row in hit if row.get("closing_speed_mps")]
    fastest = f" up to {max(speeds):.1f} m/s" if speeds else ""
    return f"{len(hit)}/{len(full)} {kinds}{fastest}"


def _share(which: Sequence[bool]) -> str:
    return f"{sum(which)}/{len(which)}" if which else ""


def _lead_table(world: WorldPlays) -> Table:
    """Return the evidence for the answers, budget by budget."""
    lines: list[TableRow] = []
    for question, ours, theirs in _PAIRS:
        leads = [world.lead(ours, theirs, budget) for budget in world.budgets]
        name = f"{question}{ours} minus {theirs}"
        lines.append((f"{name}, m", *(interval(lead.detection) for lead in leads)))
        lines.append((f"{name}, points", *(interval(lead.avoided) for lead in leads)))
    columns = ("", *map(percent, world.budgets))
    notes = tag_notes(world.tags.values())
    return Table(f"{world.setting.label}: who leads whom", columns, tuple(lines), notes)


def _level_table(world: WorldPlays) -> Table:
    """Median first detection and collisions of every policy on the test seeds."""

    def entry(rows: Sequence[Row]) -> str:
        hit = _share([row["collision"] for row in rows])
        return f"{median(quartiles(detections(rows)))}, {hit}" if rows else ""

    return Table(
        f"{world.setting.label}: every policy on the test seeds",
        ("policy", *(f"{percent(budget)}: first detection, hit" for budget in world.budgets)),
        tuple(
            (world.marked(policy), *(entry(world.played(policy, b)) for b in world.budgets))
            for policy in world.policies
        ),
        tag_notes(world.tags.values()),
        terminal=False,
    )

"""Whether worlds discriminate: the verdicts, what they rest on, and every policy in every world."""

from collections.abc import Sequence
from itertools import combinations

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS, quartiles
from care_sim.reports.engine.controls import BEST_CONTROL
from care_sim.reports.formatting import interval, marked, mean, median, tag_notes
from care_sim.reports.table import Bold, Table, TableRow
from care_sim.reports.validation import (
    BEST_CAMERA,
    HINDSIGHT,
    SEPARATED,
    WorldPlays,
    played_worlds,
)
from care_sim.study.designs.validate import MEMORISER, is_training
from care_sim.study.rows.reading import detections, is_missed
from care_sim.study.run_config import FULL, Row

_CHOSEN = (BEST_CAMERA, BEST_CONTROL, HINDSIGHT)
_BY_NAME = ("all-camera", "care", "history", "random", MEMORISER)
_PAIRS = (
    ("1: ", BEST_CAMERA, BEST_CONTROL),
    ("1: ", BEST_CAMERA, HINDSIGHT),
    ("2: ", FULL, BEST_CONTROL),
    *(("3: ", *pair) for pair in combinations(SEPARATED, 2)),
    ("", MEMORISER, BEST_CAMERA),
    ("", FULL, BEST_CAMERA),
)
"""The leads behind the answers, and what the memoriser has."""


def validation_tables(rows: Sequence[Row]) -> list[Table]:
    """The verdicts and the collisions world by world, then for each world what they rest on and
    what every policy reaches.
    """
    worlds = played_worlds(rows)
    verdicts: list[TableRow] = []
    hits: list[TableRow] = []
    for world in worlds:
        verdicts += [(world.setting.label,), *(_verdict(world, each) for each in world.budgets)]
        hits += [(world.setting.label,), *(_hits(world, each) for each in world.budgets)]
    return [
        Table(
            "Does the world discriminate?",
            ("budget", *_CHOSEN, "1: leads", "by, m", "by, points", "2: to win", "3: apart",
             "discriminates"),
            tuple(verdicts),
            (f"Too few: fewer than {FEWEST_PAIRS} test seeds.",),
            files_only=_CHOSEN[2:],
            whole=_CHOSEN,
        ),
        Table(
            "Who is hit?",
            ("budget", "full: lost", "full: hit", *_CHOSEN, *_BY_NAME, "runs into full"),
            tuple(hits),
            ("Episodes with a collision. Lost: the full scan hits, or never detects the actor.",),
        ),
        *map(_lead_table, worlds),
        *map(_level_table, worlds),
    ]  # fmt: skip


def validation_closing(rows: Sequence[Row]) -> list[str]:
    """Which seeds were played, and which worlds discriminate."""
    parts = (
        ("test", {row["seed"] for row in rows if not is_training(row)}),
        ("training", {row["seed"] for row in rows if is_training(row)}),
    )
    told = " and ".join(
        f"{counted(len(seeds), f'{name} seed')} from {min(seeds)} to {max(seeds)}"
        for name, seeds in parts
        if seeds
    )
    worlds = played_worlds(rows)
    if all(world.has_too_few for world in worlds):
        return [f"Played: {told}, too few for a verdict."]
    found = [
        f"{world.setting.label} at {', '.join(map(percent, budgets))}"
        for world in worlds
        if not world.has_too_few and (budgets := world.discriminates_at)
    ]
    listed = f": {'; '.join(found)}" if found else ""
    verdict = f"Worlds that discriminate: {len(found)} of {len(worlds)}{listed}."
    return [f"Played: {told}.", verdict]


def _verdict(world: WorldPlays, budget: float) -> TableRow:
    leads, to_win, apart = world.answers(budget)
    lead = world.lead(BEST_CAMERA, BEST_CONTROL, budget)
    return (
        percent(budget),
        *(world.named(role, budget) or "" for role in _CHOSEN),
        _answer(world, leads),
        mean(lead.detection),
        mean(lead.avoided),
        *(_answer(world, so) for so in (to_win, apart, leads and to_win and apart)),
    )


def _answer(world: WorldPlays, so: bool) -> str:
    if world.has_too_few:
        return "too few"
    return Bold("yes") if so else "no"


def _hits(world: WorldPlays, budget: float) -> TableRow:
    full = world.played(FULL, budget)
    played = (world.played(role, budget) for role in (FULL, *_CHOSEN, *_BY_NAME))
    return (
        percent(budget),
        _share([row["collision"] or is_missed(row) for row in full]),
        *(_share([row["collision"] for row in rows]) for rows in played),
        world.ran_into,
    )


def _share(which: Sequence[bool]) -> str:
    return f"{sum(which)}/{len(which)}" if which else ""


def _lead_table(world: WorldPlays) -> Table:
    """What the answers rest on, budget by budget."""
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
    lines: list[TableRow] = []
    for policy, tags in world.tags.items():
        played = [world.played(policy, budget) for budget in world.budgets]
        levels = (
            f"{median(quartiles(detections(rows)))}, {_share([row['collision'] for row in rows])}"
            if rows
            else ""
            for rows in played
        )
        lines.append((marked(policy, tags), *levels))
    return Table(
        f"{world.setting.label}: every policy on the test seeds",
        ("policy", *(f"{percent(budget)}: first detection, hit" for budget in world.budgets)),
        tuple(lines),
        tag_notes(world.tags.values()),
        terminal=False,
    )

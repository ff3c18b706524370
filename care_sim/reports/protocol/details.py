"""Gains of CARE in thirds of the scenes by traffic, how often allocations differ, and which events
policies detect earlier than history.
"""

from collections.abc import Iterator, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.differences import AllocationDifference, DetectionOrder, detection_order
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.evaluation.strata import SCENE_THIRDS, thirds
from care_sim.reports.engine.tables import PAPER, budget_table
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.comparisons import (
    ALL_CAMERA,
    DENSE_LESS_SPARSE,
    RANKINGS,
    SceneThird,
    means,
)
from care_sim.reports.protocol.formatting import claims_of_paper, papers, rounded
from care_sim.reports.protocol.paper import ALLOCATION_SOURCE, PUBLISHED_ALLOCATIONS, claims_about
from care_sim.reports.protocol.rows import HISTORY, SettingPlays
from care_sim.reports.table import Table, TableRow
from care_sim.study.rows.reading import WITHOUT_LABELS
from care_sim.study.run_config import REFERENCE, Row


def thirds_tables(plays: SettingPlays) -> list[Table]:
    """CARE less all-camera in sparse and dense scenes; none without three scenes per third at every
    budget.
    """
    # The gap between dense and sparse needs both other thirds, so that it stands for all of them.
    gap = SceneThird(DENSE_LESS_SPARSE, "tracks", OVERALL)
    played = {*gap.policies} <= {*plays.policies}
    if not played or not all(gap.measured(plays, budget) for budget in plays.budgets):
        return []
    return budget_table(
        plays,
        f"{REFERENCE} minus {ALL_CAMERA} in thirds of the scenes",
        "third",
        (line for column in RANKINGS for line in _ranking_lines(plays, column)),
        ("Scenes are ranked at each budget by CARE's plays: means over keyframes and floors.",),
        papers(
            claims.source
            for each, claims in claims_about(plays.setting).items()
            if isinstance(each, SceneThird) and claims.any_at(plays.budgets)
        ),
        terminal=False,
    )


def _ranking_lines(plays: SettingPlays, column: str) -> Iterator[TableRow]:
    yield (f"{RANKINGS[column]} a keyframe",)
    # The counts of each third come before the differences in it. Dense first, as in the paper.
    for name in reversed(SCENE_THIRDS):
        yield (f"{name} third", *(_mean_count(plays, column, name, b) for b in plays.budgets))
    said = claims_about(plays.setting)
    for ratio in (OVERALL, FIRST_SIGHTING):
        yield (SceneThird("", column, ratio).heading,)
        for which in (*reversed(SCENE_THIRDS), DENSE_LESS_SPARSE):
            third = SceneThird(which, column, ratio)
            yield (third.label, *(interval(third.measured(plays, b)) for b in plays.budgets))
            if entries := claims_of_paper(said.get(third), plays.budgets):
                yield (PAPER, *entries)


def _mean_count(plays: SettingPlays, column: str, third: str, budget: float) -> str:
    # The mean over the scenes of the third, each of which is a mean over keyframes and floor seeds.
    counts = means(plays, column, budget)
    held = [counts[scene] for scene in thirds(counts)[third]]
    return f"{sum(held) / len(held):.1f}"


def allocation_tables(plays: SettingPlays) -> list[Table]:
    """How often every policy fires other cells than CARE, and how many; none without CARE."""
    lines: list[TableRow] = []
    quotes: tuple[str, ...] = ()
    for policy in plays.other_than(REFERENCE):
        entries = (_differing(plays.rows(policy, budget)) for budget in plays.budgets)
        lines.append((plays.marked(policy), *entries))
        # The paper gives shares for the default conditions alone.
        said = PUBLISHED_ALLOCATIONS.get(policy, {}) if plays.setting.as_in_paper else {}
        if {*said} & {*plays.budgets}:
            lines.append((PAPER, *(rounded(said.get(budget), "%") for budget in plays.budgets)))
            quotes = papers([ALLOCATION_SOURCE])
    return budget_table(
        plays,
        f"keyframes on which the allocation differs from that of {REFERENCE}",
        "policy",
        lines,
        (
            "Share of the keyframes, and mean number of cells where they differ. Each policy "
            "follows its own tracks, so differences accumulate over a scene.",
        ),
        quotes,
    )


def _differing(rows: Sequence[Row]) -> str:
    """The share of keyframes with other cells than CARE's, and the mean number of cells there."""
    columns = ("keyframes", "differing_keyframes", "differing_cells")
    # Rows that older versions wrote do not tell it.
    known = [row for row in rows if None not in (row[column] for column in columns)]
    found = AllocationDifference(*(int(sum(row[column] for row in known)) for column in columns))
    if not found.keyframes:
        return ""
    return f"{100 * found.share:.0f}%, {found.cells_where_differing:.0f} cells"


def earlier_tables(plays: SettingPlays) -> list[Table]:
    """Count the events of logs without labels (paper, Sec. 5.5). A reference is no truth, so recall
    does not measure a policy there, but earlier detection of an event does.
    """
    others = plays.other_than(HISTORY)
    if plays.setting.world != WITHOUT_LABELS or not others:
        return []
    lines = [
        (percent(budget), plays.marked(policy), *_order_counts(plays, policy, budget))
        for budget in plays.budgets
        for policy in others
    ]
    title = f"events detected earlier, later or at the same keyframe as {HISTORY}"
    notes = (
        "Mean over floor seeds. Two policies that do not detect an event within 6 keyframes are "
        "tied. Events are new clusters of the reference, no labels.",
    )
    vehicle = "CARE earlier than history on 17 of 104 entries, later on 8."
    return [
        Table(
            f"{plays.setting.label}: {title}",
            ("budget", "policy", "earlier", "later", "tied"),
            tuple(lines),
            notes,
            (f"The paper's vehicle (Sec. 5.5): {vehicle}",),
        )
    ]


def _order_counts(plays: SettingPlays, policy: str, budget: float) -> tuple[str, ...]:
    total, seeds = DetectionOrder(), 0
    for scene in plays.scenes:
        pairs = [plays.delays(one, budget, scene).astype(int).tolist() for one in (policy, HISTORY)]
        seeds = max(seeds, min(map(len, pairs)))
        for ours, theirs in zip(*pairs, strict=False):
            total += detection_order(ours, theirs)
    counts = (total.earlier, total.later, total.tied)
    return tuple(f"{count / seeds:.1f}" for count in counts) if seeds else ("", "", "")

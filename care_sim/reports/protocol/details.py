"""What CARE gains in thirds of the scenes by traffic, and how often allocations differ."""

from collections.abc import Iterator, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.allocation_differences import AllocationDifference
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.evaluation.strata import SCENE_THIRDS, thirds
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.formatting import PAPER, claims_of_paper, rounded
from care_sim.reports.protocol.notes import papers
from care_sim.reports.protocol.paper import ALLOCATION_SOURCE, PUBLISHED_ALLOCATIONS, claims_about
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.protocol.thirds import DENSE_LESS_SPARSE, RANKINGS, SceneThird, means
from care_sim.reports.table import Table, TableRow
from care_sim.study.run_config import REFERENCE, Row

_RANKED = (
    "Scenes are ranked at each budget by CARE's plays there, means over keyframes and floor seeds."
)
_DIFFERING = (
    "Share of the keyframes, and mean number of cells where they differ. Each policy follows its "
    "own tracks, so differences accumulate over a scene."
)


def thirds_tables(plays: SettingPlays) -> list[Table]:
    """CARE less all-camera in sparse and dense scenes; none without three scenes per third at every
    budget.
    """
    # The gap between dense and sparse needs both other thirds, so that it stands for all of them.
    gap = SceneThird(DENSE_LESS_SPARSE, "tracks", OVERALL)
    played = {*gap.policies} <= {*plays.policies}
    if not played or not all(gap.measured(plays, budget) for budget in plays.budgets):
        return []
    said = claims_about(plays.setting)
    return [
        Table(
            f"{plays.setting.label}: care minus all-camera in thirds of the scenes",
            ("third", *map(percent, plays.budgets)),
            tuple(line for column in RANKINGS for line in _ranking_lines(plays, column)),
            (_RANKED,),
            papers(
                claims.source
                for each, claims in said.items()
                if isinstance(each, SceneThird) and claims.any_at(plays.budgets)
            ),
            terminal=False,
        )
    ]


def _ranking_lines(plays: SettingPlays, column: str) -> Iterator[TableRow]:
    yield (f"{RANKINGS[column]} a keyframe",)
    # What a third means in numbers comes before what differs in it. Dense first, as in the paper.
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
    others = plays.other_than(REFERENCE)
    # The paper gives shares for the default conditions alone.
    said = {
        policy: shares
        for policy, shares in PUBLISHED_ALLOCATIONS.items()
        if plays.setting.as_in_paper and policy in others and {*shares} & {*plays.budgets}
    }
    lines: list[TableRow] = []
    for policy in others:
        entries = (_differing(plays.rows(policy, budget)) for budget in plays.budgets)
        lines.append((plays.marked(policy), *entries))
        if policy in said:
            shares = (said[policy].get(budget) for budget in plays.budgets)
            lines.append((PAPER, *(rounded(share, "%") for share in shares)))
    if not lines:
        return []
    return [
        Table(
            f"{plays.setting.label}: keyframes on which the allocation differs from that of "
            f"{REFERENCE}",
            ("policy", *map(percent, plays.budgets)),
            tuple(lines),
            (_DIFFERING, *plays.notes),
            papers(ALLOCATION_SOURCE for _ in said),
        )
    ]


def _differing(rows: Sequence[Row]) -> str:
    """The share of keyframes with other cells than CARE's, and the mean number of cells there."""
    columns = ("keyframes", "differing_keyframes", "differing_cells")
    # Rows that older versions wrote do not tell it.
    known = [row for row in rows if None not in (row[column] for column in columns)]
    found = AllocationDifference(*(int(sum(row[column] for row in known)) for column in columns))
    if not found.keyframes:
        return ""
    return f"{100 * found.share:.0f}%, {found.cells_where_differing:.0f} cells"

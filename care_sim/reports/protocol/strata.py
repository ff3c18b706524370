"""Where policies gain and what the residual filter changes: strata, thirds of scenes, and differing
allocations.
"""

from collections.abc import Iterator

from care_sim.base.errors import percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.evaluation.strata import ENTRY, SCENE_THIRDS
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.protocol.differences import reference_pairs
from care_sim.reports.protocol.entries import ENTRY_NOTE
from care_sim.reports.protocol.formatting import PAPER, claims_of_paper, rounded, written
from care_sim.reports.protocol.notes import UNITS_OF_DIFFERENCES, papers
from care_sim.reports.protocol.paper import (
    ALLOCATION_SOURCE,
    PUBLISHED_ALLOCATIONS,
    claims_about,
)
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.protocol.thirds import (
    DENSE_LESS_SPARSE,
    FEWEST_SCENES,
    RANKINGS,
    SceneThird,
)
from care_sim.reports.table import Table
from care_sim.study.run_config import FULL, REFERENCE

_RANKED = (
    "Scenes are ranked at each budget by CARE's plays there, means over keyframes and floor seeds. "
    f"No interval of fewer than {FEWEST_PAIRS} scenes."
)
_NO_THIRDS = (
    "No thirds of the scenes by traffic: they take all-camera and at least "
    f"{FEWEST_SCENES} scenes at every budget."
)
_DIFFERING = (
    "Share of the keyframes, and mean number of cells where they differ. Each policy follows its "
    "own tracks, so differences accumulate over a scene."
)


def strata_tables(plays: SettingPlays) -> list[Table]:
    """Recall by range, azimuth and class, overall recall by entry, too: the level of every policy
    and of the full scan, and CARE less history and less all-camera.
    """
    if not plays.policies:
        return []
    columns = (
        *(marked(policy, tags) for policy, tags in plays.tags.items()),
        *((FULL,) if plays.full else ()),
        *(pair.label for pair in reference_pairs(plays)),
    )
    notes = (*_on_strata(plays), *tag_notes(plays.tags.values()))
    entries = (ENTRY_NOTE,) if ENTRY in plays.strata() else ()
    # The tables of thirds would follow. A note in the last table before them says why they are
    # missing.
    without = (_NO_THIRDS,) if REFERENCE in plays.policies and not _has_thirds(plays) else ()
    return [
        Table(
            f"{plays.setting.label}: {ratio.name} by stratum",
            ("stratum", "budget", counted, *columns),
            tuple(_strata_lines(plays, ratio)),
            (*notes, *more),
            terminal=False,
        )
        for ratio, counted, more in (
            (FIRST_SIGHTING, "events", ()),
            (OVERALL, "object frames", (*entries, *without)),
        )
    ]


def _on_strata(plays: SettingPlays) -> tuple[str, ...]:
    intervals = (
        "Intervals over scenes that have anything in the stratum, none of fewer than "
        f"{FEWEST_PAIRS}."
    )
    return (
        "Levels in %. A stratum with nothing to find has no line.",
        *((intervals,) if reference_pairs(plays) else ()),
    )


def _strata_lines(plays: SettingPlays, ratio: Ratio) -> Iterator[tuple[str, ...]]:
    for kind, labels in plays.strata().items():
        # First sightings by entry have a table of their own.
        if (ratio, kind) == (FIRST_SIGHTING, ENTRY):
            continue
        yield (kind,)
        for within in (f"{kind}/{label}" for label in labels):
            if count := plays.counted(ratio, within):
                for budget in plays.budgets:
                    yield _stratum_line(plays, ratio, within, budget, count)


def _stratum_line(
    plays: SettingPlays, ratio: Ratio, within: str, budget: float, count: float
) -> tuple[str, ...]:
    ceiling = ((FULL, 1.0),) if plays.full else ()
    levels = (
        plays.level(ratio, policy, of, within).by_event
        for policy, of in (*((policy, budget) for policy in plays.policies), *ceiling)
    )
    return (
        within.partition("/")[2],
        percent(budget),
        f"{count:,.0f}",
        *(written(ratio, value) for value in levels),
        *(interval(pair.measured(plays, budget)) for pair in reference_pairs(plays, ratio, within)),
    )


def thirds_tables(plays: SettingPlays) -> list[Table]:
    """CARE less all-camera in sparse and dense scenes; none without three scenes per third at every
    budget.
    """
    if not _has_thirds(plays):
        return []
    said = claims_about(plays.setting)
    return [
        Table(
            f"{plays.setting.label}: care minus all-camera in thirds of the scenes",
            ("third", *map(percent, plays.budgets)),
            tuple(line for column in RANKINGS for line in _ranking_lines(plays, column)),
            (f"{UNITS_OF_DIFFERENCES} {_RANKED}",),
            papers(
                claims.source
                for each, claims in said.items()
                if isinstance(each, SceneThird) and claims.any_at(plays.budgets)
            ),
            terminal=False,
        )
    ]


def _has_thirds(plays: SettingPlays) -> bool:
    # The gap between dense and sparse needs both other thirds, so that it stands for all of them.
    third = SceneThird(DENSE_LESS_SPARSE, "tracks", OVERALL)
    played = {*third.policies} <= {*plays.policies}
    return played and all(third.measured(plays, budget) for budget in plays.budgets)


def _ranking_lines(plays: SettingPlays, column: str) -> Iterator[tuple[str, ...]]:
    yield (f"{RANKINGS[column]} a keyframe",)
    # What a third means in numbers comes before what differs in it. Dense first, as in the paper.
    for name in reversed(SCENE_THIRDS):
        yield (
            f"{name} third",
            *(_mean_count(plays, column, name, budget) for budget in plays.budgets),
        )
    for ratio in (OVERALL, FIRST_SIGHTING):
        thirds = [
            SceneThird(which, column, ratio)
            for which in (*reversed(SCENE_THIRDS), DENSE_LESS_SPARSE)
        ]
        yield (thirds[0].heading,)
        for third in thirds:
            yield from _third_lines(plays, third)


def _third_lines(plays: SettingPlays, third: SceneThird) -> Iterator[tuple[str, ...]]:
    yield (third.label, *(interval(third.measured(plays, budget)) for budget in plays.budgets))
    said = claims_about(plays.setting).get(third)
    if entries := claims_of_paper(said, plays.budgets):
        yield (PAPER, *entries)


def _mean_count(plays: SettingPlays, column: str, third: str, budget: float) -> str:
    # The mean over the scenes of the third, each of which is a mean over keyframes and floor seeds.
    counts = plays.means(column, budget)
    held = [counts[scene] for scene in plays.thirds(column, budget)[third]]
    return f"{sum(held) / len(held):.1f}"


def allocation_tables(plays: SettingPlays) -> list[Table]:
    """How often every policy fires other cells than CARE, and how many; none without CARE."""
    if not plays.others:
        return []
    said = _published_shares(plays)
    lines: list[tuple[str, ...]] = []
    for policy in plays.others:
        lines.append(
            (
                marked(policy, plays.tags[policy]),
                *(_differing(plays, policy, b) for b in plays.budgets),
            )
        )
        if policy in said:
            shares = (said[policy].get(budget) for budget in plays.budgets)
            lines.append((PAPER, *(rounded(share, "%") for share in shares)))
    return [
        Table(
            f"{plays.setting.label}: keyframes on which the allocation differs from that of "
            f"{REFERENCE}",
            ("policy", *map(percent, plays.budgets)),
            tuple(lines),
            (_DIFFERING, *tag_notes(plays.tags.values())),
            papers(ALLOCATION_SOURCE for _ in said),
        )
    ]


def _published_shares(plays: SettingPlays) -> dict[str, dict[float, float]]:
    """The shares that the paper gives of policies and budgets that were played, by policy; it gives
    them for the default conditions alone.
    """
    if not plays.setting.as_in_paper:
        return {}
    return {
        policy: shares
        for policy, shares in PUBLISHED_ALLOCATIONS.items()
        if policy in plays.others and not shares.keys().isdisjoint(plays.budgets)
    }


def _differing(plays: SettingPlays, policy: str, budget: float) -> str:
    found = plays.allocation_difference(policy, budget)
    return (
        f"{100 * found.share:.0f}%, {found.cells_where_differing:.0f} cells"
        if found.keyframes
        else ""
    )

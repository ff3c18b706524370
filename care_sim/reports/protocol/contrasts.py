"""The paper's Table 1: CARE less every policy, and every policy less history, which shows what a
new idea adds to either.
"""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, TTFD
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.protocol.differences import MeasuredDifference, PolicyPair
from care_sim.reports.protocol.formatting import PAPER, claims_of_paper
from care_sim.reports.protocol.notes import (
    UNITS_OF_DIFFERENCES,
    left_out,
    on_intervals,
    papers,
    played,
)
from care_sim.reports.protocol.paper import claims_about
from care_sim.reports.protocol.rows import HISTORY, SettingPlays, plays_by_setting
from care_sim.reports.table import Table
from care_sim.study.run_config import REFERENCE, Row


class _ContrastLine(NamedTuple):
    """A pair, named by the one of its policies that is not the base, and its differences at every
    budget.
    """

    policy: str
    pair: PolicyPair
    differences: list[MeasuredDifference | None]


def protocol_contrast_tables(plays: SettingPlays) -> list[Table]:
    """CARE less every other policy, every policy less history, and CARE's with equal weight to
    every scene; none of a base that was not played, or alone.
    """
    # CARE first, as in the paper; then history, the base without a camera. Equal scene weights
    # answer whether a few rich scenes drive the result, and go to the files alone.
    wanted = ((REFERENCE, False), (HISTORY, False), (REFERENCE, True))
    return [
        _table(plays, base, equal_scenes, base_first=base != HISTORY)
        for base, equal_scenes in wanted
        if plays.other_than(base)
    ]


def protocol_minus(rows: Sequence[Row], policy: str) -> list[Table]:
    """One policy, named with its parameters, less every other, in every setting that has it."""
    settings = [plays for plays in plays_by_setting(rows) if plays.other_than(policy)]
    return [_table(plays, policy) for plays in settings]


def _table(
    plays: SettingPlays, base: str, equal_scenes: bool = False, base_first: bool = True
) -> Table:
    contrasts = list(_contrasts(plays, base, equal_scenes, base_first))
    said = claims_about(plays.setting)
    intervals = on_intervals(
        difference for contrast in contrasts for difference in contrast.differences
    )
    title, head = (
        (f"{base} minus each policy", f"{base} minus")
        if base_first
        else (f"each policy minus {base}", f"minus {base}")
    )
    weights = ", equal scene weights" if equal_scenes else ""
    return Table(
        f"{plays.setting.label}: {title}{weights}",
        (head, *map(percent, plays.budgets)),
        tuple(_lines(plays, contrasts)),
        (
            f"{UNITS_OF_DIFFERENCES} {played(plays)}",
            *intervals,
            *left_out(plays),
            *tag_notes(plays.tags.values()),
        ),
        papers(
            said[contrast.pair].source
            for contrast in contrasts
            if contrast.pair in said and said[contrast.pair].any_at(plays.budgets)
        ),
        terminal=not equal_scenes,
    )


def _contrasts(
    plays: SettingPlays, base: str, equal_scenes: bool, base_first: bool
) -> Iterator[_ContrastLine]:
    """The base less each of the others, or each of the others less the base."""
    kinds = () if equal_scenes else [kind for kind, count in plays.newcomers.items() if count]
    first_sightings = [(FIRST_SIGHTING, kind) for kind in ("", *kinds)]
    for ratio, within in (*first_sightings, (OVERALL, ""), (TTFD, "")):
        for policy in plays.other_than(base):
            # A positive difference speaks for the policy under test: for the base that stands
            # first, for the others against history.
            first, second = (base, policy) if base_first else (policy, base)
            pair = PolicyPair(first, second, ratio, within, equal_scenes)
            yield _ContrastLine(
                policy, pair, [pair.measured(plays, budget) for budget in plays.budgets]
            )


def _lines(plays: SettingPlays, contrasts: Iterable[_ContrastLine]) -> Iterator[tuple[str, ...]]:
    """The differences at every budget, and under them the paper's, below the headings of the
    measures.
    """
    heading = ""
    for policy, pair, differences in contrasts:
        if pair.heading != heading:
            heading = pair.heading
            yield (heading,)
        # A policy without any difference in this measure has no line, and no line of the paper
        # under it.
        if any(differences):
            yield (marked(policy, plays.tags[policy]), *map(interval, differences))
            said = claims_about(plays.setting).get(pair)
            if entries := claims_of_paper(said, plays.budgets):
                yield (PAPER, *entries)

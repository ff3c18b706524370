"""The paper's Table 1: CARE less every policy, and every policy less history, which shows what a
new idea adds to either.
"""

from collections.abc import Sequence

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, TTFD
from care_sim.reports.engine.controls import BEST_CONTROL, named_by_budget
from care_sim.reports.engine.measures import Measure, Recall
from care_sim.reports.engine.parts import OverControl
from care_sim.reports.engine.tables import minus_tables
from care_sim.reports.protocol.comparisons import PolicyPair
from care_sim.reports.protocol.formatting import (
    UNITS_OF_DIFFERENCES,
    claims_of_paper,
    left_out,
    papers,
    played,
)
from care_sim.reports.protocol.paper import Claims, claims_about
from care_sim.reports.protocol.rows import HISTORY, SettingPlays, plays_by_setting
from care_sim.reports.table import Table
from care_sim.study.run_config import REFERENCE, Row

__all__ = ["OverControl", "named_controls", "over_controls"]


def over_controls(plays: SettingPlays) -> list[OverControl]:
    """First-sighting and overall recall of every other policy less the best control's, paired by
    scene; without the measures in which there is no difference at any budget.
    """
    rivals = [policy for policy in plays.policies if policy not in plays.controls]
    made = [plays.over_control(Recall(ratio), rivals) for ratio in (FIRST_SIGHTING, OVERALL)]
    return [each for each in made if any(any(line) for line in each.differences.values())]


def named_controls(plays: SettingPlays, measures: Sequence[OverControl]) -> str:
    """The best control of every measure at every budget, in a sentence."""
    named = (
        f"in {each.ratio.name} "
        + named_by_budget(
            {
                budget: control
                for budget, control in zip(plays.budgets, each.controls, strict=True)
                if control
            }
        )
        for each in measures
    )
    return f"{BEST_CONTROL.capitalize()}: {'; '.join(named)}."


def protocol_contrast_tables(plays: SettingPlays) -> list[Table]:
    """CARE less every other policy, every policy less history, and CARE's with equal weight to
    every scene; none of a base that was not played, or alone.
    """
    # CARE first, as in the paper; then history, the base without a camera. Equal scene weights
    # answer whether a few rich scenes drive the result, and go to the files alone.
    return [
        *_tables(plays, REFERENCE),
        *_tables(plays, HISTORY, base_first=False),
        *_tables(plays, REFERENCE, equal_scenes=True),
    ]


def protocol_minus(rows: Sequence[Row], policy: str) -> list[Table]:
    """One policy, named with its parameters, less every other, in every setting that has it."""
    return [table for plays in plays_by_setting(rows) for table in _tables(plays, policy)]


def _tables(
    plays: SettingPlays, base: str, equal_scenes: bool = False, base_first: bool = True
) -> list[Table]:
    others = plays.other_than(base)
    kinds = () if equal_scenes else [kind for kind, count in plays.newcomers.items() if count]
    measures = [
        *(Recall(FIRST_SIGHTING, kind, equal_scenes) for kind in ("", *kinds)),
        *(Recall(ratio, equal_scenes=equal_scenes) for ratio in (OVERALL, TTFD)),
    ]
    said = claims_about(plays.setting)

    def claims(measure: Measure | Recall, policy: str) -> Claims | None:
        assert isinstance(measure, Recall)
        pair = (base, policy) if base_first else (policy, base)
        return said.get(PolicyPair(*pair, measure.ratio, measure.within, measure.equal_scenes))

    quoted = [found for each in measures for policy in others if (found := claims(each, policy))]
    return minus_tables(
        plays,
        base,
        others,
        measures,
        base_first=base_first,
        of_paper=lambda measure, policy: claims_of_paper(claims(measure, policy), plays.budgets),
        weights=", equal scene weights" if equal_scenes else "",
        notes=(" ".join([UNITS_OF_DIFFERENCES, played(plays), *left_out(plays)]),),
        quotes=papers(each.source for each in quoted if each.any_at(plays.budgets)),
    )

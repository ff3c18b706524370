"""What every policy has over the best control that was played at the same budget."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio, among, ratio_level
from care_sim.reports.controls import (
    BEST_CONTROL,
    IN_HINDSIGHT,
    best_control,
    candidates,
    is_control,
    named_by_budget,
)
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.protocol.differences import HEADINGS, MeasuredDifference, PolicyPair
from care_sim.reports.protocol.notes import left_out, on_intervals, played
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.table import Table

RULE = (
    f"The {BEST_CONTROL} is that with the highest level of the measure at the budget, over the "
    f"scenes that all controls have there. {IN_HINDSIGHT}"
)


class OverControl(NamedTuple):
    """A measure of all policies less that of the best control.

    `controls` holds the best control of every budget of the setting, `differences` those of every
    policy there; None where there is none.
    """

    ratio: Ratio
    controls: list[str | None]
    differences: dict[str, list[MeasuredDifference | None]]


def controls(plays: SettingPlays) -> list[str]:
    """The controls that were played, in the order of their first rows."""
    return [policy for policy in plays.policies if is_control(plays.tags[policy])]


def rivals(plays: SettingPlays) -> list[str]:
    """The other policies; none where no control was played."""
    found = controls(plays)
    return [policy for policy in plays.policies if policy not in found] if found else []


def control_at(plays: SettingPlays, ratio: Ratio, budget: float) -> str | None:
    """The control with the highest level of the measure at a budget, over the scenes that all
    controls have there; None where none is known.
    """
    found = {
        policy: tallies for policy in controls(plays) if (tallies := plays.tallies(policy, budget))
    }
    # A control that lacks a hard scene would win by that.
    shared = set.intersection(*map(set, found.values())) if found else set()
    return best_control(
        {
            policy: ratio_level(ratio, among(tallies, shared)).by_event
            for policy, tallies in found.items()
        }
    )


def over_controls(plays: SettingPlays) -> list[OverControl]:
    """First-sighting and overall recall of every other policy less the best control's, paired by
    scene; without the measures in which there is no difference at any budget.
    """
    made = [_over_control(plays, ratio) for ratio in (FIRST_SIGHTING, OVERALL)]
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


def control_tables(plays: SettingPlays) -> list[Table]:
    """First-sighting and overall recall of every other policy less the best control's; none without
    a control or another policy.
    """
    measures = over_controls(plays)
    if not measures:
        return []
    shown = (each for of in measures for line in of.differences.values() for each in line)
    return [
        Table(
            f"{plays.setting.label}: each policy minus the {BEST_CONTROL}",
            (f"minus the {BEST_CONTROL}", *map(percent, plays.budgets)),
            tuple(line for measure in measures for line in _lines(plays, measure)),
            (
                f"Recall in points. {played(plays)}",
                RULE,
                candidates(controls(plays)),
                *on_intervals(shown),
                *left_out(plays),
                *tag_notes(plays.tags.values()),
            ),
        )
    ]


def _over_control(plays: SettingPlays, ratio: Ratio) -> OverControl:
    best = [control_at(plays, ratio, budget) for budget in plays.budgets]
    against = list(zip(plays.budgets, best, strict=True))
    differences = {
        policy: [
            PolicyPair(policy, control, ratio).measured(plays, budget) if control else None
            for budget, control in against
        ]
        for policy in rivals(plays)
    }
    return OverControl(ratio, best, differences)


def _lines(plays: SettingPlays, measure: OverControl) -> Iterator[tuple[str, ...]]:
    yield (HEADINGS[measure.ratio],)
    yield (BEST_CONTROL, *(control or "" for control in measure.controls))
    for policy, differences in measure.differences.items():
        yield (marked(policy, plays.tags[policy]), *map(interval, differences))

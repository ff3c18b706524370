"""What every policy has over the best control that was played at the same budget."""

from collections.abc import Iterator, Mapping, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.controls import BEST_CONTROL, IN_HINDSIGHT, best_control, is_control
from care_sim.reports.formatting import interval, marked, tag_notes
from care_sim.reports.protocol.differences import HEADINGS, MeasuredDifference, PolicyPair
from care_sim.reports.protocol.notes import left_out, on_intervals, played
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.reports.table import Table

CONTROL_RATIOS = (FIRST_SIGHTING, OVERALL)
"""The measures in which policies are held against the control."""
RULE = (
    f"The {BEST_CONTROL} is that with the highest first-sighting recall at the budget, in overall "
    f"recall too, where another control may have more. {IN_HINDSIGHT}"
)

_Measured = Mapping[Ratio, Mapping[str, Sequence[MeasuredDifference | None]]]
"""Differences by measure and policy, one a budget."""


def controls(plays: SettingPlays) -> list[str]:
    """The controls that were played, in the order of their first rows."""
    return [policy for policy in plays.policies if is_control(plays.tags[policy])]


def rivals(plays: SettingPlays) -> list[str]:
    """The other policies; none where no control was played."""
    found = controls(plays)
    return [policy for policy in plays.policies if policy not in found] if found else []


def control_at(plays: SettingPlays, budget: float) -> str | None:
    """The control with the highest first-sighting recall at a budget; None where there is none."""
    return best_control(
        {policy: plays.level(FIRST_SIGHTING, policy, budget).by_event for policy in controls(plays)}
    )


def named_controls(plays: SettingPlays) -> str:
    """The best control at every budget, in a sentence."""
    known = ((budget, control_at(plays, budget)) for budget in plays.budgets)
    named = (f"{control} at {percent(budget)}" for budget, control in known if control)
    return f"{BEST_CONTROL.capitalize()}: {', '.join(named)}."


def over_control(
    plays: SettingPlays, ratio: Ratio, policy: str, budget: float
) -> MeasuredDifference | None:
    """A policy less the best control at the same budget, paired by scene."""
    control = control_at(plays, budget)
    return PolicyPair(policy, control, ratio).measured(plays, budget) if control else None


def control_tables(plays: SettingPlays) -> list[Table]:
    """First-sighting and overall recall of every other policy less the best control's; none without
    a control or another policy.
    """
    if not rivals(plays):
        return []
    measured = {
        ratio: {
            policy: [over_control(plays, ratio, policy, budget) for budget in plays.budgets]
            for policy in rivals(plays)
        }
        for ratio in CONTROL_RATIOS
    }
    named = (control_at(plays, budget) or "" for budget in plays.budgets)
    shown = (each for of_ratio in measured.values() for line in of_ratio.values() for each in line)
    return [
        Table(
            f"{plays.setting.label}: each policy minus the {BEST_CONTROL}",
            (f"minus the {BEST_CONTROL}", *map(percent, plays.budgets)),
            ((BEST_CONTROL, *named), *_lines(plays, measured)),
            (
                f"Recall in points. {played(plays)}",
                RULE,
                *on_intervals(shown),
                *left_out(plays),
                *tag_notes(plays.tags.values()),
            ),
        )
    ]


def _lines(plays: SettingPlays, measured: _Measured) -> Iterator[tuple[str, ...]]:
    for ratio, by_policy in measured.items():
        yield (HEADINGS[ratio],)
        for policy, differences in by_policy.items():
            yield (marked(policy, plays.tags[policy]), *map(interval, differences))

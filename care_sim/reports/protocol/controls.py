"""What every policy of the open loop has over the best control at the same budget."""

from collections.abc import Sequence

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL
from care_sim.reports.engine.controls import BEST_CONTROL, named_by_budget
from care_sim.reports.engine.measures import Recall
from care_sim.reports.engine.parts import OverControl
from care_sim.reports.protocol.rows import SettingPlays

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

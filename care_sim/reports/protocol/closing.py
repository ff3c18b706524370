"""What is said after the protocol's tables: how much was played, and whether the paper's gate is
met.
"""

from collections.abc import Mapping, Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING
from care_sim.reports.contrasts import GATE_POINTS
from care_sim.reports.formatting import interval
from care_sim.reports.protocol.differences import MeasuredDifference, PolicyPair
from care_sim.reports.protocol.formatting import MET, NOT_MET
from care_sim.reports.protocol.notes import by_both_counts, counts, on_intervals
from care_sim.reports.protocol.paper import PAPER_BUDGETS
from care_sim.reports.protocol.quotes import GATE
from care_sim.reports.protocol.rows import HISTORY, SettingPlays, plays_by_setting
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import REFERENCE, Row


def protocol_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and CARE over history against the paper's gate of five points in every
    setting without conditions that is no source of one's own.
    """
    gains = {
        plays.setting: _gains(plays)
        for plays in plays_by_setting(rows)
        # The gate was fixed for the plain setting, so that no fault is judged by it.
        if plays.setting.as_in_paper
    }
    gates = [_gate(setting, differences) for setting, differences in gains.items() if differences]
    return [
        _size(rows),
        *gates,
        *on_intervals(
            difference for differences in gains.values() for difference in differences.values()
        ),
    ]


def _size(rows: Sequence[Row]) -> str:
    # Events and object frames belong to the film. Any row of a scene tells them, so that one is
    # enough.
    scenes = {(row["source"], row["scene"]): row for row in rows}
    total = counts(scenes.values())
    keyframes = sum(row["keyframes"] for row in scenes.values())
    return (
        f"Scenes: {len(scenes):,}, with {total.events:,.0f} first sightings and "
        f"{total.frames:,.0f} object frames in {keyframes:,} keyframes; plays: "
        f"{len(rows):,}.{by_both_counts(scenes.values())}"
    )


def _gains(plays: SettingPlays) -> dict[float, MeasuredDifference]:
    """CARE over history at the paper's budgets."""
    pair = PolicyPair(REFERENCE, HISTORY, FIRST_SIGHTING)
    return {
        budget: difference
        for budget in plays.budgets
        if budget in PAPER_BUDGETS and (difference := pair.measured(plays, budget))
    }


def _gate(setting: Setting, differences: Mapping[float, MeasuredDifference]) -> str:
    measured = (
        f"{interval(difference)} at {percent(budget)} ({_met_or_not(difference)})"
        for budget, difference in differences.items()
    )
    return f'Paper: "{GATE}" Here, {setting.label}: {", ".join(measured)}.'


def _met_or_not(difference: MeasuredDifference) -> str:
    # Both are asked for: an effect that is sure, and one that is large enough to matter.
    return MET if difference.sign > 0 and difference.mean >= GATE_POINTS else NOT_MET

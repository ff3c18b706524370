"""What is said after the protocol's tables: how much was played, and whether the paper's gate is
met.
"""

from collections.abc import Mapping, Sequence

from care_sim.base.text import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING
from care_sim.reports.contrasts import GATE_POINTS
from care_sim.reports.protocol.differences import Gap, Pair
from care_sim.reports.protocol.formatting import whole
from care_sim.reports.protocol.notes import by_both_counts, counts, on_intervals
from care_sim.reports.protocol.paper import BUDGETS, GATE
from care_sim.reports.protocol.rows import HISTORY, Plays, Setting, plays_of
from care_sim.study.task import REFERENCE, Row


def protocol_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and CARE over history against the gate of five points in every plain
    setting.
    """
    gains = {
        plays.setting: _gains(plays) for plays in plays_of(rows) if not plays.setting.conditions
    }
    gates = [_gate(setting, gaps) for setting, gaps in gains.items() if gaps]
    return [
        _size(rows),
        *gates,
        *on_intervals(gap for gaps in gains.values() for gap in gaps.values()),
    ]


def _size(rows: Sequence[Row]) -> str:
    scenes = {(row["source"], row["scene"]): row for row in rows}
    total = counts(scenes.values())
    keyframes = sum(row["keyframes"] for row in scenes.values())
    return (
        f"Scenes: {len(scenes):,}, with {total.events:,.0f} first sightings and "
        f"{total.frames:,.0f} object frames in {keyframes:,} keyframes; plays: "
        f"{len(rows):,}.{by_both_counts(scenes.values())}"
    )


def _gains(plays: Plays) -> dict[float, Gap]:
    """CARE over history at the paper's budgets."""
    pair = Pair(REFERENCE, HISTORY, FIRST_SIGHTING)
    return {
        budget: gap
        for budget in plays.budgets
        if budget in BUDGETS and (gap := pair.gap(plays, budget))
    }


def _gate(setting: Setting, gaps: Mapping[float, Gap]) -> str:
    measured = (
        f"{whole(gap)} at {percent(budget)} ({'met' if _is_met(gap.mean, gap.sign) else 'not met'})"
        for budget, gap in gaps.items()
    )
    return f'Paper: "{GATE}" Here, {setting.label}: {", ".join(measured)}.'


def _is_met(mean: float, sign: int) -> bool:
    return sign > 0 and mean >= GATE_POINTS

"""Which events policies detect earlier than history, later, or at the same keyframe (paper, Sec.
5.5).
"""

from care_sim.base.errors import percent
from care_sim.evaluation.detection_order import DetectionOrder, detection_order
from care_sim.reports.protocol.rows import HISTORY, SettingPlays
from care_sim.reports.table import Table
from care_sim.study.rows.settings import WITHOUT_LABELS

_VEHICLE = (
    "The paper's vehicle (Sec. 5.5): CARE earlier than history on 17 of 104 entries, later on 8."
)


def earlier_tables(plays: SettingPlays) -> list[Table]:
    """Count the events of logs without labels: a reference is no truth, so recall is no measure of
    a policy there, but an event that one policy detects before another is.
    """
    if plays.setting.world != WITHOUT_LABELS or not plays.other_than(HISTORY):
        return []
    lines = [
        (percent(budget), plays.marked(policy), *_counts(plays, policy, budget))
        for budget in plays.budgets
        for policy in plays.other_than(HISTORY)
    ]
    return [
        Table(
            f"{plays.setting.label}: events detected earlier, later or at the same keyframe as "
            f"{HISTORY}",
            ("budget", "policy", "earlier", "later", "tied"),
            tuple(lines),
            (
                "Mean over floor seeds. Two policies that do not detect an event within 6 "
                "keyframes are tied. Events are new clusters of the reference, no labels.",
                *plays.notes,
            ),
            (_VEHICLE,),
        )
    ]


def _counts(plays: SettingPlays, policy: str, budget: float) -> tuple[str, ...]:
    total, seeds = DetectionOrder(), 0
    for scene in plays.scenes:
        pairs = [plays.delays(one, budget, scene).astype(int).tolist() for one in (policy, HISTORY)]
        seeds = max(seeds, min(map(len, pairs)))
        for ours, theirs in zip(*pairs, strict=False):
            total += detection_order(ours, theirs)
    counts = (total.earlier, total.later, total.tied)
    return tuple(f"{count / seeds:.1f}" for count in counts) if seeds else ("", "", "")

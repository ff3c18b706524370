"""Who finds most first sightings at once in the open loop, at every budget."""

from collections.abc import Sequence

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, among, ratio_level
from care_sim.reports.contrasts import GATE_POINTS
from care_sim.reports.findings.contest import Contest, Subject, is_real, told
from care_sim.reports.protocol.differences import MeasuredDifference, PolicyPair
from care_sim.reports.protocol.notes import on_intervals
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.study.run_config import FULL, Row

_FIND = Subject(
    "first sightings",
    "finds most first sightings at once",
    "find most first sightings at once",
    "find equally many first sightings at once",
)


def protocol_findings(rows: Sequence[Row]) -> list[str]:
    """Who finds most first sightings at once in every setting at every budget."""
    shown: list[MeasuredDifference] = []
    found = told(
        _contest(plays, budget, shown)
        for plays in plays_by_setting(rows)
        for budget in plays.budgets
    )
    return [*found, *on_intervals(shown)]


def _contest(plays: SettingPlays, budget: float, shown: list[MeasuredDifference]) -> Contest:
    """The contest of first sightings; what is compared is added to what is `shown`."""
    tallies = {
        policy: own
        for policy in plays.policies
        if is_real(policy, plays.tags) and (own := plays.tallies(policy, budget))
    }
    shared = set.intersection(*map(set, tallies.values())) if tallies else set()
    levels = {
        policy: ratio_level(FIRST_SIGHTING, among(own, shared)).by_event
        for policy, own in tallies.items()
    }
    known = {policy: level for policy, level in levels.items() if level is not None}
    every = among(plays.tallies(FULL, 1.0), shared)
    full = ratio_level(FIRST_SIGHTING, every).by_event
    # Over some of the scenes its share would be of other objects.
    of_full = f", the full scan {full:.1f}%" if full is not None and {*every} == shared else ""

    def difference(ours: str, theirs: str) -> MeasuredDifference | None:
        measured = PolicyPair(ours, theirs, FIRST_SIGHTING).measured(plays, budget)
        shown.extend([measured] if measured else [])
        return measured

    return Contest(
        plays.setting.label,
        budget,
        _FIND,
        "points",
        GATE_POINTS,
        plays.tags,
        known,
        lambda policy: f"{known[policy]:.1f}%{of_full}",
        difference,
    )

"""What a study showed, in plain words: at every budget which policy leads, and whether the best
control does as well.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from care_sim.base.errors import counted, percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, Tallies, among, ratio_level
from care_sim.reports.contrasts import AVOIDED, DETECTION, Measure, contrast, preventable
from care_sim.reports.controls import is_control
from care_sim.reports.formatting import MARKS, ShownDifference, interval
from care_sim.reports.protocol.differences import PolicyPair
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.study.rows.reading import Groups, full_of, grouped, policy_of, tags_of_row
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row

_HINDSIGHT = (
    "First and best control are chosen at each budget by the very results that are compared."
)
_MOST_NAMED = 3
"""So many policies that cannot be told from the first are named; of more, how many they are."""


@dataclass(frozen=True)
class _Contest:
    """Policies at one budget in one setting: `levels` are their means, the highest the best, over
    what all of them have played; `told` says one in words, `difference` holds two against each
    other.
    """

    place: str
    leads: str
    unit: str
    tags: Mapping[str, tuple[str, ...]]
    levels: Mapping[str, float]
    told: Callable[[str], str]
    difference: Callable[[str, str], ShownDifference | None]

    def finding(self) -> Iterator[str]:
        """A sentence on the first of the policies that a car can have; none where it is alone."""
        rivals = [policy for policy in self.levels if not is_control(self.tags[policy])]
        controls = [policy for policy in self.levels if policy not in rivals]
        contenders = [policy for policy in rivals if {*MARKS}.isdisjoint(self.tags[policy])]
        if not contenders or len(contenders) + len(controls) < 2:
            return
        first = max(contenders, key=self.levels.__getitem__)
        others = [policy for policy in contenders if policy != first]
        yield "".join(
            [
                f"{self.place}: {first} {self.leads}, {self.told(first)}",
                self._beside(first, others),
                self._over(first, max(controls, key=self.levels.__getitem__)) if controls else "",
                ".",
            ]
        )

    def _beside(self, first: str, others: Sequence[str]) -> str:
        """Who cannot be told from the first."""
        alike = [policy for policy in others if not self._sign(first, policy)]
        if not alike:
            return "" if not others else ", ahead of every other policy"
        if len(alike) > _MOST_NAMED:
            return f"; {len(alike)} others cannot be told from it"
        return f"; {', '.join(alike)} cannot be told from it"

    def _over(self, first: str, control: str) -> str:
        """What the first has over the best control, which is chosen in hindsight."""
        difference = self.difference(first, control)
        if difference is None:
            return ""
        sign = self._sign(first, control)
        words = {1: "it beats", 0: "it cannot be told from", -1: "it is beaten by"}[sign]
        return f"; {words} the best control, {control} ({interval(difference)} {self.unit})"

    def _sign(self, ours: str, theirs: str) -> int:
        difference = self.difference(ours, theirs)
        if difference is None or not difference.excludes_zero:
            return 0
        return 1 if difference.mean > 0 else -1


def sweep_findings(rows: Sequence[Row], conditions: bool = True) -> list[str]:
    """Who detects farthest in every setting at every budget, and who collides least where a full
    scan would not; without `conditions` in the plain settings alone.
    """
    groups = grouped(rows)
    tags = {policy_of(row): tags_of_row(row) for row in rows}
    places = dict.fromkeys(
        (setting, budget) for setting, policy, budget in groups if policy != FULL
    )
    return _with_hindsight(
        sentence
        for setting, budget in places
        if conditions or not setting.conditions
        for contest in _episodes(groups, tags, setting, budget)
        for sentence in contest.finding()
    )


def protocol_findings(rows: Sequence[Row]) -> list[str]:
    """Who finds most first sightings at once in every setting at every budget."""
    return _with_hindsight(
        sentence
        for plays in plays_by_setting(rows)
        for budget in plays.budgets
        for sentence in _plays(plays, budget).finding()
    )


def _with_hindsight(sentences: Iterable[str]) -> list[str]:
    found = [*sentences]
    return [*found, _HINDSIGHT] if found else []


def _episodes(
    groups: Groups, tags: Mapping[str, tuple[str, ...]], setting: Setting, budget: float
) -> Iterator[_Contest]:
    """The contests of a setting at a budget: first detections, and collisions if there are any."""
    own = {
        policy: rows
        for (of, policy, at), rows in groups.items()
        if (of, at) == (setting, budget) and policy != FULL
    }
    place = f"{setting.label}, {percent(budget)}"

    def metres(policy: str) -> str:
        return f"{_mean(DETECTION, own[policy]):.1f} m on average"

    yield _contest(DETECTION, own, tags, place, "detects farthest", metres)
    threatened = {
        policy: preventable(full, rows) if (full := full_of(groups, setting)) else rows
        for policy, rows in own.items()
    }

    def hit(policy: str) -> str:
        collisions = sum(row["collision"] for row in threatened[policy])
        return f"in {collisions} of {counted(len(threatened[policy]), 'episode')}"

    if any(row["collision"] for rows in threatened.values() for row in rows):
        yield _contest(AVOIDED, threatened, tags, place, "collides least", hit)


def _contest(
    measure: Measure,
    own: Mapping[str, Sequence[Row]],
    tags: Mapping[str, tuple[str, ...]],
    place: str,
    leads: str,
    told: Callable[[str], str],
) -> _Contest:
    # A policy that lacks a hard seed would lead by that.
    shared = set.intersection(*({row["seed"] for row in rows} for rows in own.values()))
    means = {
        policy: _mean(measure, [row for row in rows if row["seed"] in shared])
        for policy, rows in own.items()
    }
    return _Contest(
        place,
        leads,
        measure.unit,
        tags,
        {policy: mean for policy, mean in means.items() if not np.isnan(mean)},
        told,
        lambda ours, theirs: contrast(measure, own[ours], own[theirs]),
    )


def _mean(measure: Measure, rows: Sequence[Row]) -> float:
    """The mean of a measure, an actor never detected counted as in differences; nan of nothing."""
    readings = [reading.value for row in rows if (reading := measure.read(row)) is not None]
    return float(np.mean(readings)) if readings else float("nan")


def _plays(plays: SettingPlays, budget: float) -> _Contest:
    tallies: dict[str, Tallies] = {
        policy: own for policy in plays.policies if (own := plays.tallies(policy, budget))
    }
    shared = set.intersection(*map(set, tallies.values())) if tallies else set()
    levels = {
        policy: ratio_level(FIRST_SIGHTING, among(own, shared)).by_event
        for policy, own in tallies.items()
    }
    known = {policy: level for policy, level in levels.items() if level is not None}
    return _Contest(
        f"{plays.setting.label}, {percent(budget)}",
        "finds most first sightings at once",
        "points",
        plays.tags,
        known,
        lambda policy: f"{known[policy]:.1f}%",
        lambda ours, theirs: PolicyPair(ours, theirs, FIRST_SIGHTING).measured(plays, budget),
    )

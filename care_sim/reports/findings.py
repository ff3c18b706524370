"""What a study showed, in plain words: at every budget who leads, and whether a control does as
well.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from care_sim.base.errors import counted, percent
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, among, ratio_level
from care_sim.reports.contrasts import (
    AVOIDED,
    DETECTION,
    GATE_POINTS,
    Measure,
    contrast,
    preventable,
)
from care_sim.reports.controls import best_control, is_control
from care_sim.reports.formatting import MARKS, ShownDifference, interval
from care_sim.reports.protocol.differences import MeasuredDifference, PolicyPair
from care_sim.reports.protocol.notes import on_intervals
from care_sim.reports.protocol.rows import SettingPlays, plays_by_setting
from care_sim.study.rows.reading import Groups, full_of, grouped, policy_of, tags_of_row
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row

_HINDSIGHT = (
    "Who is first, and the best control, are chosen at each budget by the very results that are "
    "compared, which favours whoever is chosen; the number of comparisons is not corrected for."
)
_TOO_FEW = f"Who leads is told from {FEWEST_PAIRS} seeds on."
_MOST_NAMED = 4
"""So many policies are named in a row; of more, how many they are."""
_Tags = Mapping[str, tuple[str, ...]]


class _Verb(NamedTuple):
    """What the first of a contest does, or the first of several, or all alike."""

    one: str
    several: str
    all: str


_DETECT = _Verb("detects farthest", "detect farthest", "detect equally far")
_COLLIDE = _Verb("collides least", "collide least", "collide equally often")
_FIND = _Verb(
    "finds most first sightings at once",
    "find most first sightings at once",
    "find equally many first sightings at once",
)


@dataclass(frozen=True)
class _Contest:
    """The policies that a car can have, controls too, at one budget in one setting, over what all
    of them have played.

    `levels` are means, the highest the best; `told` says one in words. `difference` holds two
    against each other, and counts from `gate` on.
    """

    place: str
    verb: _Verb
    unit: str
    gate: float
    tags: _Tags
    levels: Mapping[str, float]
    told: Callable[[str], str]
    difference: Callable[[str, str], ShownDifference | None]

    def findings(self) -> Iterator[str]:
        """One sentence, or none where there is nobody to compare."""
        others = [policy for policy in self.levels if not is_control(self.tags[policy])]
        controls = [policy for policy in self.levels if policy not in others]
        if not others or len(self.levels) < 2:
            return
        first = max(self.levels, key=self.levels.__getitem__)
        over = {policy: self.difference(first, policy) for policy in self.levels if policy != first}
        tied = [first, *(policy for policy, each in over.items() if _is_nothing(each))]
        if len(tied) == len(self.levels):
            with_controls = ", controls included" if controls else ""
            yield (
                f"{self.place}: all {len(tied)} policies {self.verb.all}, "
                f"{self.told(first)}{with_controls}."
            )
            return
        alike = [p for p, each in over.items() if p not in tied and not _is_ahead(each)]
        close = [p for p, each in over.items() if _is_ahead(each) and self._is_little(each)]
        leads = self.verb.one if len(tied) == 1 else self.verb.several
        parts = [f"{self.place}: {_names(tied)} {leads}, {self.told(first)}"]
        if alike:
            them = "it" if len(tied) == 1 else "them"
            parts.append(f"{_names(alike)} cannot be told from {them}")
        if close:
            verb = "is" if len(close) == 1 else "are"
            parts.append(f"{_names(close)} {verb} behind by less than the gate")
        if control := best_control({policy: self.levels[policy] for policy in controls}):
            best = max(others, key=self.levels.__getitem__)
            parts.append(self._beside_control(best, control))
        elif behind := [p for p in others if p not in (*tied, *alike, *close)]:
            second = max(behind, key=self.levels.__getitem__)
            ahead = "it is ahead" if len(tied) == 1 else "they are ahead"
            measured = f"({interval(over[second])}, {self.unit})"
            parts.append(f"{ahead} of the next, {second} {measured}")
        yield f"{'; '.join(parts)}."

    def _beside_control(self, best: str, control: str) -> str:
        """How the best of the others stands to the best control."""
        difference = self.difference(best, control)
        if _is_nothing(difference):
            return f"the best control, {control}, does exactly as well as {best}"
        measured = f"({interval(difference)}, {self.unit})"
        if difference is None or not difference.excludes_zero:
            why = ", for some are never detected" if difference and difference.bound else ""
            return f"{best} and the best control, {control}, cannot be told apart{why} {measured}"
        little = ", by less than the gate" if self._is_little(difference) else ""
        if difference.mean > 0:
            return f"{best} is ahead of the best control, {control}{little} {measured}"
        return f"the best control, {control}, is ahead of {best}{little} {measured}"

    def _is_little(self, difference: ShownDifference | None) -> bool:
        """Whether a difference is surely below the gate: not where a bound alone is known of it."""
        return difference is not None and not difference.bound and abs(difference.mean) < self.gate


def sweep_findings(rows: Sequence[Row], conditions: bool = True) -> list[str]:
    """Who detects farthest in every setting at every budget, and who collides least where a full
    scan would not; without `conditions` in the plain settings alone. Nothing of fewer than
    `FEWEST_PAIRS` seeds that all policies share.
    """
    groups = grouped(rows)
    tags = _tags_of(rows)
    budgets: dict[Setting, set[float]] = {}
    for setting, policy, budget in groups:
        if policy != FULL:
            budgets.setdefault(setting, set()).add(budget)
    found = _with_remarks(
        tags,
        (
            sentence
            for setting, own in budgets.items()
            if conditions or not setting.conditions
            for budget in sorted(own)
            for contest in _episodes(groups, tags, setting, budget)
            for sentence in contest.findings()
        ),
    )
    real = [row for row in rows if _is_real(policy_of(row), tags)]
    several = len({policy_of(row) for row in real}) > 1
    few = several and len({row["seed"] for row in real}) < FEWEST_PAIRS
    return found or ([_TOO_FEW] if few else [])


def protocol_findings(rows: Sequence[Row]) -> list[str]:
    """Who finds most first sightings at once in every setting at every budget."""
    shown: list[MeasuredDifference] = []
    found = _with_remarks(
        _tags_of(rows),
        (
            sentence
            for plays in plays_by_setting(rows)
            for budget in plays.budgets
            for sentence in _plays(plays, budget, shown).findings()
        ),
    )
    return [*found, *on_intervals(shown)]


def _episodes(groups: Groups, tags: _Tags, setting: Setting, budget: float) -> Iterator[_Contest]:
    """The contests of a setting at a budget: first detections, and collisions if there are any."""
    played = {
        policy: rows
        for (of, policy, at), rows in groups.items()
        if (of, at) == (setting, budget) and _is_real(policy, tags)
    }
    if not played:
        return
    # A policy that lacks a hard seed would lead by that.
    shared = set.intersection(*({row["seed"] for row in rows} for rows in played.values()))
    if len(shared) < FEWEST_PAIRS:
        return
    own = {p: [row for row in rows if row["seed"] in shared] for p, rows in played.items()}
    place = f"{setting.label}, {percent(budget)}"
    full = full_of(groups, setting)
    seen = _mean(DETECTION, [row for row in full or () if row["seed"] in shared])
    of_full = "" if seen is None else f", the full scan {seen:.1f} m"
    if any(row["detection_distance_m"] is not None for rows in own.values() for row in rows):
        yield _contest(
            DETECTION, _DETECT, own, tags, place, lambda rows: f"{_metres(rows)}{of_full}"
        )
    threatened = {p: preventable(full, rows) if full else rows for p, rows in own.items()}
    spared = " that the full scan ends unhurt" if full else ""
    if any(row["collision"] for rows in threatened.values() for row in rows):
        yield _contest(
            AVOIDED, _COLLIDE, threatened, tags, place, lambda rows: f"{_hit(rows)}{spared}"
        )


def _contest(
    measure: Measure,
    verb: _Verb,
    own: Mapping[str, Sequence[Row]],
    tags: _Tags,
    place: str,
    told: Callable[[Sequence[Row]], str],
) -> _Contest:
    return _Contest(
        place,
        verb,
        measure.unit,
        measure.gate,
        tags,
        {
            policy: mean
            for policy, rows in own.items()
            if (mean := _mean(measure, rows)) is not None
        },
        lambda policy: told(own[policy]),
        lambda ours, theirs: contrast(measure, own[ours], own[theirs]),
    )


def _mean(measure: Measure, rows: Sequence[Row]) -> float | None:
    """The mean of a measure, an actor never detected counted as in differences; None of nothing."""
    readings = [reading.value for row in rows if (reading := measure.read(row)) is not None]
    return float(np.mean(readings)) if readings else None


def _metres(rows: Sequence[Row]) -> str:
    readings = [reading for row in rows if (reading := DETECTION.read(row)) is not None]
    mean = f"{_mean(DETECTION, rows):.1f} m on average over {counted(len(readings), 'episode')}"
    never = sum(reading.censored for reading in readings)
    # An actor that is never detected has been no nearer than what is counted for it.
    return f"at most {mean} ({never} never)" if never else mean


def _hit(rows: Sequence[Row]) -> str:
    return f"in {sum(row['collision'] for row in rows)} of {counted(len(rows), 'episode')}"


def _plays(plays: SettingPlays, budget: float, shown: list[MeasuredDifference]) -> _Contest:
    """The contest of first sightings; what is compared is added to what is `shown`."""
    tallies = {
        policy: own
        for policy in plays.policies
        if _is_real(policy, plays.tags) and (own := plays.tallies(policy, budget))
    }
    shared = set.intersection(*map(set, tallies.values())) if tallies else set()
    levels = {
        policy: ratio_level(FIRST_SIGHTING, among(own, shared)).by_event
        for policy, own in tallies.items()
    }
    known = {policy: level for policy, level in levels.items() if level is not None}
    full = ratio_level(FIRST_SIGHTING, among(plays.tallies(FULL, 1.0), shared)).by_event
    of_full = "" if full is None else f", the full scan {full:.1f}%"

    def difference(ours: str, theirs: str) -> MeasuredDifference | None:
        measured = PolicyPair(ours, theirs, FIRST_SIGHTING).measured(plays, budget)
        shown.extend([measured] if measured else [])
        return measured

    return _Contest(
        f"{plays.setting.label}, {percent(budget)}",
        _FIND,
        "points",
        GATE_POINTS,
        plays.tags,
        known,
        lambda policy: f"{known[policy]:.1f}%{of_full}",
        difference,
    )


def _is_real(policy: str, tags: _Tags) -> bool:
    """Whether a car can have the policy at a budget."""
    return policy != FULL and {*MARKS}.isdisjoint(tags[policy])


def _is_nothing(difference: ShownDifference | None) -> bool:
    """Whether two are the same in everything that was played; not known of the never detected."""
    if difference is None or difference.interval is None:
        return False
    return not any(difference.interval) and not difference.bound


def _is_ahead(difference: ShownDifference | None) -> bool:
    """Whether the first is surely above the other."""
    return difference is not None and difference.excludes_zero and difference.mean > 0


def _names(policies: Sequence[str]) -> str:
    if len(policies) > _MOST_NAMED:
        return f"{', '.join(policies[:_MOST_NAMED])} and {len(policies) - _MOST_NAMED} more"
    return " and ".join(filter(None, [", ".join(policies[:-1]), policies[-1]]))


def _tags_of(rows: Iterable[Row]) -> _Tags:
    """The tags of every policy that was played."""
    return {policy_of(row): tags_of_row(row) for row in rows}


def _with_remarks(tags: _Tags, sentences: Iterable[str]) -> list[str]:
    """The sentences, and among whom they choose; nothing without any."""
    found = [*sentences]
    real = [policy for policy in tags if _is_real(policy, tags)]
    lacking = "" if any(is_control(tags[policy]) for policy in real) else ", no control among them"
    played = f"Compared are the {len(real)} policies played here{lacking}."
    return [*found, played, _HINDSIGHT] if found else []

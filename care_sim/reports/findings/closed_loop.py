"""Who detects farthest and who collides least in the closed loop, at every budget."""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from care_sim.base.errors import counted
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.reports.contrasts import AVOIDED, DETECTION, Measure, contrast, preventable
from care_sim.reports.controls import is_control
from care_sim.reports.findings.contest import Contest, Subject, Tags, is_real, told
from care_sim.study.rows.reading import (
    Groups,
    full_of,
    grouped,
    is_avoided,
    policy_of,
    tags_of_row,
)
from care_sim.study.rows.settings import Setting
from care_sim.study.run_config import FULL, Row

_DETECT = Subject("first detections", "detects farthest", "detect farthest", "detect equally far")
_COLLIDE = Subject("collisions", "collides least", "collide least", "collide equally often")
_TOO_FEW = (
    f"Who leads is told of {FEWEST_PAIRS} seeds and more that all policies share, and not of fewer."
)


def sweep_findings(rows: Sequence[Row], conditions: bool = True) -> list[str]:
    """Who detects farthest in every setting at every budget, and who collides least where a full
    scan would not; without `conditions` in the plain settings alone. Of fewer than `FEWEST_PAIRS`
    seeds that all policies share there is only that they are too few.
    """
    groups = grouped(rows)
    tags = {policy_of(row): tags_of_row(row) for row in rows}
    places = dict.fromkeys(
        (setting, budget)
        for setting, policy, budget in groups
        if policy != FULL and (conditions or not setting.conditions)
    )
    contests: list[Contest] = []
    too_few = False
    for setting in dict.fromkeys(setting for setting, _ in places):
        for budget in sorted(budget for of, budget in places if of == setting):
            played = _played(groups, tags, setting, budget)
            shared = set.intersection(*map(_seeds, played.values())) if played else set()
            if len(shared) >= FEWEST_PAIRS:
                # A policy that lacks a hard seed would lead by that.
                own = {policy: _of(shared, own) for policy, own in played.items()}
                full = _of(shared, full_of(groups, setting) or ())
                contests += _contests(setting.label, budget, own, full, tags)
            elif len(played) > 1 and not all(is_control(tags[policy]) for policy in played):
                too_few = True
    return told(contests) or ([_TOO_FEW] if too_few else [])


def _played(
    groups: Groups, tags: Tags, setting: Setting, budget: float
) -> dict[str, Sequence[Row]]:
    """The rows of every policy that a car can have."""
    return {
        policy: rows
        for (of, policy, at), rows in groups.items()
        if (of, at) == (setting, budget) and is_real(policy, tags)
    }


def _seeds(rows: Sequence[Row]) -> set[int]:
    return {row["seed"] for row in rows}


def _of(seeds: set[int], rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["seed"] in seeds]


def _contests(
    setting: str,
    budget: float,
    own: Mapping[str, Sequence[Row]],
    full: Sequence[Row],
    tags: Tags,
) -> Iterator[Contest]:
    """The contests over the same seeds: first detections, and collisions if there are any."""
    if any(row["detection_distance_m"] is not None for rows in own.values() for row in rows):
        # Over some of the seeds its mean would be of other worlds.
        beside = {*map(len, own.values())} == {len(full)} and _mean(DETECTION, full) is not None
        of_full = f", the full scan {_far(full)}" if beside else ""
        yield _contest(
            DETECTION, _DETECT, own, tags, setting, budget, lambda rows: f"{_metres(rows)}{of_full}"
        )
    spared = " that the full scan ends unhurt" if full else ""
    threatened = {p: preventable(full, rows) if full else rows for p, rows in own.items()}
    if not all(is_avoided(row) for rows in threatened.values() for row in rows):
        yield _contest(
            AVOIDED,
            _COLLIDE,
            threatened,
            tags,
            setting,
            budget,
            lambda rows: f"{_hit(rows)}{spared}",
        )


def _contest(
    measure: Measure,
    subject: Subject,
    own: Mapping[str, Sequence[Row]],
    tags: Tags,
    setting: str,
    budget: float,
    in_words: Callable[[Sequence[Row]], str],
) -> Contest:
    means = {policy: _mean(measure, rows) for policy, rows in own.items()}
    return Contest(
        setting,
        budget,
        subject,
        measure.unit,
        measure.gate,
        tags,
        {policy: mean for policy, mean in means.items() if mean is not None},
        lambda policy: in_words(own[policy]),
        lambda ours, theirs: contrast(measure, own[ours], own[theirs]),
    )


def _mean(measure: Measure, rows: Sequence[Row]) -> float | None:
    """The mean of a measure, an actor never detected counted as in differences; None of nothing."""
    readings = [reading.value for row in rows if (reading := measure.read(row)) is not None]
    return float(np.mean(readings)) if readings else None


def _far(rows: Sequence[Row]) -> str:
    """The mean distance. An actor that is never detected has been no nearer than what is counted
    for it.
    """
    return f"{'at most ' if _never(rows) else ''}{_mean(DETECTION, rows):.1f} m"


def _never(rows: Sequence[Row]) -> int:
    readings = filter(None, map(DETECTION.read, rows))
    return sum(reading.censored for reading in readings)


def _metres(rows: Sequence[Row]) -> str:
    episodes = sum(DETECTION.read(row) is not None for row in rows)
    never = f" ({_never(rows)} never)" if _never(rows) else ""
    return f"{_far(rows)} on average over {counted(episodes, 'episode')}{never}"


def _hit(rows: Sequence[Row]) -> str:
    return f"in {sum(row['collision'] for row in rows)} of {counted(len(rows), 'episode')}"

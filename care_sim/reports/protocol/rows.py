"""The plays of the first-sighting protocol by setting: what each policy found in every scene."""

from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np

from care_sim.base.errors import counted
from care_sim.core.arrays import Floats
from care_sim.evaluation.bootstrap import Interval, paired_difference
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import (
    FIRST_SIGHTING,
    TTFD,
    Ratio,
    RatioLevel,
    SceneShare,
    Tallies,
    ratio_level,
    scene_share,
)
from care_sim.evaluation.strata import ENTRY, NEWCOMERS
from care_sim.reports.engine.contrasts import Contrast, of_interval
from care_sim.reports.engine.frames import Frame, by_floor_seed
from care_sim.reports.engine.measures import OPEN_LOOP, Measure, Recall, loop_of, tally_of
from care_sim.reports.engine.parts import Part, parts
from care_sim.study.rows.reading import Setting
from care_sim.study.run_config import FULL, Row

HISTORY = "history"
"""The policy that every other is compared with."""
# The mean over floor seeds comes first: the seeds of an event are no further events. An event
# counts as found at first sight where its TTFD is 0.
_OF_EVENTS: dict[Measure | Recall, Callable[[Floats], Floats]] = {
    Recall(FIRST_SIGHTING): lambda delays: np.mean(100.0 * (delays == 0), axis=0),
    Recall(TTFD): lambda delays: np.mean(delays, axis=0),
}
"""(e,) the measure of every event from (floor seeds, e) delays."""


class SettingPlays(Part):
    """The plays of one setting, floor seeds averaged per scene. `scenes` holds one row of every
    scene.
    """

    def __init__(self, frame: Frame, setting: Setting):
        super().__init__(frame, setting)
        self.scenes = frame.scenes[setting]

    @property
    def title(self) -> str:
        """The setting and the number of its scenes."""
        return f"{self.setting.label}: {counted(len(self.scenes), 'scene')}"

    def other_than(self, base: str) -> tuple[str, ...]:
        """All but one and the full scan; none where that one was not played."""
        return tuple(policy for policy in self.tags if policy != base) if base in self.tags else ()

    def seeds(self, policy: str, budget: float) -> list[Tallies]:
        """The tallies of every floor seed."""
        return by_floor_seed(self.rows(policy, budget))

    def tallies(self, policy: str, budget: float, within: str = "") -> Tallies:
        """Return the mean tally over floor seeds of every scene that has all of them. It covers all
        events, one stratum ("range/below 20 m"), or one kind of newcomers ("emerging").
        """
        return self.frame.tallies(self.key(policy, budget), within)

    def level(self, ratio: Ratio, policy: str, budget: float, within: str = "") -> RatioLevel:
        """A measure over all scenes of the policy."""
        return ratio_level(ratio, self.tallies(policy, budget, within))

    def share_of_full(
        self, ratio: Ratio, policy: str, budget: float, within: str = ""
    ) -> SceneShare | None:
        """A recall in % of the full scan's, of the scenes that both have; None where the full scan
        was not played or found nothing.
        """
        return scene_share(
            ratio, self.tallies(policy, budget, within), self.tallies(FULL, 1.0, within)
        )

    def contrast(
        self, measure: Measure | Recall, ours: str, theirs: str, budget: float
    ) -> Contrast | None:
        """One policy minus another at a budget, paired by scene; in a measure of all events by
        event, where scenes are few.
        """
        found = super().contrast(measure, ours, theirs, budget)
        if found is None or found.interval or measure not in _OF_EVENTS:
            return found
        # Scenes are the unit that is resampled, because the events of one scene are not
        # independent. Too few scenes give no interval, and events replace them as the unit. Both
        # policies have the same events in a scene, in the same order, so that the joined arrays are
        # paired event by event.
        shared = sorted({*self.tallies(ours, budget)} & {*self.tallies(theirs, budget)})
        events = [
            np.concatenate(
                [_OF_EVENTS[measure](self.delays(policy, budget, scene)) for scene in shared]
            )
            for policy in (ours, theirs)
        ]
        if len(events[0]) < FEWEST_PAIRS:
            return found
        _, low, high = paired_difference(*events)
        return of_interval(
            measure, Interval(found.mean, low, high), len(events[0]), over_events=True
        )

    def delays(self, policy: str, budget: float, scene: str) -> Floats:
        """(floor seeds, events) censored TTFD in keyframes of a scene's events."""
        return np.array(
            [row["ttfds"] for row in self.rows(policy, budget) if row["scene"] == scene], float
        )

    @cached_property
    def strata(self) -> dict[str, list[str]]:
        """The labels of the strata by kind, of the kinds that all rows have."""
        kinds: dict[str, list[str]] = {}
        own = [
            row for key, rows in self.frame.groups.items() if key[0] == self.setting for row in rows
        ]
        for name in (name for name in own[0] if name.endswith("/events")):
            kind, label, _ = name.split("/")
            kinds.setdefault(kind, []).append(label)
        # Rows of older versions lack kinds.
        return {
            kind: labels
            for kind, labels in kinds.items()
            if all(
                f"{kind}/{label}/events" in row for row in (*own, *self.full) for label in labels
            )
        }

    @cached_property
    def newcomers(self) -> dict[str, float]:
        """The events of each of the two kinds of newcomers; none where rows do not tell."""
        if ENTRY not in self.strata:
            return {}
        return {kind: self.counted(FIRST_SIGHTING, kind) for kind in NEWCOMERS}

    def counted(self, ratio: Ratio, within: str = "") -> float:
        """How many events or object frames a measure is of, in all scenes."""
        return sum(ratio.denominator(tally_of(row, within)) for row in self.scenes.values())


def plays_by_setting(rows: Sequence[Row]) -> list[SettingPlays]:
    """The plays of every setting in the order of their first rows; the full scan alone makes none
    where others do. Raises InvalidInput as `Frame` does.
    """
    frame = Frame(rows)
    plays = [SettingPlays(frame, setting) for setting in frame.scenes]
    # The full scans alone are no setting to report, unless nothing else was played.
    return [each for each in plays if each.tags] or plays


def settings(rows: Sequence[Row], plain: bool = False) -> Sequence[Part]:
    """The settings of a study of either loop; `plain` ones are under no condition, or all where
    each has some.
    """
    if loop_of(rows) is OPEN_LOOP:
        found: Sequence[Part] = plays_by_setting(rows)
    else:
        found = [part for part in parts(rows) if part.tags]
    return (plain and [part for part in found if not part.setting.conditions]) or found

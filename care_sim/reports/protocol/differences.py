"""How much more one policy found than another, and how sure that is: by scenes, or by events where
scenes are few.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from care_sim.core.arrays import Floats
from care_sim.evaluation.bootstrap import Interval, paired_difference
from care_sim.evaluation.censoring import FEWEST_PAIRS
from care_sim.evaluation.scene_contrasts import (
    FIRST_SIGHTING,
    OVERALL,
    TTFD,
    Ratio,
    SceneContrast,
    Tallies,
    scene_contrast,
)
from care_sim.reports.protocol.rows import HISTORY, SettingPlays
from care_sim.study.run_config import REFERENCE

RATIOS = (FIRST_SIGHTING, OVERALL, TTFD)
HEADINGS = {FIRST_SIGHTING: "First sightings", OVERALL: "Overall recall", TTFD: "Censored TTFD"}
OVER_EVENTS = "°"
"""Stands behind a difference whose interval comes from events."""


@dataclass(frozen=True)
class MeasuredDifference:
    """A difference in the unit of `ratio`; `interval` is None where too little was played for one.

    The interval comes from resampling scenes, or `over_events` from resampling the events of the
    scenes played.
    """

    ratio: Ratio
    mean: float
    interval: Interval | None
    over_events: bool = False

    @property
    def sign(self) -> int:
        """1 or -1 where the interval excludes zero, else 0."""
        if self.interval is None:
            return 0
        # An interval that ends at zero holds it.
        return int(self.interval.low > 0) - int(self.interval.high < 0)

    @property
    def excludes_zero(self) -> bool:
        """Whether there is an interval and it excludes zero."""
        return self.sign != 0

    @property
    def decimals(self) -> int:
        """Decimals of the measure."""
        return decimals_of(self.ratio)

    @property
    def bound(self) -> str:
        """Empty: recall has no censored values."""
        return ""

    @property
    def asterisk(self) -> str:
        """Empty: the gate of the protocol is told in its closing sentences."""
        return ""

    @property
    def suffix(self) -> str:
        """The mark of an interval over events."""
        return OVER_EVENTS if self.over_events else ""


def decimals_of(ratio: Ratio) -> int:
    """Decimals of a recall in % and of TTFD in keyframes."""
    return 2 if ratio is TTFD else 1


class Comparison(Protocol):
    """Anything that can be measured of a setting at a budget and set beside what the paper says of
    it.
    """

    @property
    def heading(self) -> str:
        """What is measured."""
        ...

    @property
    def label(self) -> str:
        """What is compared."""
        ...

    @property
    def policies(self) -> tuple[str, ...]:
        """The policies that must have been played."""
        ...

    def measured(self, plays: SettingPlays, budget: float) -> MeasuredDifference | None:
        """What was measured, None without plays."""
        ...


@dataclass(frozen=True)
class PolicyPair:
    """`first` less `second`, of all or `within` a stratum or a kind of newcomers; with
    `equal_scenes` every scene weighs the same.
    """

    first: str
    second: str
    ratio: Ratio
    within: str = ""
    equal_scenes: bool = False

    @property
    def heading(self) -> str:
        """The measure, the stratum, the weights."""
        within = [self.within.rpartition("/")[2]] if self.within else []
        return ", ".join(
            [HEADINGS[self.ratio], *within, *(["equal scenes"] if self.equal_scenes else [])]
        )

    @property
    def label(self) -> str:
        """The two policies."""
        return f"{self.first} minus {self.second}"

    @property
    def policies(self) -> tuple[str, ...]:
        """The two policies."""
        return self.first, self.second

    def measured(self, plays: SettingPlays, budget: float) -> MeasuredDifference | None:
        """Paired by scene, on the scenes that both policies have."""
        found = self._contrast(plays, budget)
        if found is None:
            return None
        by = found.by_scene if self.equal_scenes else found.by_event
        # Scenes are the unit that is resampled, because the events of one scene are not
        # independent. Of fewer scenes no interval is printed, and events stand in for them where
        # they can.
        if found.scenes >= FEWEST_PAIRS:
            return MeasuredDifference(self.ratio, by.mean, by)
        by_events = None if self.within or self.equal_scenes else _by_events(self, plays, budget)
        return MeasuredDifference(self.ratio, by.mean, by_events, over_events=by_events is not None)

    def _contrast(self, plays: SettingPlays, budget: float) -> SceneContrast | None:
        ours, theirs = (plays.tallies(policy, budget, self.within) for policy in self.policies)
        return scene_contrast(self.ratio, ours, theirs)


def reference_pairs(
    plays: SettingPlays, ratio: Ratio = FIRST_SIGHTING, within: str = ""
) -> list[PolicyPair]:
    """CARE less history and less all-camera, where played."""
    bases = (HISTORY, "all-camera")
    return [PolicyPair(REFERENCE, base, ratio, within) for base in bases if base in plays.others]


def difference_between(ratio: Ratio, ours: Tallies, theirs: Tallies) -> MeasuredDifference | None:
    """`ours` less `theirs`, paired by scene; None without a shared one."""
    found = scene_contrast(ratio, ours, theirs)
    if found is None:
        return None
    return MeasuredDifference(
        ratio, found.by_event.mean, found.by_event if found.scenes >= FEWEST_PAIRS else None
    )


def _by_events(pair: PolicyPair, plays: SettingPlays, budget: float) -> Interval | None:
    """The interval from resampling events, paired and averaged over floor seeds; overall recall has
    none.
    """
    if pair.ratio is OVERALL:
        return None
    # Both policies have the same events in a scene, in the same order, so that the joined arrays
    # are paired event by event.
    scenes = sorted(
        set(plays.tallies(pair.first, budget)) & set(plays.tallies(pair.second, budget))
    )
    ours, theirs = (
        np.concatenate(
            [_of_events(pair.ratio, plays.delays(policy, budget, scene)) for scene in scenes]
        )
        for policy in pair.policies
    )
    return paired_difference(ours, theirs) if len(ours) >= FEWEST_PAIRS else None


def _of_events(ratio: Ratio, delays: Floats) -> Floats:
    """(e,) the measure of every event, from (floor seeds, e) TTFD."""
    # An event counts as found at first sight where its TTFD is 0. The mean over floor seeds comes
    # first: the seeds of an event are no further events.
    means: Floats = np.mean(delays if ratio is TTFD else ratio.scale * (delays == 0), axis=0)
    return means

"""Comparisons of the paper, measured on plays: two policies, or CARE less all-camera in scenes of
little and of much traffic (Sec. 5.2).
"""

from dataclasses import dataclass

import numpy as np

from care_sim.evaluation.scene_contrasts import Ratio, among, contrast_gap
from care_sim.evaluation.strata import thirds
from care_sim.reports.engine.contrasts import Contrast, contrast, of_interval
from care_sim.reports.engine.measures import HEADINGS, Recall
from care_sim.reports.protocol.rows import HISTORY, SettingPlays
from care_sim.study.run_config import REFERENCE

ALL_CAMERA = "all-camera"
RANKINGS = {"tracks": "Tracked objects", "explained": "Explained detections"}
"""Quantities per keyframe of the columns that rank scenes."""
FEWEST_SCENES = 9
"""Three in each third: a smaller third would speak of one or two scenes, not of crowded ones."""
DENSE_LESS_SPARSE = "dense minus sparse"


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
    def measure(self) -> Recall:
        """Return the measure that is compared."""
        return Recall(self.ratio, self.within, self.equal_scenes)

    @property
    def heading(self) -> str:
        """The measure, the stratum, the weights."""
        return self.measure.heading

    @property
    def label(self) -> str:
        """The two policies."""
        return f"{self.first} minus {self.second}"

    @property
    def policies(self) -> tuple[str, str]:
        """The two policies."""
        return self.first, self.second

    def measured(self, plays: SettingPlays, budget: float) -> Contrast | None:
        """Paired by scene, on the scenes that both policies have."""
        return plays.contrast(self.measure, *self.policies, budget)


@dataclass(frozen=True)
class SceneThird:
    """CARE less all-camera in a third of the scenes, or in the dense third less the sparse.

    `ranked_by` is the column of CARE's plays by which scenes are ranked.
    """

    which: str
    ranked_by: str
    ratio: Ratio
    policies = (REFERENCE, ALL_CAMERA)

    @property
    def heading(self) -> str:
        """The measure, and what scenes are ranked by."""
        return f"{HEADINGS[self.ratio]}, by {self.ranked_by}"

    @property
    def label(self) -> str:
        """The third."""
        return self.which if self.which == DENSE_LESS_SPARSE else f"{self.which} third"

    def measured(self, plays: SettingPlays, budget: float) -> Contrast | None:
        """None with fewer than three scenes per third."""
        # The thirds are those of CARE at this budget for both policies, so that each scene is
        # compared with itself.
        groups = thirds(means(plays, self.ranked_by, budget))
        if sum(map(len, groups.values())) < FEWEST_SCENES:
            return None
        ours, theirs = (plays.tallies(policy, budget) for policy in self.policies)
        parts = {
            name: contrast(Recall(self.ratio), among(ours, scenes), theirs)
            for name, scenes in groups.items()
        }
        if self.which != DENSE_LESS_SPARSE:
            return parts[self.which]
        gap = contrast_gap(self.ratio, ours, theirs, groups["dense"], groups["sparse"])
        # Where one of the thirds has too few scenes for an interval of its own, that of the gap
        # says nothing.
        sides = parts["dense"], parts["sparse"]
        fewest = min(part.difference.pairs if part else 0 for part in sides)
        return of_interval(Recall(self.ratio), gap, fewest) if gap else None


Comparison = PolicyPair | SceneThird
"""Measurements of a setting at a budget that can be compared with the paper."""


def reference_pairs(plays: SettingPlays, ratio: Ratio, within: str = "") -> list[PolicyPair]:
    """CARE less history and less all-camera, where played."""
    others = plays.other_than(REFERENCE)
    bases = [base for base in (HISTORY, ALL_CAMERA) if base in others]
    return [PolicyPair(REFERENCE, base, ratio, within) for base in bases]


def means(plays: SettingPlays, column: str, budget: float) -> dict[str, float]:
    """Return what CARE held in every scene (`tracks`, `explained`), averaged over floor seeds."""
    values: dict[str, list[float]] = {scene: [] for scene in plays.tallies(REFERENCE, budget)}
    for row in plays.rows(REFERENCE, budget):
        # A scene that not all floor seeds have played is in no tally, and is left out here too.
        if row["scene"] in values:
            values[row["scene"]].append(row[column])
    return {scene: float(np.mean(seeds)) for scene, seeds in values.items()}

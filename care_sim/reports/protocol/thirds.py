"""What CARE gains over all-camera in scenes of little and of much traffic (paper, Sec. 5.2)."""

from dataclasses import dataclass

import numpy as np

from care_sim.evaluation.scene_contrasts import Ratio, among, contrast_gap
from care_sim.evaluation.strata import thirds
from care_sim.reports.engine.contrasts import Contrast, contrast, of_interval
from care_sim.reports.engine.measures import HEADINGS, Recall
from care_sim.reports.protocol.rows import SettingPlays
from care_sim.study.run_config import REFERENCE

RANKINGS = {"tracks": "Tracked objects", "explained": "Explained detections"}
"""What the columns count by which scenes are ranked, per keyframe."""
FEWEST_SCENES = 9
"""Three in each third: a smaller third would speak of one or two scenes, not of crowded ones."""
DENSE_LESS_SPARSE = "dense minus sparse"


@dataclass(frozen=True)
class SceneThird:
    """CARE less all-camera in a third of the scenes (paper, Sec. 5.2), or in the dense third less
    the sparse.

    `ranked_by` is the column of CARE's plays by which scenes are ranked.
    """

    which: str
    ranked_by: str
    ratio: Ratio
    policies = (REFERENCE, "all-camera")

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
        groups = thirds(means(plays, self.ranked_by, budget))
        if sum(map(len, groups.values())) < FEWEST_SCENES:
            return None
        ours, theirs = (plays.tallies(policy, budget) for policy in self.policies)
        measure = Recall(self.ratio)
        # The thirds are those of CARE at this budget for both policies, so that each scene is
        # compared with itself.
        if self.which != DENSE_LESS_SPARSE:
            return contrast(measure, among(ours, groups[self.which]), theirs)
        dense, sparse = groups["dense"], groups["sparse"]
        gap = contrast_gap(self.ratio, ours, theirs, dense, sparse)
        parts = [contrast(measure, among(ours, some), theirs) for some in (dense, sparse)]
        # Where one of the thirds has too few scenes for an interval of its own, that of the gap
        # says nothing.
        fewest = min(part.difference.pairs if part else 0 for part in parts)
        return of_interval(measure, gap, fewest) if gap else None


def means(plays: SettingPlays, column: str, budget: float) -> dict[str, float]:
    """What CARE held in every scene (`tracks`, `explained`), averaged over floor seeds."""
    values: dict[str, list[float]] = {scene: [] for scene in plays.tallies(REFERENCE, budget)}
    for row in plays.rows(REFERENCE, budget):
        # A scene that not all floor seeds have played is in no tally, and is left out here too.
        if row["scene"] in values:
            values[row["scene"]].append(row[column])
    return {scene: float(np.mean(seeds)) for scene, seeds in values.items()}

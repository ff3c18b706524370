"""What CARE gains over all-camera in scenes of little and of much traffic (paper, Sec. 5.2)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from care_sim.evaluation.scene_contrasts import Ratio, Tallies, among, contrast_gap
from care_sim.reports.protocol.differences import HEADINGS, MeasuredDifference, difference_between
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

    def measured(self, plays: SettingPlays, budget: float) -> MeasuredDifference | None:
        """None with fewer than three scenes per third."""
        groups = plays.thirds(self.ranked_by, budget)
        if sum(map(len, groups.values())) < FEWEST_SCENES:
            return None
        ours, theirs = (plays.tallies(policy, budget) for policy in self.policies)
        # The thirds are those of CARE at this budget for both policies, so that each scene is
        # compared with itself.
        if self.which != DENSE_LESS_SPARSE:
            return difference_between(self.ratio, among(ours, groups[self.which]), theirs)
        return _dense_less_sparse(self.ratio, ours, theirs, groups)


def _dense_less_sparse(
    ratio: Ratio, ours: Tallies, theirs: Tallies, groups: Mapping[str, Sequence[str]]
) -> MeasuredDifference | None:
    interval = contrast_gap(ratio, ours, theirs, groups["dense"], groups["sparse"])
    if interval is None:
        return None
    # The two thirds are measured only to ask whether each has scenes enough for an interval of its
    # own. Where one has not, that of the gap says nothing.
    thirds = [
        difference_between(ratio, among(ours, groups[which]), theirs)
        for which in ("dense", "sparse")
    ]
    enough = all(third and third.interval for third in thirds)
    return MeasuredDifference(ratio, interval.mean, interval if enough else None)

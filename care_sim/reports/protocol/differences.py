"""The differences of two policies that the protocol shows, and the paper gives."""

from dataclasses import dataclass

from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, TTFD, Ratio
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.measures import Recall
from care_sim.reports.protocol.rows import HISTORY, SettingPlays
from care_sim.reports.protocol.thirds import SceneThird
from care_sim.study.run_config import REFERENCE

RATIOS = (FIRST_SIGHTING, OVERALL, TTFD)


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
        """What is compared."""
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


Comparison = PolicyPair | SceneThird
"""What can be measured of a setting at a budget and set beside what the paper says of it."""


def reference_pairs(
    plays: SettingPlays, ratio: Ratio = FIRST_SIGHTING, within: str = ""
) -> list[PolicyPair]:
    """CARE less history and less all-camera, where played."""
    others = plays.other_than(REFERENCE)
    bases = [base for base in (HISTORY, "all-camera") if base in others]
    return [PolicyPair(REFERENCE, base, ratio, within) for base in bases]

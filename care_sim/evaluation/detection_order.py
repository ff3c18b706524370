"""Which of two policies detected an event first (paper, Sec. 5.5: earlier, later, tied)."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

from care_sim.base.errors import InvalidInput


@dataclass(frozen=True)
class DetectionOrder:
    """Events that the first policy detected earlier, later, or at the same keyframe as the second;
    they add. Two that never detect it within the censoring time are tied.
    """

    earlier: int = 0
    later: int = 0
    tied: int = 0

    def __add__(self, other: "DetectionOrder") -> "DetectionOrder":
        return DetectionOrder(
            *(getattr(self, column.name) + getattr(other, column.name) for column in fields(self))
        )


def detection_order(ours: Sequence[int], theirs: Sequence[int]) -> DetectionOrder:
    """Compare the censored times to first detection, in keyframes, event by event. Raises
    InvalidInput for unequal lengths.
    """
    if len(ours) != len(theirs):
        raise InvalidInput(f"delays must be of the same events, got {len(ours)} and {len(theirs)}")
    leads = [their - our for our, their in zip(ours, theirs, strict=True)]
    return DetectionOrder(
        sum(lead > 0 for lead in leads),
        sum(lead < 0 for lead in leads),
        sum(lead == 0 for lead in leads),
    )

"""A keyframe of the open loop with what it found, for scoring and for people."""

from dataclasses import dataclass

from care_sim.core.arrays import Mask
from care_sim.core.grid import Cells
from care_sim.loops.open_loop import OpenLoopKeyframe


@dataclass(frozen=True)
class SceneKeyframe:
    """What a keyframe found of the annotated objects (n,) of its shot: which were `found`, which
    are `scored`, within range, and which are `appearing`, their first sighting. `time_s` is from
    the start; `record` is None before the first scan.

    Truth: never for a policy.
    """

    time_s: float
    record: OpenLoopKeyframe | None
    found: Mask
    scored: Mask
    appearing: Mask

    @property
    def index(self) -> int:
        """The number of the keyframe, from 0."""
        return self.record.index if self.record else 0

    @property
    def fired(self) -> Cells | None:
        """The cells that fired, each as often as it was fired."""
        return self.record.fired if self.record else None

    @property
    def objects(self) -> int:
        """How many objects are scored."""
        return int(self.scored.sum())

    @property
    def objects_found(self) -> int:
        """How many of them were found."""
        return int((self.found & self.scored).sum())

    @property
    def entries(self) -> int:
        """How many appear for the first time."""
        return int(self.appearing.sum())

    @property
    def entries_found(self) -> int:
        """How many of these were found at once."""
        return int((self.found & self.appearing).sum())

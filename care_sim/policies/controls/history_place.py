"""A control: history with its reserve on the map of `place`, without a camera."""

from os import PathLike

from care_sim.core.rig import Rig
from care_sim.policies.controls.history_pattern import HistoryPattern
from care_sim.policies.controls.place import Place


class HistoryPlace(HistoryPattern):
    """The hulls of the history policy; the reserve goes to the map of `place`."""

    name = "history-place"
    tags = ("causal", "learned", "control")
    source = "own: history, and a map that never changes"

    def __init__(self, rig: Rig, path: str | PathLike[str] | None = None):
        super().__init__(Place(rig, path))

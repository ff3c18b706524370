"""A control: history with its reserve on the pattern `rows`, without a camera."""

from care_sim.core.rig import Rig
from care_sim.policies.controls.history_pattern import HistoryPattern
from care_sim.policies.controls.rows import Rows


class HistoryRows(HistoryPattern):
    """The hulls of the history policy; the reserve goes to the rows at which things enter the
    range. What CARE must beat to show that its camera matters.
    """

    name = "history-rows"
    tags = ("causal", "control")
    source = "own: history, and a pattern that never changes"

    def __init__(self, rig: Rig):
        super().__init__(Rows(rig))

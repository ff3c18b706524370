"""A control: history with its reserve on the map of `learned-place`, without a camera."""

from collections.abc import Mapping
from typing import ClassVar

from care_sim.core.rig import Rig
from care_sim.policies.controls.history_pattern import HistoryPattern
from care_sim.policies.controls.learned_place import LearnedPlace
from care_sim.scenarios.base import Scenario


class HistoryLearnedPlace(HistoryPattern):
    """The hulls of the history policy; the reserve goes to the map of `learned-place`, of which it
    has the parameters.
    """

    name = "history-learned-place"
    tags = ("causal", "learned", "control")
    source = "own: history, and a map of the scenario's training seeds that never changes"
    told: ClassVar[Mapping[str, str]] = {"scenario": "scenario"}

    def __init__(self, rig: Rig, scenario: Scenario | str | None = None, seeds: int = 10):
        super().__init__(LearnedPlace(rig, scenario, seeds))

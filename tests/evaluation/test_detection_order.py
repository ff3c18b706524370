import pytest

from care_sim.base.errors import InvalidInput
from care_sim.evaluation.differences import DetectionOrder, detection_order


def test_five_events_by_hand():
    """Two that neither finds are tied."""
    order = detection_order([0, 2, 6, 3, 6], [1, 1, 6, 3, 0])
    assert order == DetectionOrder(earlier=1, later=2, tied=2)
    assert order + DetectionOrder(1, 1, 1) == DetectionOrder(2, 3, 3)


def test_events_of_another_scene_are_refused():
    with pytest.raises(InvalidInput, match="must be of the same events, got 1 and 2"):
        detection_order([0], [0, 1])

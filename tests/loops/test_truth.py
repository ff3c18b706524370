"""Which object a track is, told to the privileged: two objects that are now at 100 and 200 m."""

import numpy as np

from care_sim.loops.truth import TrueLoop
from care_sim.sensors.annotated import NO_OBJECT

PRESENT = {30: np.full(7, 100.0), 7: np.full(7, 200.0), NO_OBJECT: np.full(7, 300.0)}


class Noted(TrueLoop):
    """A loop in which tracks were detected on objects, pair after pair."""

    def __init__(self, *pairs):
        super().__init__()
        for tracks, objects in pairs:
            self._note(np.array(tracks), np.array(objects))

    def full_scan(self):
        raise NotImplementedError

    def _present(self, objects):
        return PRESENT


def places(loop, tracks):
    """Where the objects behind the tracks are; -1 where the forecast was kept."""
    boxes = loop.true_boxes(tracks)
    return [
        -1 if np.array_equal(box, kept) else box[0]
        for box, kept in zip(boxes, tracks.boxes, strict=True)
    ]


def test_a_track_is_where_its_object_is_and_one_without_stays(tracks_at):
    tracks = tracks_at(*[("car", x, 0.0, 0.0, 0.0) for x in (1.0, 2.0, 3.0, 4.0)])
    known = Noted(([0, 1, 2], [7, 30, NO_OBJECT]))
    assert places(known, tracks) == [200, 100, -1, -1]


def test_the_last_detection_counts_and_the_gone_stay_at_their_forecast(tracks_at):
    tracks = tracks_at(("car", 1.0, 0.0, 0.0, 0.0), ("car", 2.0, 0.0, 0.0, 0.0))
    assert places(Noted(([0, 1], [7, 7]), ([0], [30])), tracks) == [100, 200]
    assert places(Noted(([0, 1], [7, 99])), tracks) == [200, -1]

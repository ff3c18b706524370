"""Which object is behind each track: truth, for the privileged alone."""

from collections.abc import Callable

from care_sim.core.frames import Floats
from care_sim.core.grid import Cells
from care_sim.core.types import Tracks


class Identities:
    """Remembers the object that every track was last detected on."""

    def __init__(self) -> None:
        self._objects: dict[int, int] = {}

    def note(self, tracks: Cells, objects: Cells) -> None:
        """The tracks (n,) were detected on `objects` (n,)."""
        self._objects.update(zip(tracks.tolist(), objects.tolist(), strict=True))

    def boxes(self, tracks: Tracks, boxes_of: Callable[[list[int]], dict[int, Floats]]) -> Floats:
        """(n, 7) where the objects behind forecasts are now; a track without one keeps its
        forecast.

        `boxes_of` gives the present sensor-frame boxes of objects, without those that are nowhere.
        """
        boxes = tracks.boxes.copy()
        known = [
            (row, self._objects[track])
            for row, track in enumerate(tracks.ids.tolist())
            if track in self._objects
        ]
        present = boxes_of([number for _, number in known])
        for row, number in known:
            boxes[row] = present.get(number, boxes[row])
        return boxes

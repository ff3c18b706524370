"""A window: neighbouring rows or columns, which fire together and move as one."""

from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.compiled import compiled
from care_sim.core.arrays import Integers, Mask
from care_sim.core.firing.base import Floor, Hardware, ranked
from care_sim.core.grid import Cells


class Window(Hardware):
    """A window over neighbouring units, as wide as the budget.

    A demand is projected in its own order: cell by cell, the window is held to places that hold the
    cell as well as those before it. A cell that no such place holds is passed over. Of the places
    that are left the window takes the one nearest to where it stood, and so it stays where nothing
    is demanded. It always fires as a whole: there is nothing left for the floor.
    """

    def fire(self, scores: NDArray[Any], budget: int, floor: Floor, last: Cells) -> Cells:
        """The window that serves the demand."""
        width = budget // self.unit_cells
        fired = np.zeros(self.units, np.bool_)
        fired[self.unit_of[last]] = True
        # No window and one over everything stand still.
        if 0 < width < self.units:
            places = self._places(self._stood(fired, width), width)
            first = _best_place(ranked(scores), self.unit_of, places, width, self.units)
            fired[:] = False
            fired[np.arange(first, first + width) % self.units] = True
        else:
            fired[:] = width > 0
        return np.flatnonzero(fired[self.unit_of])

    @abstractmethod
    def _places(self, stood: int, width: int) -> Integers:
        """The first units of all places that the window can take, the nearest to the one where it
        `stood` first, of equals the lower one.
        """

    @abstractmethod
    def _start(self, width: int) -> int:
        """The first unit of the window before the first keyframe."""

    def _stood(self, fired: Mask, width: int) -> int:
        """The first unit of the window that fired last."""
        # The one whose neighbour before it did not fire, over the seam, too.
        begins = np.flatnonzero(fired & ~np.roll(fired, 1))
        return int(begins[0]) if len(begins) else self._start(width)


@compiled()
def _best_place(order: Cells, unit_of: Integers, places: Integers, width: int, units: int) -> int:
    """The first of the `places` that holds the cells `order` as far as any does, each as long as it
    does not lose those before it. The units are counted on a circle; `places` is overwritten.
    """
    asked = np.zeros(units, np.bool_)
    count = len(places)
    for cell in order:
        unit = unit_of[cell]
        if count == 1:
            break
        if asked[unit]:
            continue
        asked[unit] = True

        # Counted first, for the places stay as they are where none of them holds the cell.
        holding = 0
        for place in places[:count]:
            holding += (unit - place) % units < width
        if 0 < holding < count:
            kept = 0
            for place in places[:count]:
                places[kept] = place
                kept += (unit - place) % units < width
            count = holding
    best: int = places[0]
    return best

"""Controls without a camera: a fixed pattern beside the cells of tracks."""

from collections.abc import Mapping
from os import PathLike
from typing import ClassVar

from care_sim.core.belief import Belief
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.controls.patterns import Place, Rows, likeliest_cells
from care_sim.policies.own.care import CORE_FIRST, Round


class HistoryPattern(Policy):
    """History, with the reserve spent on a `pattern`."""

    keeps_order = True

    def __init__(self, pattern: Policy):
        super().__init__(pattern.rig)
        self._pattern = pattern

    def demand(self, belief: Belief) -> Demand:
        """Return the hulls, then the pattern."""
        hulls = self.rig.listed(self.rig.hulls(belief.tracks.boxes))
        return Demand(hulls, self._pattern.demand(belief).layers)


class HistoryPlace(HistoryPattern):
    """History, with the reserve spent on the map of `place`."""

    name = "history-place"
    tags = ("causal", "learned", "control")
    source = "own: history, and a map that never changes"

    def __init__(self, rig: Rig, path: str | PathLike[str] | None = None):
        super().__init__(Place(rig, path))


class HistoryRows(HistoryPattern):
    """History, with the reserve spent on the rows at which objects enter the range. CARE must beat
    it to show that its camera matters.
    """

    name = "history-rows"
    tags = ("causal", "control")
    source = "own: history, and a pattern that never changes"

    def __init__(self, rig: Rig):
        super().__init__(Rows(rig))


MAP_SHARE = 0.35
"""Share of the budget for the map, before any track. First tried on the streets 0 to 19, which are
scored.
"""


class PlaceHulls(Policy):
    """The likeliest cells of the map `place`, then a few cells of every hull.

    `MAP_SHARE` of the budget goes to the likeliest cells of the map `place`. Two rounds give a few
    cells to every hull, the undilated core first as in `care-spread`. The rest continues down the
    map. A camera policy that serves tracks equally sparingly must beat it.

    `path` is a map as for `place`.
    """

    name = "place-hulls"
    tags = ("causal", "learned", "control")
    source = "own: a map that never changes, and the cores of hulls"
    told: ClassVar[Mapping[str, str]] = {"min_returns": "min_returns"}
    keeps_order = True

    def __init__(
        self,
        rig: Rig,
        path: str | PathLike[str] | None = None,
        min_returns: int = MIN_RETURNS,
    ):
        super().__init__(rig)
        self._round = Round.of(min_returns).hull
        self._map = likeliest_cells(rig, path)

    def demand(self, belief: Belief) -> Demand:
        """Return the layers: the top of the map, a round of hulls, another one, and the map
        again.
        """
        hulls = self.rig.hulls(belief.tracks.boxes)
        few = self.rig.listed(hulls, CORE_FIRST, 2 * self._round)
        return Demand(
            layers=[
                [self._map[: int(MAP_SHARE * belief.budget)]],
                few.part(0, self._round),
                few.part(self._round, 2 * self._round),
                [self._map[: belief.budget]],
            ]
        )

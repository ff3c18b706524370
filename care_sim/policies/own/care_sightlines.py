"""CARE in rounds, with a watch on open lines of sight for what the camera has not told yet."""

from collections.abc import Mapping
from typing import ClassVar

from care_sim.base.checks import check_flag, check_whole
from care_sim.core.belief import Belief
from care_sim.core.cells.sets import CellSets
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.controls.patterns import cells_by_row, entry_cells
from care_sim.policies.own.care_spread import CORE_FIRST, Round
from care_sim.policies.own.sight_lines import SightLines

WEDGE_ROUNDS = 4
"""Rounds that an unexplained wedge gets at most. Chosen on the calibration's streets 1000 to 1007
and on streets 2000 to 2007, none of which is scored."""


class CareSightlines(Policy):
    """`care-spread` with a watch for what no camera box asks for.

    In order of priority: a round of unexplained wedges; the lines of sight ahead along which
    something can drive into the range (`care_sim.policies.own.sight_lines`); a round of hulls; a
    round of explained wedges, since a new object can stand in front of a known one; all lines of
    sight; the rest of the wedges, up to `wedge_rounds` rounds in all, unless the picture is late
    and says where things were; the rest of the row at which things enter the range; more of the
    hulls; and the pattern `rows` in the place of the random floor.

    Each idea can be switched off, to see what it does: `camera` (all wedges), `ahead`, `explained`,
    `sight_lines`, `rows`.
    """

    name = "care-sightlines"
    source = "own: the reserve of CARE in rounds, open lines of sight, rows"
    told: ClassVar[Mapping[str, str]] = {"min_returns": "min_returns"}
    keeps_order = True

    def __init__(
        self,
        rig: Rig,
        min_returns: int = MIN_RETURNS,
        wedge_rounds: int = WEDGE_ROUNDS,
        camera: bool = True,
        ahead: bool = True,
        explained: bool = True,
        sight_lines: bool = True,
        rows: bool = True,
    ):
        super().__init__(rig)
        self._round = Round.of(min_returns)
        check_whole("wedge_rounds", wedge_rounds, 1)
        switches = {
            "camera": camera,
            "ahead": ahead,
            "explained": explained,
            "sight_lines": sight_lines,
            "rows": rows,
        }
        for name, value in switches.items():
            check_flag(name, value)
        self._wedge_most = wedge_rounds * self._round.wedge
        self._uses_camera = camera
        self._looks_ahead = ahead
        self._rechecks = explained
        self._watches = sight_lines
        self._entries = entry_cells(rig)
        self._rows = CellSets.of([cells_by_row(rig)] if rows else [])
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self._lines = SightLines(self.rig, self._entries)

    def remember(self, belief: Belief) -> None:
        """Take in the last scan."""
        self._lines.update(belief)

    def demand(self, belief: Belief) -> Demand:
        """Layers in order of priority; see the class."""
        unexplained, known = camera_layers(belief, self.rig) if self._uses_camera else ([], [])
        few, more = self._round
        wedges = self.rig.listed(unexplained, CORE_FIRST, self._wedge_most)
        rechecked = self.rig.listed(known if self._rechecks else [], CORE_FIRST, few)
        hulls = self.rig.listed(self.rig.hulls(belief.tracks.boxes), CORE_FIRST, few + more)
        return Demand(
            layers=[
                wedges.part(0, more),
                [self._lines.ahead()] if self._looks_ahead else [],
                hulls.part(0, few),
                rechecked,
                [self._lines.cells()] if self._watches else [],
                [] if self._is_late(belief) else wedges.part(more, self._wedge_most),
                self._rows.part(0, len(self._entries)),
                hulls.part(few, few + more),
                self._rows.part(0, belief.budget),
            ]
        )

    def _is_late(self, belief: Belief) -> bool:
        """Whether the newest picture is at least half a keyframe old."""
        ages = belief.detections.ages
        return len(ages) > 0 and bool(ages.min() >= self.rig.keyframe_s / 2)

"""Policies that spend the reserve of CARE in rounds: every set gets the cells of a detection before
any set gets more.
"""

from collections.abc import Mapping
from typing import ClassVar, NamedTuple

from care_sim.base.checks import check_flags, check_whole
from care_sim.core.belief import Belief
from care_sim.core.beliefs import Beliefs
from care_sim.core.cells.sets import CellSets, WorldSets
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.residual import camera_layers, unexplained_layer_of
from care_sim.core.residual import wedges as wedges_of_boxes
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy, RowPolicy
from care_sim.policies.controls.patterns import cells_by_row, entry_cells
from care_sim.policies.own.sight_lines import SightLines, columns_ahead

CORE_FIRST = "core-spread"
"""The default order of the cells in hulls and wedges (`care_sim.core.cells.order`). The rim only
serves errors of the forecast; without errors the object lies in the core.
"""
HULL_CELLS_PER_RETURN = 2
"""Cells per round of a hull, for every return that a detection needs."""
WEDGE_CELLS_PER_RETURN = 3
"""Cells per round of a wedge, for every return that a detection needs. Both numbers were chosen on
the calibration's streets 1000 to 1007 and on streets 2000 to 2007, none of which is scored.
"""


class Round(NamedTuple):
    """The cells that each hull and each wedge gets in a round."""

    hull: int
    wedge: int

    @classmethod
    def of(cls, min_returns: int) -> "Round":
        """Return the round of a detector that needs this many returns. Raises InvalidInput unless
        it is a whole number of at least 1.
        """
        check_whole("min_returns", min_returns, 1)
        return cls(HULL_CELLS_PER_RETURN * min_returns, WEDGE_CELLS_PER_RETURN * min_returns)


class CareSpread(RowPolicy):
    """The reserve of CARE, spent in rounds: every set gets the cells of a detection before any set
    gets more.

    First every unexplained wedge gets a few cells, then every hull; then both get as many again.
    The rest goes to the floor. Sets begin with their undilated core, spread evenly (`core-spread`),
    unless the rig has an order. Everything is in the reserve layers, in order of priority: the
    share rho plays no part. `min_returns` is the number of returns that the proxy needs; other
    detectors use the default.
    """

    name = "care-spread"
    source = "own: the reserve of CARE, core first, in rounds"
    told: ClassVar[Mapping[str, str]] = {"min_returns": "min_returns"}
    keeps_order = True

    def __init__(self, rig: Rig, min_returns: int = MIN_RETURNS):
        super().__init__(rig)
        self._round = Round.of(min_returns)

    def stages(self, beliefs: Beliefs) -> list[WorldSets]:
        """Return the layers: a round of wedges, a round of hulls, and both again."""
        unexplained = unexplained_layer_of(beliefs)
        few, more = self._round
        wedges = self._listed(unexplained, 2 * more)
        hulls = self._listed(beliefs.hulls, 2 * few)
        return [
            WorldSets.nothing(len(beliefs)),
            wedges.part(0, more),
            hulls.part(0, few),
            wedges.part(more, 2 * more),
            hulls.part(few, 2 * few),
        ]

    def _listed(self, given: WorldSets, most: int) -> WorldSets:
        """Return the first `most` cells of every set, the core first."""
        return WorldSets(self.rig.listed(given.sets, CORE_FIRST, most), given.counts)


class CareSector(Policy):
    """`care-sightlines` without its memory of lines of sight: the simplest policy found to be as
    good on generated streets.

    In order of priority:

    - a round of unexplained wedges
    - the sector ahead, in the row at which objects enter the range
    - a round of hulls
    - a round of explained wedges
    - the rest of the unexplained ones
    - the rest of that row
    - more of the hulls
    - the pattern `rows` instead of the random floor

    Each idea can be switched off, to measure its worth: `residual` (every wedge counts as
    unexplained), `camera` (all wedges), `tracks` (all hulls), `explained`, `sector`, `rows`.
    """

    name = "care-sector"
    source = "own: the reserve of CARE in rounds, a fixed sector ahead, rows"
    told: ClassVar[Mapping[str, str]] = {"min_returns": "min_returns"}
    keeps_order = True

    def __init__(
        self,
        rig: Rig,
        min_returns: int = MIN_RETURNS,
        residual: bool = True,
        camera: bool = True,
        tracks: bool = True,
        explained: bool = True,
        sector: bool = True,
        rows: bool = True,
    ):
        super().__init__(rig)
        self._round = Round.of(min_returns)
        check_flags(
            residual=residual,
            camera=camera,
            tracks=tracks,
            explained=explained,
            sector=sector,
            rows=rows,
        )
        self._uses_residual = residual
        self._uses_camera = camera
        self._follows = tracks
        self._rechecks = explained
        self._rows = cells_by_row(rig)[: None if rows else 0]
        entries = entry_cells(rig)
        self._entries = len(entries)
        self._sector = entries[columns_ahead(rig.grid)][: None if sector else 0]

    def demand(self, belief: Belief) -> Demand:
        """Layers in order of priority; see the class."""
        unexplained, known = self._camera_layers(belief) if self._uses_camera else ([], [])
        few, more = self._round
        wedges = self.rig.listed(unexplained, CORE_FIRST, WEDGE_ROUNDS * more)
        rechecked = self.rig.listed(known if self._rechecks else [], CORE_FIRST, few)
        tracked = self.rig.hulls(belief.tracks.boxes) if self._follows else []
        hulls = self.rig.listed(tracked, CORE_FIRST, few + more)
        return Demand(
            layers=[
                wedges.part(0, more),
                [self._sector],
                hulls.part(0, few),
                rechecked,
                wedges.part(more, WEDGE_ROUNDS * more),
                [self._rows[: self._entries]],
                hulls.part(few, few + more),
                [self._rows[: belief.budget]],
            ]
        )

    def _camera_layers(self, belief: Belief) -> tuple[CellSets, CellSets]:
        if self._uses_residual:
            return camera_layers(belief, self.rig)
        return wedges_of_boxes(belief.detections, self.rig), CellSets.of([])


WEDGE_ROUNDS = 4
"""Most rounds of an unexplained wedge. Chosen on the calibration's streets 1000 to 1007 and on
streets 2000 to 2007, none of which is scored.
"""


class CareSightlines(Policy):
    """`care-spread` that also watches where new objects can appear without a camera box.

    In order of priority:

    - a round of unexplained wedges
    - lines of sight ahead along which something can drive into the range
      (`care_sim.policies.own.sight_lines`)
    - a round of hulls
    - a round of explained wedges, since a new object can stand in front of a known one
    - all lines of sight
    - the rest of the wedges, up to `wedge_rounds` rounds in all, unless the picture is late
    - the rest of the row at which objects enter the range
    - more of the hulls
    - the pattern `rows` instead of the random floor

    Each idea can be switched off: `camera` (all wedges), `ahead`, `explained`, `sight_lines`,
    `rows`.
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
        check_flags(
            camera=camera, ahead=ahead, explained=explained, sight_lines=sight_lines, rows=rows
        )
        self._wedge_most = wedge_rounds * self._round.wedge
        self._uses_camera = camera
        self._looks_ahead = ahead
        self._rechecks = explained
        self._watches = sight_lines
        self._entries = entry_cells(rig)
        self._rows = CellSets.of([cells_by_row(rig)] if rows else [])
        self.reset()

    def reset(self) -> None:
        """Forget the memory."""
        self._lines = SightLines(self.rig, self._entries)

    def remember(self, belief: Belief) -> None:
        """Update the memory with the last scan."""
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

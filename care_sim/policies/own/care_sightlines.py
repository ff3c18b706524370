"""CARE in rounds, with a watch on open lines of sight for what the camera has not told yet."""

from care_sim.base.checks import check_flag, check_known, check_whole
from care_sim.core.belief import Belief
from care_sim.core.cell_order import CELL_ORDERS
from care_sim.core.conditions import MIN_RETURNS
from care_sim.core.grid import Cells
from care_sim.core.residual import camera_layers
from care_sim.core.rig import Rig
from care_sim.core.types import Demand
from care_sim.policies.base import Policy
from care_sim.policies.controls.rows import nearest_rows
from care_sim.policies.own.care_spread import (
    HULL_CELLS_PER_RETURN,
    WEDGE_CELLS_PER_RETURN,
    part,
)
from care_sim.policies.own.sight_lines import SightLines

_NONE: list[Cells] = []
WEDGE_ROUNDS = 4
"""Rounds that a wedge gets at most: a walker whose head alone shows fills a fourth of its box."""


class CareSightlines(Policy):
    """`care-spread` with a watch for what no camera box asks for.

    After the first round of wedges and hulls come a few cells of every explained wedge, since a new
    object can stand in front of a known one, and the lines of sight along which something can
    appear (`care_sim.policies.own.sight_lines`). Then the wedges get what is left of them, which
    helps with walkers half hidden; then come the rest of the row at which things enter the range, a
    second round of hulls, and the pattern `rows` in the place of the random floor. Each can be
    switched off: `sight_lines`, `explained`, `rows`; `camera=False` leaves out all wedges.
    """

    name = "care-sightlines"
    source = "own: the reserve of CARE in rounds, open lines of sight, rows"

    def __init__(
        self,
        rig: Rig,
        min_returns: int = MIN_RETURNS,
        cell_order: str = "core-spread",
        sight_lines: bool = True,
        explained: bool = True,
        rows: bool = True,
        camera: bool = True,
    ):
        super().__init__(rig)
        check_whole("min_returns", min_returns, 1)
        check_known("cell_order", cell_order, CELL_ORDERS)
        switches = {"sight_lines": sight_lines, "explained": explained, "rows": rows}
        for name, value in (switches | {"camera": camera}).items():
            check_flag(name, value)
        self._order = cell_order
        self._few = HULL_CELLS_PER_RETURN * min_returns
        self._more = WEDGE_CELLS_PER_RETURN * min_returns
        self._watches = sight_lines
        self._rechecks = explained
        self._camera = camera
        self._fills = rows
        self._rows = nearest_rows(rig.grid)
        self.reset()

    def reset(self) -> None:
        """Forget what was seen."""
        self._lines = SightLines(self.rig, int(self._rows[0] // self.rig.grid.columns))

    def demand(self, belief: Belief) -> Demand:
        """Layers in order of priority; see the class."""
        few, more = self._few, self._more
        unexplained, known = camera_layers(belief, self.rig) if self._camera else (_NONE, _NONE)
        wedges = self.rig.reordered(unexplained, self._order)
        hulls = self.rig.reordered(self.rig.hulls(belief.tracks.boxes), self._order)
        self._lines.update(belief)
        known = known if self._rechecks else []
        lines = [self._lines.cells()] if self._watches else []
        rows = [self._rows] if self._fills else []
        ring = part(rows, 0, self.rig.grid.columns)
        return Demand(
            layers=[
                part(wedges, 0, more),
                part(hulls, 0, few),
                part(self.rig.reordered(known, self._order), 0, few),
                lines,
                part(wedges, more, WEDGE_ROUNDS * more),
                ring,
                part(hulls, few, few + more),
                rows,
            ]
        )

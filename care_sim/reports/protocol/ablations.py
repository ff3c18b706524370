"""The ablations of the open loop under their former names, until the figures use the engine."""

from collections.abc import Sequence

from care_sim.evaluation.scene_contrasts import Ratio
from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.measures import Recall
from care_sim.reports.protocol.closing import protocol_closing
from care_sim.reports.tables.ablations import AblationStudy, ablation_tables, ceiling
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import Row

__all__ = ["AblationPlays", "ablation_closing", "ablation_tables"]


def ablation_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, the gate, and what the full scan finds."""
    return [*protocol_closing(rows), *ceiling(rows)]


class _Cells(Frame):
    def difference(self, ratio: Ratio, ours: Key, theirs: Key, within: str = "") -> Contrast | None:
        """One cell less another, paired by scene."""
        return self.contrast(Recall(ratio, within), ours, theirs)


class AblationPlays(AblationStudy):
    """The plays of the study."""

    def __init__(self, rows: Sequence[Row]):
        super().__init__(rows)
        self.cells = _Cells(rows)

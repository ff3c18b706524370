"""Names of the report engine under their former path, until every room imports them from there."""

from collections.abc import Sequence

from care_sim.reports.engine.contrasts import Contrast
from care_sim.reports.engine.frames import Frame
from care_sim.reports.engine.levels import Cell, level_of, levels
from care_sim.reports.engine.measures import DETECTION
from care_sim.study.rows.reading import Key
from care_sim.study.run_config import Row

__all__ = ["Cell", "StudyCells", "summarise"]


def summarise(rows: Sequence[Row]) -> list[Cell]:
    """The cells of a study, in the order of their first rows, settings kept together."""
    return levels(Frame(rows))


class StudyCells(Frame):
    """What a study has played so far; cells without rows are None."""

    def has(self, key: Key) -> bool:
        """Whether there are rows."""
        return key in self.groups

    def cell(self, key: Key) -> Cell | None:
        """What was measured."""
        return level_of(self, key)

    def difference(self, ours: Key, theirs: Key) -> Contrast | None:
        """First detection in one cell minus that in another, on the seeds that both have."""
        return self.contrast(DETECTION, ours, theirs)

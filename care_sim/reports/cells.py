"""The rows of a study by cell: what was measured there, and how it differs from elsewhere."""

from collections.abc import Iterable, Sequence

from care_sim.reports.contrasts import DETECTION, Contrast, contrast
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.summary import Cell, summarise
from care_sim.study.row_reading import Key, grouped, tags_of_row
from care_sim.study.run_config import Row


class StudyCells:
    """What a study has played so far; cells without rows are None."""

    def __init__(self, rows: Sequence[Row]):
        self.rows = rows
        self.tags = {row["policy"]: tags_of_row(row) for row in rows}
        self._groups = grouped(rows)
        self._cells = {cell.key: cell for cell in summarise(rows)}

    @property
    def policies(self) -> list[str]:
        """Their names, in the order of their first rows."""
        return list(self.tags)

    def has(self, key: Key) -> bool:
        """Whether there are rows."""
        return key in self._groups

    def cell(self, key: Key) -> Cell | None:
        """What was measured."""
        return self._cells.get(key)

    def difference(self, ours: Key, theirs: Key) -> Contrast | None:
        """First detection in one cell minus that in another, on the seeds that both have."""
        return contrast(DETECTION, self._groups.get(ours), self._groups.get(theirs))

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return marked(policy, self.tags.get(policy, ()))

    def notes(self, policies: Iterable[str]) -> tuple[str, ...]:
        """What the marks of these policies mean."""
        return tag_notes(self.tags.get(policy, ()) for policy in policies)

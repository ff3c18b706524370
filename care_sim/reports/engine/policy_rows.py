"""Rows by policy and budget, whatever else they differ in."""

from collections.abc import Sequence

from care_sim.reports.engine.controls import is_control
from care_sim.reports.formatting import marked
from care_sim.study.rows.reading import policy_of, tags_of_row
from care_sim.study.run_config import FULL, Row


class PolicyRows:
    """The rows of a study by policy and budget. `tags` of the policies in the order of their first
    rows; `budgets` of all but the full scan, which has one of its own.
    """

    def __init__(self, rows: Sequence[Row]):
        self.rows = rows
        self.tags = {policy_of(row): tags_of_row(row) for row in rows}
        self.budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self._cells: dict[tuple[str, float], list[Row]] = {}
        for row in rows:
            self._cells.setdefault((policy_of(row), row["budget"]), []).append(row)

    @property
    def policies(self) -> list[str]:
        """Their names, with the full scan's."""
        return [*self.tags]

    @property
    def controls(self) -> list[str]:
        """The controls that a car can have."""
        return [policy for policy, tags in self.tags.items() if is_control(tags)]

    def of(self, policy: str, budget: float) -> list[Row]:
        """The rows of a policy at a budget; those of the full scan at any."""
        return self._cells.get((policy, 1.0 if policy == FULL else budget), [])

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return marked(policy, self.tags[policy])

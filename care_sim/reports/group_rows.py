"""The rows of a study by group of places, level and policy."""

from collections.abc import Sequence

from care_sim.reports.formatting import marked
from care_sim.study.designs.variants import Group, Variant
from care_sim.study.rows.reading import grouped, tags_of_row
from care_sim.study.run_config import Row


class GroupRows:
    """The rows of a study; what was not played is an empty list."""

    def __init__(self, rows: Sequence[Row]):
        self.rows = rows
        self.tags = {row["policy"]: tags_of_row(row) for row in rows}
        self._cells = grouped(rows)

    def of(self, group: Group, level: Variant, policy: str) -> list[Row]:
        """The rows of all places of a group. Their `seed` names place and seed: it is by worlds
        that policies are paired.
        """
        return [
            row | {"seed": (number, row["seed"])}
            for number, place in enumerate(group.places)
            for row in self._cells.get(level.key(place, policy), ())
        ]

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return marked(policy, self.tags.get(policy, ()))

"""Realism in the open loop: recall of first sightings, and of all objects."""

from collections.abc import Sequence

from care_sim.base.errors import percent
from care_sim.evaluation.scene_contrasts import FIRST_SIGHTING, OVERALL, Ratio
from care_sim.reports.formatting import marked, tag_notes
from care_sim.reports.protocol.cells import PlayCells
from care_sim.reports.protocol.closing import protocol_closing
from care_sim.reports.protocol.differences import MeasuredDifference
from care_sim.reports.protocol.formatting import written
from care_sim.reports.realism.orders import Order, Standing, of_plays
from care_sim.reports.realism.tables import tables_of, verdict_sentences
from care_sim.reports.table import Table
from care_sim.study.designs.defaults import FILM_POLICIES
from care_sim.study.designs.realism import (
    FILM_CAMERA,
    FILM_CONDITIONS,
    FILM_PAIRS,
    IDEAL,
    LATE_FILM_CAMERA,
)
from care_sim.study.designs.variants import FilmPlace, Variant
from care_sim.study.rows.reading import READ_WITH, Key, policy_of, tags_of_row
from care_sim.study.run_config import FULL, REFERENCE, Row

_RATIOS = (FIRST_SIGHTING, OVERALL)
_OF_THE_FILM = ("sensor", "sensor_hash", *READ_WITH)
"""Columns of a source, which are no conditions."""


def realism_tables(rows: Sequence[Row]) -> list[Table]:
    """The orders of the headline table under every condition, and every policy's recalls."""
    return tables_of(RealismPlays(rows))


def realism_closing(rows: Sequence[Row]) -> list[str]:
    """Size of the study, and how many orders hold."""
    return [*protocol_closing(rows), *verdict_sentences(RealismPlays(rows))]


class RealismPlays:
    """The plays of the study by budget."""

    title = "Open loop"
    unit = "points"
    levels_told = "%"

    def __init__(self, rows: Sequence[Row]):
        self._cells = PlayCells(rows)
        self._tags = {policy_of(row): tags_of_row(row) for row in rows}
        self._shared = tuple((name, rows[0].get(name)) for name in _OF_THE_FILM) if rows else ()
        self._source = rows[0]["source"] if rows else ""
        self._budgets = sorted({row["budget"] for row in rows if row["policy"] != FULL})
        self._blocks = {
            f"{ratio.name}, {percent(budget)}": (ratio, budget)
            for ratio in _RATIOS
            for budget in self._budgets
        }
        self.conditions = [level for level in FILM_CONDITIONS if self._is_played(level)]
        self.cameras = [
            level for level in (FILM_CAMERA, LATE_FILM_CAMERA) if level in self.conditions
        ]

    def orders(self) -> dict[str, list[Order]]:
        """The pairs of the headline table, and CARE with every policy that joined in, at every
        budget.
        """
        joined = [policy for policy in self._tags if policy not in FILM_POLICIES]
        pairs = [*FILM_PAIRS, *((REFERENCE, policy) for policy in joined)]
        return {
            ratio.name: [
                Order(percent(budget), pair, standings)
                for budget in self._budgets
                for pair in pairs
                if (standings := self._standings(ratio, budget, *pair))
            ]
            for ratio in _RATIOS
        }

    def blocks(self) -> dict[str, list[str]]:
        """All policies for every measure at every budget."""
        return {block: [*self._tags] for block in self._blocks}

    def level(self, block: str, condition: Variant, policy: str) -> str:
        """The recall."""
        ratio, budget = self._blocks[block]
        return written(ratio, self._cells.level(ratio, self._key(condition, budget, policy)))

    def change(self, block: str, condition: Variant, policy: str) -> MeasuredDifference | None:
        """What the condition adds to the recall."""
        ratio, budget = self._blocks[block]
        ours, theirs = (self._key(level, budget, policy) for level in (condition, IDEAL))
        return self._cells.difference(ratio, ours, theirs)

    def marked(self, policy: str) -> str:
        """A policy's name, with a mark when no car can have it."""
        return marked(policy, self._tags[policy])

    def notes(self) -> tuple[str, ...]:
        """What the marks of policies mean."""
        return tag_notes(self._tags.values())

    def _standings(
        self, ratio: Ratio, budget: float, ours: str, theirs: str
    ) -> dict[str, Standing]:
        found = {}
        for level in self.conditions:
            first, second = (self._key(level, budget, policy) for policy in (ours, theirs))
            if standing := of_plays(self._cells.difference(ratio, first, second)):
                found[level.label] = standing
        return found

    def _key(self, level: Variant, budget: float, policy: str) -> Key:
        # The full scan is found as the ceiling of every setting, whatever it feels of it.
        setting, _, _ = level.key(FilmPlace(self._source, budget, self._shared), REFERENCE)
        return setting, policy, 1.0 if policy == FULL else budget

    def _is_played(self, level: Variant) -> bool:
        return any(
            self._cells.tallies(self._key(level, budget, policy))
            for budget in self._budgets
            for policy in self._tags
        )

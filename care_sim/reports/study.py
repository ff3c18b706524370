"""The report of a study: its tables and figures, closing sentences, and the columns read."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from care_sim.reports.table import Table
from care_sim.scenarios import SCENARIOS
from care_sim.study.results_formats import EPISODES, ResultsFormat
from care_sim.study.rows.reading import SOURCES, Setting, setting_of
from care_sim.study.rows.schema import Column, Schema
from care_sim.study.run_config import Row

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Study:
    """The report of a study; all functions are pure functions of its rows.

    `title` names it to readers. `closing` are sentences after the tables. `figure_names` are all
    figures that the study can draw, as patterns in which {world} stands for a scenario or source,
    and a * for any text. `results` is what it plays. `columns` are further columns that its tables
    read: those that a row may leave empty may be missing where all rows do. `minus` makes tables
    of one policy less every other. `headline` is the table that ends the study on a terminal; the
    first of its tables if None.
    """

    name: str
    title: str
    tables: Callable[[Sequence[Row]], list[Table]]
    figures: Callable[[Sequence[Row]], dict[str, "Figure"]]
    closing: Callable[[Sequence[Row]], list[str]]
    figure_names: tuple[str, ...]
    results: ResultsFormat = EPISODES
    columns: Mapping[str, Column] = field(default_factory=dict)
    minus: Callable[[Sequence[Row], str], list[Table]] | None = None
    headline: Callable[[Sequence[Row]], Table] | None = None

    def figures_of(self, rows: Sequence[Row] = ()) -> list[str]:
        """The figures that it can draw of the built-in worlds and those of the rows, as patterns in
        which a * stands for any text.
        """
        # Names of figures contain worlds, so that a user's own figures are not removed.
        own = [Setting(setting_of(row).world).slug for row in rows]
        worlds = dict.fromkeys([*SCENARIOS, *SOURCES, *own])
        return [
            *dict.fromkeys(
                name.format(world=world) for name in self.figure_names for world in worlds
            )
        ]

    @property
    def schema(self) -> Schema:
        """The columns that its rows must have, and those that are checked where they are."""
        schema = self.results.schema
        optional = {name: one for name, one in self.columns.items() if one.optional}
        needed = {name: one for name, one in self.columns.items() if not one.optional}
        return replace(
            schema, needed={**schema.needed, **needed}, further={**schema.further, **optional}
        )

"""What the order of cells inside a set does to the paper's closed-loop study: its statements and
first detections, order by order.
"""

from collections.abc import Iterator, Sequence

from care_sim.base.errors import counted, percent
from care_sim.reports.cells import Cell, summarise
from care_sim.reports.contrasts import DETECTION, Contrast, contrast
from care_sim.reports.formatting import interval, marked, median, tag_notes
from care_sim.reports.order_tables import Shown, other_orders, played_once, tables_by_order
from care_sim.reports.order_verdicts import Verdict, Verdicts, on_mirrored_order, verdict_tables
from care_sim.reports.table import Table
from care_sim.reports.tables.paper_statements import statements
from care_sim.study.designs.order import BASE_ORDER, rows_by_order, without_order
from care_sim.study.designs.paper import PAPER_EPISODES
from care_sim.study.rows.reading import Key, grouped
from care_sim.study.run_config import Row

_DETECTION = Shown("First detection", "median, m", "m")


class OrderCells:
    """The cells of the study by order. Cells of one key differ in nothing but the order."""

    def __init__(self, rows: Sequence[Row]):
        played = rows_by_order(rows)
        self.orders = tuple(played)
        self.once = without_order(rows)
        self.episodes = max(map(len, grouped(rows).values()))
        self._groups = {order: grouped(own) for order, own in played.items()}
        self._cells = {
            order: {cell.key: cell for cell in summarise(own)} for order, own in played.items()
        }
        self.tags = {
            cell.policy: cell.tags for cells in self._cells.values() for cell in cells.values()
        }

    @property
    def keys(self) -> list[Key]:
        """Of all cells, settings together and by budget."""
        return list(dict.fromkeys(key for cells in self._cells.values() for key in cells))

    def cell(self, order: str, key: Key) -> Cell | None:
        """What was measured; None where it was not played."""
        return self._cells[order].get(key)

    def change(self, order: str, key: Key) -> Contrast | None:
        """First detection under an order less that under the usual one, seed by seed."""
        usual = self._groups.get(BASE_ORDER, {})
        return contrast(DETECTION, self._groups[order].get(key), usual.get(key))


def order_tables(rows: Sequence[Row]) -> list[Table]:
    """The paper's statements by order, then first detections and their differences to the usual
    order.
    """
    study = OrderCells(rows)
    title = "The paper's statements by order of cells"
    played = f"Of each cell {counted(study.episodes, 'episode')}; the paper has {PAPER_EPISODES}."
    notes = (*played_once(study.once), *tag_notes(study.tags.values()))
    return [
        *verdict_tables(title, verdicts(rows), played),
        *tables_by_order(
            _DETECTION, study.orders, _levels(study), _changes(study), notes, terminal=False
        ),
    ]


def order_closing(rows: Sequence[Row]) -> list[str]:
    """Which statements hang on whether rows are numbered from the top or from the bottom."""
    return on_mirrored_order(verdicts(rows))


def verdicts(rows: Sequence[Row]) -> Verdicts:
    """Every statement of the paper under every order that was played."""
    return {
        order: {
            statement.text: Verdict(statement.verdict, statement.measured)
            for statement in statements(played)
        }
        for order, played in rows_by_order(rows).items()
    }


def _levels(study: OrderCells) -> Iterator[tuple[str, ...]]:
    for key, names in _named(study, study.keys):
        cells = [study.cell(order, key) for order in study.orders] if key else []
        yield (*names, *(median(cell.detection) if cell else "" for cell in cells))


def _changes(study: OrderCells) -> Iterator[tuple[str, ...]]:
    others = other_orders(study.orders)
    ordered = [key for key in study.keys if key[1] not in study.once]
    for key, names in _named(study, ordered):
        changes = [study.change(order, key) for order in others] if key else []
        yield (*names, *map(interval, changes))


def _named(study: OrderCells, keys: Sequence[Key]) -> Iterator[tuple[Key | None, tuple[str, ...]]]:
    """The keys with policy and budget; before those of a setting, its label as a heading."""
    heading = ""
    for key in keys:
        setting, policy, budget = key
        if setting.label != heading:
            heading = setting.label
            yield None, (heading,)
        yield key, (marked(policy, study.tags[policy]), percent(budget))

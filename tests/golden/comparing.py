"""Golden cells against the cells of today, whatever became of titles, order and layout."""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable
from typing import NamedTuple

from tests.golden.cells import Cell


class Difference(NamedTuple):
    """A cell, its golden numbers and its numbers now; None where there is no such cell."""

    cell: Cell
    golden: tuple[str, ...] | None
    now: tuple[str, ...] | None

    def __str__(self) -> str:
        where = " | ".join(filter(None, (self.cell.heading, *self.cell.labels)))
        told = [" ".join(numbers) if numbers else "none" for numbers in self[1:]]
        return (
            f"{self.cell.folder}: {self.cell.title}: row {where}: column {self.cell.column}: "
            f"golden {told[0]}, now {told[1]}"
        )


def differences(
    golden: Iterable[Cell], now: Iterable[Cell], translated: Callable[[Cell], Cell | None]
) -> list[Difference]:
    """The cells that differ, in the golden order; `translated` gives golden cells today's words.

    Cells with the same key and title are compared first. What is left under a key is compared
    across tables, but only with those whose title the other side does not know. So a table may get
    another title, and two tables that keep theirs may not swap their numbers.
    """
    left = [cell for cell in map(translated, golden) if cell]
    right = [*now]
    titles = [{(cell.folder, cell.title) for cell in side} for side in (left, right)]
    left, right = _unmatched(left, right, _table_and_key)
    stayed, moved = _parted(left, titles[1])
    today, new = _parted(right, titles[0])
    moved, new = _unmatched(moved, new, _key)
    found, extra = _paired(stayed, today, _table_and_key)
    # What a new table holds beside the golden cells is no fault.
    lost, _ = _paired(moved, new, _key)
    return [*found, *lost, *(Difference(cell, None, cell.numbers) for cell in extra)]


def _table_and_key(cell: Cell) -> object:
    return cell.folder, cell.title, cell.key


def _key(cell: Cell) -> object:
    return cell.folder, cell.key


def _parted(cells: Iterable[Cell], titles: set[tuple[str, str]]) -> tuple[list[Cell], list[Cell]]:
    """The cells whose title is among these, and the others."""
    sides: tuple[list[Cell], list[Cell]] = [], []
    for cell in cells:
        sides[(cell.folder, cell.title) not in titles].append(cell)
    return sides


def _unmatched(
    left: Iterable[Cell], right: Iterable[Cell], name: Callable[[Cell], object]
) -> tuple[list[Cell], list[Cell]]:
    """The cells of each side without a partner of the same name and values."""
    partners = Counter((name(cell), cell.values) for cell in right)
    alone = []
    for cell in left:
        one = name(cell), cell.values
        if partners[one]:
            partners[one] -= 1
        else:
            alone.append(cell)
    # `partners` now counts the cells of the right side that found none, alike ones together.
    others = []
    for cell in right:
        one = name(cell), cell.values
        if partners[one]:
            partners[one] -= 1
            others.append(cell)
    return alone, others


def _paired(
    left: Iterable[Cell], right: Iterable[Cell], name: Callable[[Cell], object]
) -> tuple[list[Difference], list[Cell]]:
    """Cells that differ, each beside a cell of the same name now; and the cells that are over."""
    named: dict[object, list[Cell]] = defaultdict(list)
    for cell in right:
        named[name(cell)].append(cell)
    found = []
    for cell in left:
        partners = named[name(cell)]
        found.append(Difference(cell, cell.numbers, partners.pop(0).numbers if partners else None))
    return found, [cell for cells in named.values() for cell in cells]

"""Every number that a published folder prints is that of the golden file.

The file holds a row per cell with a number: folder, title, heading, labels of the row, heading of
the column, numbers as printed. `python -m tests.golden.published` writes it anew, and
`python -m tests.golden.published FOLDER` prints what a folder holds now.

Tables may get other titles, another order, or be turned on their side; `+`, `%` and separators may
move into a heading; new tables may hold anything. Words, notes under tables, and marks such as * or
bold are not compared. Where a heading or a label has another name, `translated` gives a golden cell
the words of today, or None for a cell that no table holds any longer. Say why beside it.
"""

from collections import Counter

import pytest

from care_sim.reports.table import Bold, Table
from tests.golden.cells import NOT_DETECTED, Cell, cells, numbers
from tests.golden.published import NOT_RECOMPUTED, cells_of, folders, read_golden
from tests.helpers.places import PUBLISHED

SHOWN = 10
"""Differing cells that a failure lists."""
QUICK = ("closed-loop-5", "streets-cluster", "vehicle")
"""Folders that take a tenth of a second each: episodes, plays, and a study of its own."""


def translated(cell):
    """A golden cell in the words of today; None for a cell that no table holds any longer."""
    return cell


def differing(golden, now):
    """The golden cells that no cell of today is equal to, then those of today that are in a golden
    table and not golden. The titles of tables that both sides have are compared, too.
    """
    golden = [cell for cell in map(translated, golden) if cell]
    both = {cell.title for cell in golden} & {cell.title for cell in now}
    left, right = ([(cell.title in both and cell.title, cell.key, cell.values) for cell in side]
                   for side in (golden, now))  # fmt: skip
    lost, new = Counter(left) - Counter(right), Counter(right) - Counter(left)
    return [*lost.elements(), *(cell for cell in new.elements() if cell[0])]


@pytest.fixture(scope="module")
def golden():
    return read_golden()


@pytest.mark.parametrize(
    "folder",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in folders()],
)
def test_a_published_folder_prints_its_golden_numbers(folder, golden):
    found = differing(golden[folder], cells_of(folder))
    told = "\n".join(map(str, found[:SHOWN]))
    assert not found, f"{len(found)} of {len(golden[folder])} cells differ:\n{told}"


def test_the_golden_file_has_every_folder_that_is_recomputed(golden):
    assert [*golden] == folders()
    assert {*NOT_RECOMPUTED} < {path.name for path in PUBLISHED.iterdir()}


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("+10.0* [9.3,10.6]", ("+10.0", "9.3", "10.6")),
        ("≥-1,251.5 [-4,120]°", ("≥-1,251.5", "-4", "120")),
        ("not detected [n.d., 7.3]", (NOT_DETECTED, NOT_DETECTED, "7.3")),
        ("36/0/0 5.00", ("36", "0", "0", "5.00")),
        ("100%, 1,221 cells", ("100%", "1,221")),
        ("ppo path=results/training/drawn-0/weights.npz, tiles:4x8", ()),
    ],
)
def test_numbers_of_a_text(text, found):
    assert numbers(text) == found


def test_cells_stand_under_what_names_them():
    table = Table(
        "dense",
        ("care minus", "budget", "recall %", "interval", "overall %", "interval"),
        (("First sightings",), ("fan", "3%", Bold("1.5"), "[1,2]", "-", "")),
    )
    assert [*cells("sweep", table)] == [
        Cell("sweep", "dense", "First sightings", ("care minus", "fan", "3%"), *rest)
        for rest in (("recall %", ("1.5",)), ("recall %, interval", ("1", "2")))
    ]


def cell(title, row, column, *found):
    return Cell("sweep", title, "", (row,), column, found)


GOLDEN = [cell("a", "fan", "3%", "+1.0", "50%"), cell("b", "fan", "3%", "2.0")]


@pytest.mark.parametrize(
    ("now", "count"),
    [
        (GOLDEN[::-1], 0),
        ([cell("c", "3%", "fan", "1.0", "50"), GOLDEN[1], cell("new", "fan", "3%", "7")], 0),
        (GOLDEN[:1], 1),
        ([GOLDEN[0], cell("b", "fan", "3%", "≥2.0")], 2),
        ([GOLDEN[0], cell("c", "fan", "3%", "3.0")], 1),
        ([cell("a", "fan", "3%", "2.0"), cell("b", "fan", "3%", "1.0", "50")], 4),
    ],
    ids=["order", "on its side, units moved, one more", "lost", "bound", "retitled", "swapped"],
)
def test_titles_and_order_may_change_and_numbers_may_not(now, count):
    assert len(differing(GOLDEN, now)) == count

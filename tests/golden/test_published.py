"""Every number that a published folder prints is that of the golden file.

The file holds a row per cell with a number: folder, title, heading, labels of the row, heading of
the column, numbers as printed. `python -m tests.golden.published` writes it anew, and
`python -m tests.golden.published FOLDER` prints what a folder holds now.

A redesign of the tables keeps the file and changes three places:

- `published.tables_of` makes the tables. Titles and the order of tables, rows and columns are free.
  A table may be turned on its side. Separators, `+` and `%` may move from a cell to a heading.
- `translated` below gives a golden cell the words of today, where a heading, a label or a column
  has another name, or a setting moves from the title (a word of it) into the row.
- `translated` returns None for a golden cell that no table holds any longer. Say why beside it.

New tables may hold anything. Words, notes under tables, and marks such as * or bold are not
compared.
"""

import pytest

from care_sim.reports.table import Bold, Table
from tests.golden.cells import NOT_DETECTED, Cell, cells, numbers
from tests.golden.comparing import differences
from tests.golden.published import NOT_RECOMPUTED, cells_of, folders, read_golden
from tests.helpers.places import PUBLISHED

SHOWN = 10
"""Differing cells that a failure lists."""
QUICK = ("closed-loop-5", "streets-cluster", "vehicle")
"""Folders that take a tenth of a second each: episodes, plays, and a study of its own."""


def translated(cell):
    """A golden cell in the words of today; None for a cell that no table holds any longer."""
    return cell


@pytest.fixture(scope="module")
def golden():
    return read_golden()


@pytest.mark.parametrize(
    "folder",
    [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in folders()],
)
def test_a_published_folder_prints_its_golden_numbers(folder, golden):
    found = differences(golden[folder], cells_of(folder), translated)
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
    "now",
    [
        GOLDEN[::-1],
        [cell("c", "3%", "fan", "1.0", "50"), cell("b", "fan", "3%", "2.0")],
        [cell("c", "fan", "3%", "2.0"), cell("d", "fan", "3%", "1.0", "50%")],
        [*GOLDEN, cell("new", "fan", "3%", "7")],
    ],
    ids=["order", "on its side, retitled, units moved", "both retitled", "a new table"],
)
def test_what_a_redesign_may_change(now):
    assert not differences(GOLDEN, now, translated)


@pytest.mark.parametrize(
    ("now", "told"),
    [
        (GOLDEN[:1], ["golden 2.0, now none"]),
        ([GOLDEN[0], cell("b", "fan", "3%", "2")], ["golden 2.0, now 2"]),
        ([GOLDEN[0], cell("c", "fan", "3%", "3.0")], ["golden 2.0, now 3.0"]),
        ([GOLDEN[0], cell("b", "rows", "3%", "2.0")], ["2.0, now none", "golden none, now 2.0"]),
        ([GOLDEN[0], cell("b", "fan", "3%", "≥2.0")], ["golden 2.0, now ≥2.0"]),
        (
            [cell("a", "fan", "3%", "2.0"), cell("b", "fan", "3%", "1.0", "50")],
            ["golden +1.0 50%, now 2.0", "golden 2.0, now 1.0 50"],
        ),
    ],
    ids=["lost", "rounded", "changed and retitled", "another row", "a bound", "swapped"],
)
def test_what_no_redesign_may_change(now, told):
    found = [*map(str, differences(GOLDEN, now, translated))]
    assert len(found) == len(told)
    assert all(end in line for end, line in zip(told, found, strict=True))


def test_translations_rename_and_leave_out():
    def renamed(cell):
        return cell._replace(column="0.03") if cell.title == "a" else None

    assert not differences(GOLDEN, [cell("a", "fan", "0.03", "1.0", "50")], renamed)

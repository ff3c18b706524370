"""The golden file: every number that the published folders print, recomputed from their rows.

    python -m tests.golden.published            writes the file anew, in two minutes of one core
    python -m tests.golden.published streets    prints the cells of one folder

This module is the only one that calls the tables of the package. A new engine of tables changes
`tables_of` alone.
"""

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from care_sim.reports.report import CONFIG, read_results
from care_sim.reports.table import Table
from care_sim.study.rows.reading import policy_of
from care_sim.study.run_config import FULL
from tests.golden.cells import Cell, cells
from tests.helpers.places import PUBLISHED

FILE = Path(__file__).with_name("published.parquet")
NOT_RECOMPUTED = {
    "b90": "it holds no rows of plays; `tests/repository` makes its table again from its files",
    "judge-logs": "its tables need every box of the detectors; the folder holds their counts",
    "judge-streets": "its tables need every box of the detectors; the folder holds their counts",
}
"""Published folders without numbers here, and why. The measurements of `bench` and `parity` are in
files beside the folders; no command prints such a file again.
"""
SENTENCES = "Closing sentences"


def folders() -> list[str]:
    """The published folders whose numbers are recomputed."""
    names = sorted(path.name for path in PUBLISHED.iterdir() if path.is_dir())
    return [name for name in names if name not in NOT_RECOMPUTED]


def cells_of(folder: str) -> list[Cell]:
    """The numbers that a published folder prints, in order."""
    return [cell for table in tables_of(PUBLISHED / folder) for cell in cells(folder, table)]


def tables_of(folder: Path) -> Iterator[Table]:
    """The tables of the rows of a folder, with the closing sentences and one policy minus each."""
    assert (folder / CONFIG).is_file(), f"{folder.name} holds no study: is it new?"
    rows, study, left_out = read_results(folder)
    assert not left_out
    yield from study.tables(rows)
    yield Table(SENTENCES, ("", "sentence"), tuple(("", line) for line in study.closing(rows)))
    if study.minus is not None:
        # Every other policy as minuend has the same numbers, with other signs, in other pairs.
        policies = sorted({policy_of(row) for row in rows} - {FULL})
        minuend = "care" if "care" in policies else policies[0]
        for table in study.minus(rows, minuend):
            yield Table(f"--minus: {table.title}", table.columns, table.rows, names=table.names)


def read_golden() -> dict[str, list[Cell]]:
    """The cells of the golden file by folder."""
    golden: dict[str, list[Cell]] = {}
    for row in pq.read_table(FILE).to_pylist():
        labels, numbers = tuple(row.pop("labels")), tuple(row.pop("numbers"))
        golden.setdefault(row["folder"], []).append(Cell(**row, labels=labels, numbers=numbers))
    return golden


def write_golden(found: Iterable[Cell]) -> None:
    """Replace the golden file."""
    table = pa.Table.from_pylist([cell._asdict() for cell in found])
    pq.write_table(table, FILE, compression="zstd", compression_level=19)


def main(names: list[str]) -> None:
    """Print the cells of these folders; of none, write the file."""
    if names:
        for cell in (cell for name in names for cell in cells_of(name)):
            print(*cell[1:], sep=" | ")
    else:
        write_golden(cell for name in folders() for cell in cells_of(name))


if __name__ == "__main__":
    main(sys.argv[1:])

"""Golden numbers: the published tables hold what today's code makes of the published rows."""

import re

import pytest

from care_sim.reports.report import read_results
from tests.helpers.places import ROOT

RESULTS = ROOT / "results"
QUICK = {
    *("ablate", "argoverse2-core-first", "closed-loop-5", "crowding", "drawn-scorer-blind"),
    *("firing-sensors", "learned-sets-seeds-streets", "order", "order-streets", "realism"),
    *("validate-drive-factors", "vehicle"),
}
"""Each study of either loop at least once where its rows are few."""
_LINE = re.compile(r"(\||## (?!Statements))")


def lines(text):
    """Titles, headings, labels, numbers and bold type; notes below a table are prose."""
    return [line for line in text.splitlines() if _LINE.match(line)]


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in QUICK else pytest.mark.slow)
        for name in sorted(path.parent.name for path in RESULTS.glob("*/tables.md"))
    ],
)
def test_published_tables_hold_the_numbers_of_their_rows(name):
    rows, study, _ = read_results(RESULTS / name)
    made = [line for table in study.tables(rows) for line in lines(table.markdown())]
    assert made == lines((RESULTS / name / "tables.md").read_text())

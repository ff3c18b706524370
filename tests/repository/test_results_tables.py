"""Tables on pages of results show what the published rows say.

After `make publish`, a failure names a table that is out of date.
"""

import json
import re
from functools import reduce
from operator import getitem

import numpy as np
import pytest

from tests.repository.test_results_pages import DATA, FOLDER, table_rows


def published_rows(folder, title):
    """The rows of a published table, heading first, without bold."""
    text = "\n" + (DATA / folder / "tables.md").read_text()
    section = text.partition(f"\n## {title}\n")[2].partition("\n## ")[0]
    lines = [line for line in section.splitlines() if line.startswith("|") and "---" not in line]
    return [[cell.strip(" *") for cell in line.strip("|").split("|")] for line in lines]


def test_first_detections_by_hardware():
    heading, _, *rows = published_rows("firing-sensors", "First detection by hardware, median, m")
    # The first set-up comes first, and 3% is its first budget.
    own = {policy: cells for policy, _, *cells in reversed(rows[:6])}
    (_, *units), *told = table_rows(FOLDER / "degraded-sensing.md")
    assert len(told) == 4
    for policy, *distances in told:
        for unit, distance in zip(units, distances, strict=True):
            (place,) = (
                number
                for number, name in enumerate(heading[2:])
                if name.partition(":")[0] == unit.replace(" ", "-")
            )
            assert own[policy][place] == distance.replace("n.d.", "not detected"), (policy, unit)


PAPER = [
    row
    for row in table_rows(FOLDER / "paper-replication.md")
    if re.fullmatch(r"[+-][\d.]+(, [+-][\d.]+){2}", row[2])
]


@pytest.mark.parametrize("row", PAPER, ids=lambda row: row[0])
def test_gains_beside_the_paper(row):
    (pair, measure), paper, here = row[0].split(", "), row[1], row[2]
    title = "generated streets, detector returns: the paper's statements"
    heading = ""
    for name, *cells in published_rows("streets", title):
        heading = heading if any(cells) else name.lower()
        if name == pair and heading == measure:
            told = [
                re.fullmatch(r"(\S+) .*\((\S+)\)", cell.replace("*", "")) for cell in cells[::2]
            ]
            assert [found[1] for found in told] == here.split(", ")
            assert [found[2] for found in told] == paper.split(", ")
            return
    pytest.fail(f"streets has no statement {row[0]}")


def test_recall_and_precision_of_detectors():
    folder = ""
    for name, *shares in table_rows(FOLDER / "detectors.md")[1:]:
        where, _, detector = name.rpartition(": ")
        folder = f"judge-{where}" if where else folder
        # The published scores of pillars are those from 0.3 on, as in a play.
        own = next(
            row
            for row in published_rows(folder, "Detectors")
            if row[0] == detector and row[1] in ("-", "0.3")
        )
        assert [*map(float, own[2:5])] == [*map(float, shares)], name


def ranked_entries():
    """Rank and B90 of each entry over all worlds."""
    text = (DATA / "b90" / "tables.md").read_text()
    # The first table has all worlds, the second those of a trial.
    title = re.findall(r"^## (How few cells are enough: .* \(.*, .*\), .*)$", text, re.M)[0]
    return {row[1]: (row[0], row[2].partition(" ")[0]) for row in published_rows("b90", title)[1:]}


def test_ranks_and_budgets_of_entries_that_version_1_had():
    published = ranked_entries()
    for entry, _, rank, budget in table_rows(FOLDER / "limits.md")[1:]:
        assert (rank, budget.rstrip("%")) == published[entry]


def test_learned_policies_beside_rules_and_maps():
    levels = (DATA / "streets" / "tables.md").read_text()
    rows = published_rows("sweep", "dense")
    detections = {row[1]: row[2].split()[0] for row in rows if row[0] == "3%"}
    entries = ranked_entries()
    told = {
        name.partition(",")[0]: [cell.split()[:2] for cell in cells]
        for name, *cells in table_rows(FOLDER / "learned-allocators.md")[1:]
    }
    for policy, budget in told["[B90](b90.md)"]:
        assert entries[policy][1] == budget.rstrip("%")
    for policy, distance in told["first detection"]:
        assert detections[policy] == distance
    for policy, share in told["first sightings"]:
        assert f"| 3% | {policy} | {share.rstrip('%')} |" in levels


SPEEDS = {
    "`CARE-Dense-v0`, steps/s": ("speed", "CARE-Dense-v0", "steps_per_s"),
    "drives at 3%, steps/s": ("speed", "CARE-Drive-v0 at 3%", "steps_per_s"),
    "64 worlds, one thread": ("batches", "64 worlds, one thread", "steps_per_s"),
    "64 worlds, two threads": ("batches", "64 worlds, two threads", "steps_per_s"),
    "64 worlds, two processes": ("batches", "64 worlds, two processes", "steps_per_s"),
    "64 drives of the benchmark at 1%": (
        "batches",
        "64 drives of the benchmark at 1%, two threads",
        "steps_per_s",
    ),
    "64 Euro NCAP tests of the benchmark at 1%": (
        "batches",
        "64 tests of the benchmark at 1%, two threads",
        "steps_per_s",
    ),
    "PPO of Stable-Baselines3, learning included": (
        "batches",
        "PPO of Stable-Baselines3, 8 worlds of CARE-Dense-v0",
        "steps_per_s",
    ),
    "time per scan, Bullet over `fast`": ("ratios", "scan, time of bullet over fast"),
    "Embree over `fast`": ("ratios", "scan, time of Embree (Open3D) over fast"),
    "MuJoCo over `fast`": ("ratios", "scan, time of MuJoCo over fast"),
    "decision of a policy, 40 tracks, p99": ("choices", "p99"),
    "two processes over one, AsyncVectorEnv": ("ratios", "steps/s, two processes over one"),
}
"""Rows of the page, and where their figures are in `bench.json`."""


def test_speeds_and_goals():
    report = json.loads((DATA / "bench.json").read_text())
    told = {name: row for name, *row in table_rows(FOLDER / "software.md")[1:]}
    assert {*told} == {name.replace("`", "") for name in SPEEDS}
    for name, path in SPEEDS.items():
        measured, goal = told[name.replace("`", "")]
        figure = float(np.median(reduce(getitem, path, report)))
        shown, decimals = number(measured)
        assert round(figure, -1 if shown >= 1000 else decimals) == shown, name
        if goal:
            bound, _ = number(goal)
            # A decision takes at most so long; of all else more is better.
            is_met = figure <= bound if " ms" in goal else figure >= bound
            assert ("missed" in goal) != is_met, name


def number(text):
    """The number with which a cell begins, and its decimals."""
    whole, decimals = re.match(r"((?:\d|,(?=\d))+)(?:\.(\d+))?", text).groups("")
    return float(f"{whole.replace(',', '')}.{decimals}"), len(decimals)

"""The published plays of B90: `results/data/b90`, and the entries that stand beside everybody's.

    python docs/b90_results.py --recorded nuscenes:DATA argoverse2:DATA kitti:DATA boreas

plays the published entries under every detector, and writes result files, tables and figure. The
folder `--plays` keeps what is finished: the same command resumes. With `--tables` nothing plays;
tables, figure, the table of `results/b90.md` and the entries of the package are made from the
result files.
"""

import re
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path

from care_sim.base.errors import report_problems
from care_sim.base.files import write_text
from care_sim.base.interrupts import FAILED
from care_sim.reports.budgets import (
    budget_tables,
    format_budget,
    sorted_by_budget,
)
from care_sim.reports.figures.budgets import BUDGETS_FIGURE, budgets_figure
from care_sim.reports.figures.styles import save
from care_sim.reports.recorded import sources_table
from care_sim.reports.statements import columns_table, statements_table
from care_sim.reports.table import Table
from care_sim.study.benchmark.budgets import (
    MAIN_DETECTOR,
    REFERENCE_ENTRIES,
    BudgetResult,
    budget_worlds,
    play_budgets,
)
from care_sim.study.benchmark.play import player_in
from care_sim.study.benchmark.recorded import recorded_drives
from care_sim.study.benchmark.result import publish_references, read_result
from care_sim.study.benchmark.suite import STREETS, Entry
from care_sim.study.runner import by_reason

PAGE = Path(__file__).parents[1] / "results" / "b90.md"
FOLDER = PAGE.parent / "data" / "b90"
DETECTORS = (MAIN_DETECTOR, "megvii", "pointrcnn", "returns")
"""The main one first. The files of the others are in folders by their names."""
DRAWN = ("care-sector", "care-sightlines", "after-ancha", "tuned-place", "learned-sets", "care")
"""The policies of the figure, without parameters."""
COMMAND = "python docs/b90_results.py --recorded nuscenes:DATA argoverse2:DATA kitti:DATA boreas"


def folder_of(detector: str) -> Path:
    """Return the folder of the result files under a detector."""
    return FOLDER if detector == MAIN_DETECTOR else FOLDER / detector


def results_of(detector: str) -> list[BudgetResult]:
    """Read the published results under a detector, in the order of the entries."""
    found = [read_result(path) for path in folder_of(detector).glob("*.json")]
    return sorted(found, key=lambda one: REFERENCE_ENTRIES.index(one.entry))


def statements() -> list[Table]:
    """Return the tables over all detectors that have played, on streets; none for the main one."""
    columns = {detector: results_of(detector) for detector in DETECTORS}
    streets = {
        detector: [one.of_part(STREETS) for one in results]
        for detector, results in columns.items()
        if results
    }
    return [columns_table(streets), statements_table(streets)] if len(streets) > 1 else []


def summary_table() -> Table:
    """Return the table of `results/b90.md`: a line per entry with its B90, that of each part, and
    that of the streets under each other detector that has played.
    """
    ordered = sorted_by_budget(results_of(MAIN_DETECTOR))
    others = {
        detector: {one.entry: one for one in results}
        for detector in DETECTORS[1:]
        if (results := results_of(detector))
    }
    parts = ordered[0].parts
    rows = (
        (
            one.entry.name,
            format_budget(one.score.budget),
            *(format_budget(one.of_part(part).score.budget) for part in parts),
            *(format_budget(played[one.entry].score.budget) for played in others.values()),
        )
        for one in ordered
    )
    return Table(
        "B90 of every entry, of each part, and of streets under other detectors",
        ("policy", "B90", *parts, *others),
        tuple(rows),
    )


def with_table(page: str) -> str:
    """Return the text of the page with its table as the result files are now."""
    lines = summary_table().markdown().splitlines(keepends=True)
    table = "".join(line.replace(" --- ", "---") for line in lines if line.startswith("|"))
    return re.sub(r"(?:^\|.*\n)+", lambda _: table, page, count=1, flags=re.M)


def written() -> str:
    """Return the text of `tables.md` as the result files are now."""
    main = results_of(MAIN_DETECTOR)
    tables = [summary_table(), *budget_tables(main), sources_table(main), *statements()]
    told = "\n".join(table.markdown() for table in tables)
    return f"# B90\n\nMade by `{COMMAND}`.\n\n{told}"


def play(options: Namespace) -> None:
    """Play the published entries under the detectors, and write their files. Exits with 1, and
    writes no file of a detector, where one of its plays failed.
    """
    worlds = budget_worlds(recorded=recorded_drives(options.recorded))
    streets = {STREETS: worlds[STREETS]}
    with player_in(options.plays, options.workers) as player:
        for detector in options.detectors:
            # Other detectors are columns over streets alone.
            played = worlds | streets if detector == MAIN_DETECTOR else streets
            results = play_budgets(REFERENCE_ENTRIES, player, detector, played)
            if player.failures:
                report_problems(by_reason(player.failures, "plays"))
                raise SystemExit(FAILED)
            for result in results:
                result.write(folder_of(detector) / f"{stem_of(result.entry)}.json")


def stem_of(entry: Entry) -> str:
    """Return the name of the result file of an entry."""
    return re.sub(r"[^\w.=-]+", "-", entry.full_name)


def main(words: Sequence[str] | None = None) -> None:
    """Play what `words` say, and write tables, figure and the entries of the package."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--recorded", nargs="+", default=[])
    parser.add_argument("--detectors", nargs="+", default=DETECTORS, choices=DETECTORS)
    parser.add_argument("--plays", type=Path, default=Path("runs/b90"))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--tables", action="store_true")
    options = parser.parse_args(words)
    if not (options.tables or options.recorded):
        parser.error("give --recorded the recorded drives of the published entries, or --tables")
    if not options.tables:
        play(options)
    results = results_of(MAIN_DETECTOR)
    publish_references(results)
    drawn = [one for one in results if one.entry.policy in DRAWN]
    save(budgets_figure(drawn), FOLDER / BUDGETS_FIGURE)
    write_text(FOLDER / "tables.md", written())
    write_text(PAGE, with_table(PAGE.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()

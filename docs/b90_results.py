"""The published plays of B90: the entries that stand beside everybody's, which are the package's
(`care_sim.study.benchmark.result.references`), and `results/data/b90`.

    python docs/b90_results.py --recorded nuscenes:DATA argoverse2:DATA kitti:DATA boreas

plays the published entries under every detector, and writes results, tables and figure. The folder
`--plays` keeps what is finished: the same command resumes. With `--tables` nothing plays;
tables, figure and the table of `results/b90.md` are made from the results.
"""

import re
import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from care_sim.base.errors import report_problems
from care_sim.base.files import write_text
from care_sim.base.interrupts import FAILED
from care_sim.core.conditions import RAYS
from care_sim.evaluation.bootstrap import ratio_of_sums
from care_sim.evaluation.counts import KEPT, SCENE_COUNTS
from care_sim.evaluation.smallest_budget import BUDGETS, ENOUGH
from care_sim.evaluation.strata import EMERGING, ENTERING
from care_sim.reports.budgets import (
    budget_tables,
    budgets_table,
    format_budget,
    ideas_table,
    least_notes,
    parts_table,
    sorted_by_budget,
)
from care_sim.reports.figures.budgets import BUDGETS_FIGURE, budgets_figure
from care_sim.reports.figures.styles import save
from care_sim.reports.recorded import sources_table
from care_sim.reports.statements import QUESTIONS, columns_table, statements_table
from care_sim.reports.table import Table
from care_sim.study.benchmark.bounds import BOUNDS
from care_sim.study.benchmark.budgets import (
    MAIN_DETECTOR,
    REFERENCE_ENTRIES,
    BudgetResult,
    budget_worlds,
    play_budgets,
)
from care_sim.study.benchmark.maker import made_by
from care_sim.study.benchmark.play import Player, player_in
from care_sim.study.benchmark.recorded import RECORDED, RecordedDrive, recorded_drives
from care_sim.study.benchmark.result import (
    publish_references,
    read_list,
    references,
    write_list,
)
from care_sim.study.benchmark.suite import STREETS, TIGHT_TESTS, Entry
from care_sim.study.runner import by_reason
from care_sim.training.supervised.tuned_place import frames_of, joined, write_map

PAGE = Path(__file__).parents[1] / "results" / "b90.md"
FOLDER = PAGE.parent / "data" / "b90"
DETECTORS = (MAIN_DETECTOR, "megvii", "pointrcnn", "returns")
"""The main one first."""
POINT_DETECTORS = ("cluster", "pillars")
"""Detectors that get points. They are slow, and play the streets of a trial."""
WHOLE, NEWEST = "care-sector", "care-aimed"
DRAWN = (
    NEWEST,
    WHOLE,
    "care-sightlines",
    "after-ancha",
    "tuned-place",
    "learned-sets",
    "care",
)
"""The policies of the figure, without parameters."""
COMMAND = "python docs/b90_results.py --recorded nuscenes:DATA argoverse2:DATA kitti:DATA boreas"
WITHOUT = {
    WHOLE: {
        "residual": Entry(WHOLE, (("residual", False),)),
        "tracks": Entry(WHOLE, (("tracks", False),)),
        "explained boxes": Entry(WHOLE, (("explained", False),)),
        "sector ahead": Entry(WHOLE, (("sector", False),)),
        "core first": Entry(WHOLE, cell_order="rows-down"),
    },
    NEWEST: {
        "residual": Entry(NEWEST, (("residual", False),)),
        "tracks": Entry(NEWEST, (("tracks", False),)),
        "last picture": Entry(NEWEST, (("new", False),)),
        "rows ahead": Entry(NEWEST, (("front", False),)),
        "aim": Entry(NEWEST, (("aim", False),)),
        "residual and last picture": Entry(NEWEST, (("new", False), ("residual", False))),
    },
}
"""Policies of ours with one idea removed."""
MORE = [
    entry
    for ideas in WITHOUT.values()
    for entry in ideas.values()
    if entry not in REFERENCE_ENTRIES
]
SMALL = BUDGETS[:4]
WITH_RESIDUAL = (
    (WHOLE, WITHOUT[WHOLE]["residual"].name),
    ("care core-spread", "all-camera core-spread"),
)
"""Published pairs: with the residual and without. `all-camera` has sets for all camera boxes."""
TUNED = Entry("tuned-place", label="tuned on the other drives")
EXAMPLE = Entry("aimed_boxes:AimedBoxes")
"""A short rule, in `docs/examples`."""
TIGHT = FOLDER / "tight.json"
"""The results of the published entries in tight tests."""
FRESH = FOLDER / "fresh.json"
"""The results of seven entries on 200 streets that `care-sim benchmark --fresh 200` drew, after all
numbers of the policies were set."""
TRIAL = FOLDER / "trial.json"
"""The results of entries that are not published: of ideas on the streets of a trial and on all
drives, of `TUNED` on `RECORDED` drives, of `EXAMPLE` on all worlds.
"""

CONVENTIONS = {
    f"{share:.0%}": np.full(len(SCENE_COUNTS), share / ENOUGH)
    for share in (ENOUGH, 0.8, 0.85, 0.95)
} | {"without emerging": np.array([count != EMERGING for count in SCENE_COUNTS], float)}
"""Other scores on streets: by what each count of the full scan is multiplied. A share of 80% of a
count is one of 90% of fewer."""


def trial() -> list[Table]:
    """Return the tables of `TRIAL`: what each idea of two policies is worth, the map that is tuned
    on recorded drives beside two entries, and `EXAMPLE` beside its neighbours on streets.
    """
    played = {one.entry: one for one in read_list(TRIAL)}
    published = references(MAIN_DETECTOR, played[MORE[0]].worlds)
    known = played | {one.entry: one for one in published}
    beside = (Entry(WHOLE), Entry(TUNED.policy))
    compared = [played[TUNED], *(known[entry].of_part(RECORDED) for entry in beside)]
    title = f"B90 of a map that is tuned on recorded drives, {MAIN_DETECTOR}"
    neighbours = [one for one in references(MAIN_DETECTOR) if one.entry.policy in DRAWN]
    return [
        *(
            ideas_table(known[Entry(policy)], {idea: known[one] for idea, one in ideas.items()})
            for policy, ideas in WITHOUT.items()
        ),
        replace(budgets_table(compared), title=title),
        *example_tables(played[EXAMPLE], neighbours),
    ]


def example_tables(example: BudgetResult, neighbours: Sequence[BudgetResult]) -> list[Table]:
    """Return the tables of `EXAMPLE` beside others, over all worlds and of streets."""
    name = example.entry.name
    streets = [one.of_part(STREETS) for one in (example, *neighbours)]
    pairs = [(name, NEWEST), (name, WHOLE)]
    return [
        replace(parts_table([example, *neighbours]), title=f"B90 of {name}, {MAIN_DETECTOR}"),
        statements_table({MAIN_DETECTOR: streets}, pairs),
    ]


def with_fresh() -> list[BudgetResult]:
    """Return the entries of `FRESH` on their streets and the published ones together."""
    published = {one.entry: one.of_part(STREETS).rows for one in references(MAIN_DETECTOR)}
    return [replace(one, rows=published[one.entry] + one.rows) for one in read_list(FRESH)]


def statements(detectors: Sequence[str]) -> list[Table]:
    """Return the tables over those detectors that have played, on their common streets; none for
    one alone.
    """
    columns = {detector: references(detector) for detector in detectors}
    streets = {
        detector: [one.of_part(STREETS) for one in results]
        for detector, results in columns.items()
        if results
    }
    return [columns_table(streets), statements_table(streets)] if len(streets) > 1 else []


def conventions() -> Table:
    """Return the table of pairs on streets, if another share than 90% were enough, or if emerging
    newcomers did not count.
    """
    published = [one for one in references(MAIN_DETECTOR) if one.entry in REFERENCE_ENTRIES]
    streets = [one.of_part(STREETS) for one in published]
    scored = {
        name: [
            replace(one, rows=tuple(row._replace(full=tuple(row.full * by)) for row in one.rows))
            for one in streets
        ]
        for name, by in CONVENTIONS.items()
    }
    pairs = (NEWEST, "care-sightlines"), *QUESTIONS
    return statements_table(scored, pairs, "convention")


def small_budgets() -> Table:
    """Return the table of what `WITH_RESIDUAL` detect on streets at small budgets, in % of a full
    scan's counts, and how many points more than the same policy without the residual.
    """
    columns = {
        detector: {one.entry.name: one.of_part(STREETS) for one in references(detector)}
        for detector in DETECTORS
    }
    rows = []
    for pair in WITH_RESIDUAL:
        for budget, share in enumerate(SMALL):
            counts = [
                cell
                for count in (EMERGING, ENTERING, KEPT)
                for cell in _more(columns[MAIN_DETECTOR], pair, budget, count)
            ]
            others = [_more(columns[one], pair, budget, EMERGING)[-1] for one in DETECTORS[1:]]
            rows.append((pair[0], f"{100 * share:g}%", *counts, *others))
    heads = [
        head
        for count in (EMERGING, ENTERING, KEPT)
        for head in (f"{count}, %", "without", "points more")
    ]
    others = [f"{EMERGING}, points more, {detector}" for detector in DETECTORS[1:]]
    return Table(
        "The residual at small budgets, on streets",
        ("policy", "budget", *heads, *others),
        tuple(rows),
        ("Counts in % of a full scan's. Differences are paired over streets.",),
        names=2,
    )


def _more(
    results: Mapping[str, BudgetResult], pair: tuple[str, str], budget: int, count: str
) -> tuple[str, ...]:
    """Return what two policies detect of a count in %, and the difference with its interval."""
    place = SCENE_COUNTS.index(count)
    ours, theirs = (
        100 * np.array([row.got[budget][place] for row in results[name].rows]) for name in pair
    )
    full = np.array([row.full[place] for row in results[pair[0]].rows])
    more = ratio_of_sums((ours - theirs, full))
    shares = (f"{got.sum() / full.sum():.0f}" for got in (ours, theirs))
    return *shares, f"{more.mean:+.1f} [{more.low:.1f}, {more.high:.1f}]"


def summary_table() -> Table:
    """Return the table of `results/b90.md`: a line per entry with its B90, that of each part, that
    of the tight tests, and that of the streets under each other detector that has played.
    """
    ordered = sorted_by_budget(references(MAIN_DETECTOR))
    others = {TIGHT_TESTS: {one.entry: one for one in read_list(TIGHT)}}
    for detector in (*DETECTORS[1:], *POINT_DETECTORS):
        if results := references(detector):
            fewer = f" ({len(results[0].rows)} streets)" if results[0].quick else ""
            others[f"{detector}{fewer}"] = {one.entry: one for one in results}
    parts = ordered[0].parts
    rows = [
        (
            one.entry.name,
            format_budget(one.score.budget),
            *(format_budget(one.of_part(part).score.budget) for part in parts),
            *(_budget_in(played, one.entry) for played in others.values()),
        )
        for one in ordered
    ]
    return Table(
        "B90 of every entry, of each part, of tight tests, and of streets under other detectors",
        ("policy", "B90", *parts, *others),
        tuple(rows),
        tuple(least_notes(rows)),
    )


def _budget_in(played: Mapping[Entry, BudgetResult], entry: Entry) -> str:
    return format_budget(played[entry].score.budget) if entry in played else ""


def with_table(page: str) -> str:
    """Return the text of the page with its table as the result files are now."""
    lines = summary_table().markdown().splitlines(keepends=True)
    table = "".join(line.replace(" --- ", "---") for line in lines if line.startswith("|"))
    return re.sub(r"(?:^\|.*\n)+", lambda _: table, page, count=1, flags=re.M)


def written() -> str:
    """Return the text of `tables.md` as the results are now."""
    main = references(MAIN_DETECTOR)
    tables = [
        summary_table(),
        *budget_tables(main),
        sources_table(main),
        *trial(),
        budgets_table(read_list(TIGHT)),
        budgets_table(read_list(FRESH)),
        statements_table({MAIN_DETECTOR: with_fresh()}, ()),
        *statements(DETECTORS),
        *statements((*DETECTORS, *POINT_DETECTORS)),
        small_budgets(),
        conventions(),
    ]
    told = "\n".join(table.markdown() for table in tables)
    return f"# B90\n\nMade by `{COMMAND}`.\n\n{told}"


def play(options: Namespace) -> None:
    """Play the published entries under the detectors, and write their results. Exits with 1, and
    writes no results of a detector, where one of its plays failed.
    """
    sys.path.insert(0, str(Path(__file__).parent / "examples"))
    drives = recorded_drives(options.recorded)
    worlds, fewer = (budget_worlds(quick, recorded=drives) for quick in (False, True))
    with player_in(options.plays, options.workers) as player:
        for detector in options.detectors:
            is_main = detector == MAIN_DETECTOR
            is_slow = detector in POINT_DETECTORS
            # Other detectors are columns over streets alone.
            played = worlds if is_main else {STREETS: (fewer if is_slow else worlds)[STREETS]}
            # Bounds count on the recall of the main detector.
            bounds = BOUNDS if is_main else ()
            entries = (*REFERENCE_ENTRIES, *bounds)
            results = play_budgets(entries, player, detector, played, quick=is_slow)
            more = play_budgets(MORE if is_main else (), player, detector, fewer, quick=True)
            if is_main:
                more += play_tuned(worlds[RECORDED], player, options.plays)
                more += play_budgets([EXAMPLE], player, detector, worlds)
                seeds = budget_worlds(closed_loop=True)[TIGHT_TESTS]
                tight = play_budgets(REFERENCE_ENTRIES, player, detector, {TIGHT_TESTS: seeds})
            if player.failures:
                report_problems(by_reason(player.failures, "plays"))
                raise SystemExit(FAILED)
            publish_references(results)
            if is_main:
                write_list(TRIAL, more)
                write_list(TIGHT, tight)


def play_tuned(drives: Sequence[RecordedDrive], player: Player, folder: Path) -> list[BudgetResult]:
    """Play a map per drive that is tuned on all others; return the result of `TUNED` over all
    drives, none if every play failed. The maps are written to `folder`.
    """
    frames = [frames_of(drive.source.film(drive.scene, RAYS)) for drive in drives]
    results = []
    for n, drive in enumerate(drives):
        path = folder / f"without-{drive.scene.name}.npz"
        data = f"recorded drives without {drive.name}"
        write_map(path, joined([*frames[:n], *frames[n + 1 :]]), data=data)
        entry = replace(TUNED, parameters=(("path", str(path)),))
        results += play_budgets([entry], player, MAIN_DETECTOR, {drive.part: [drive]})
    rows = tuple(row for result in results for row in result.rows)
    return [replace(one, entry=TUNED, made_by=made_by(TUNED), rows=rows) for one in results[:1]]


def main(words: Sequence[str] | None = None) -> None:
    """Play what `words` say, and write tables and figure."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--recorded", nargs="+", default=[])
    known = (*DETECTORS, *POINT_DETECTORS)
    parser.add_argument("--detectors", nargs="+", default=known, choices=known)
    parser.add_argument("--plays", type=Path, default=Path("runs/b90"))
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--tables", action="store_true")
    options = parser.parse_args(words)
    if not (options.tables or options.recorded):
        parser.error("give --recorded the recorded drives of the published entries, or --tables")
    if not options.tables:
        play(options)
    plain = [*map(Entry, DRAWN)]
    drawn = [one for one in references(MAIN_DETECTOR) if one.entry in plain]
    save(budgets_figure(drawn), FOLDER / BUDGETS_FIGURE)
    write_text(FOLDER / "tables.md", written())
    write_text(PAGE, with_table(PAGE.read_text(encoding="utf-8")))


if __name__ == "__main__":
    main()

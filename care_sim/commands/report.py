"""`care-sim report`: the tables and figures of folders of results again, or one web page."""

from collections.abc import Iterator
from pathlib import Path

from care_sim.base.errors import InvalidInput, counted, print_lines, report_problems
from care_sim.base.interrupts import DONE, FAILED
from care_sim.commands.options.results import Report
from care_sim.commands.shared.console import TableConsole
from care_sim.commands.shared.selection import source_named
from care_sim.reports.merging import Merged, merged
from care_sim.reports.report import (
    StudyReport,
    next_steps,
    print_minus,
    print_report,
    read_results,
)

_MERGED = Path("runs/merge")


def report(options: Report) -> int:
    """Print tables and draw figures again, merge folders, or write a page."""
    if len(options.folders) > 1:
        return _merge(options)
    (folder,) = options.folders
    if options.minus is not None:
        rows, study, left_out = read_results(folder)
        print_minus(rows, TableConsole(), study, options.minus)
        report_problems([f"left out: {what}" for what in left_out])
        return DONE
    if options.page is not None:
        return _write(options, folder, options.page)
    return _print(folder, options.verbose)


def _print(folder: Path, verbose: bool) -> int:
    rows, study, left_out = read_results(folder)
    made = StudyReport.of(rows, study, left_out)
    try:
        made.write(folder)
    except (OSError, InvalidInput) as error:
        print_report(rows, TableConsole(), study, left_out, verbose=verbose)
        report_problems([f"tables and figures in {folder} are not written anew: {error}"])
        return FAILED
    print_report(rows, TableConsole(), study, left_out, verbose=verbose)
    print_lines(*next_steps(folder, study, rows))
    return DONE


def _write(options: Report, folder: Path, path: Path) -> int:
    # Imported here because it imports Jinja: tables and figures do not need it.
    from care_sim.reports.page.build import write_page

    source = None if options.source is None else source_named(options, options.source)
    page = write_page(folder, path, options.episodes, options.workers, source=source)
    report_problems(page.warnings)
    size = f"{path.stat().st_size / 1e6:.1f} MB"
    print_lines(f"{path}: {size}, {counted(page.watchable, 'episode')} to watch")
    return DONE


def _merge(options: Report) -> int:
    """Put the rows of several folders of one study into a new folder, and report it."""
    out = options.out or _MERGED
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InvalidInput(f"{out} is there already and not empty: give another --out")
    whole = merged(options.folders)
    whole.write(out)
    print_report(whole.rows, TableConsole(), whole.study, whole.left_out, verbose=options.verbose)
    print_lines(*next_steps(out, whole.study, whole.rows))
    if whole.twice:
        alike = counted(whole.twice, whole.study.results.task)
        print(f"Alike in two of the folders, and kept once: {alike}")
    report_problems([*_doubts(whole)])
    return DONE


def _doubts(whole: Merged) -> Iterator[str]:
    """Yield warnings for readers of the tables."""
    for folder in whole.apart:
        yield (
            f"nothing shows that the worlds of {folder} are those of the others: other code played "
            "it, and it has no task in common with them; play full in both"
        )
    if whole.uneven:
        yield (
            "not all policies were played in the same worlds: levels are each one's own, "
            "differences those of the worlds that two share"
        )

"""`care-sim leaderboard`: results of the benchmark in one table, or a tenth of them again."""

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from random import SystemRandom
from tempfile import TemporaryDirectory

from care_sim.base.checks import check_known
from care_sim.base.errors import (
    InvalidInput,
    MissingExtra,
    counted,
    print_lines,
    report_problems,
    unknown,
)
from care_sim.base.files import check_output, json_content, told_if_replaced, write_text
from care_sim.base.interrupts import DONE, FAILED
from care_sim.commands.options.results import Leaderboard
from care_sim.commands.shared.console import TableConsole
from care_sim.policies.isolation import isolated_policies
from care_sim.reports.figures.leaderboard import (
    LEADERBOARD_FIGURE,
    leaderboard_figure,
    score_chart,
)
from care_sim.reports.figures.styles import FORMATS, check_figure, save, stem_of
from care_sim.reports.leaderboard import CONTROL, leaderboard_table, leads_table, names_in
from care_sim.study.benchmark.play import Player, player_in, replayed, screened_worlds
from care_sim.study.benchmark.result import (
    BenchmarkResult,
    elsewhere,
    is_result,
    own_code_of,
    read_result,
)
from care_sim.study.benchmark.suite import Salt, World

_HEAD = (
    "# Leaderboard\n\nWhat is played and why, and how to enter: the page *Report a result* of the "
    "documentation. Made by `care-sim leaderboard`.\n"
)
_FIGURE = f"![Scores with their intervals, and their parts]({LEADERBOARD_FIGURE}.svg)\n"
_TABLES, _TRIALS = Path("runs/leaderboard"), Path("runs/leaderboard-quick")


def leaderboard(options: Leaderboard) -> int:
    """Print the table of result files, or verify them."""
    if options.chart:
        check_known("ending of a chart", options.chart.suffix, FORMATS)
    found, problems = _read(options.results)
    if options.verify:
        problems += _verified(options, found)
    else:
        kept, trials = _of_whole(found, options.quick)
        problems += trials
        if not kept:
            raise _all_bad(problems)
        _show(options, kept)
    report_problems(problems)
    return FAILED if problems else DONE


def _show(options: Leaderboard, results: Sequence[BenchmarkResult]) -> None:
    # One table for the published worlds, one for every sealed set.
    sets: dict[object, list[BenchmarkResult]] = {}
    for each in results:
        sets.setdefault((each.sealed, each.worlds), []).append(each)
    known = names_in(results)
    # The control may be missing: then nobody's lead is told.
    if options.minus != CONTROL.name and options.minus not in known:
        raise unknown("entry", options.minus, known)
    folder = options.out or (_TRIALS if options.quick else _TABLES)
    page = folder / f"{LEADERBOARD_FIGURE}.md"
    check_output(page)
    check_figure(folder / LEADERBOARD_FIGURE)
    told = told_if_replaced(page)
    first = next(iter(sets.values()))
    if options.chart:
        check_figure(stem_of(options.chart))
        save(score_chart(first), stem_of(options.chart))
    save(leaderboard_figure(first), folder / LEADERBOARD_FIGURE)
    tables = [leaderboard_table(own, options.minus) for own in sets.values()]
    by_part = [leads_table(own, options.minus) for own in sets.values()]
    shown = [*tables, *(table for table in by_part if table)]
    write_text(page, "\n".join([_HEAD, *(table.markdown() for table in shown), _FIGURE]))
    for table in tables:
        TableConsole().print(table.rich())
    # Sealed results have a control of their own, which nobody has published.
    if options.minus == CONTROL.name and any(
        options.minus not in names_in(own) for own in sets.values() if own[0].sealed is None
    ):
        print(
            f"no {options.minus} among these files: add a folder with its result for leads",
            file=sys.stderr,
        )
    print_lines(f"Page: {told}", *([f"Chart: {options.chart}"] if options.chart else []))


@isolated_policies()
def _verified(options: Leaderboard, results: dict[Path, BenchmarkResult]) -> list[str]:
    """Print how each result holds; a line for each that does not, or cannot be played."""
    salt = Salt.read(options.sealed) if options.sealed else None
    worlds: list[World] = []
    if salt and any(result.sealed == salt.digest for result in results.values()):
        # Which worlds count is worked out again, once for all results.
        with _player(options) as player:
            worlds = screened_worlds(player, salt)
    problems = []
    for path, result in results.items():
        try:
            with _player(options) as player:
                replay = replayed(result, player, SystemRandom(), salt, worlds)
        except (InvalidInput, MissingExtra) as error:
            problems.append(f"{path} cannot be verified: {error}")
            continue
        drawn = f"{counted(replay.played, 'episode')} of {len(result.rows)}, drawn by lot,"
        made = elsewhere(result)
        if replay.holds:
            print_lines(f"{path}: {drawn} came out again as the file says")
        if replay.detours:
            print_lines(
                f"{path}: of {drawn} {replay.detours} reached as much with another hash; "
                f"played {made}"
            )
        differing = [
            f"of {drawn} {len(replay.differing)} did not go as it says, the first world "
            f"{row.world} of the {row.part} with the {row.camera} camera"
            f"{f'; played {made}' if made else ''}"
            for row in replay.differing[:1]
        ]
        told = [*replay.false, *differing, *map(str, replay.failures[:1])]
        problems += [f"{path}: {problem}" for problem in told]
    return problems


@contextmanager
def _player(options: Leaderboard) -> Iterator[Player]:
    # A journal that lasts would answer with what was played before.
    with (
        TemporaryDirectory(prefix="care-sim-") as folder,
        player_in(Path(folder), options.workers) as player,
    ):
        yield player


def _read(places: Sequence[Path]) -> tuple[dict[Path, BenchmarkResult], list[str]]:
    """The results by file, and a line for every file that is left out.

    Raises InvalidInput where there is none.
    """
    if not places:
        raise InvalidInput("name a folder with results of care-sim benchmark, or several")
    found: dict[Path, BenchmarkResult] = {}
    problems = []
    for path in _files(places):
        try:
            found[path] = read_result(path)
        except InvalidInput as error:
            problems.append(f"left out: {error}")
    if not found:
        none = (
            f"no result of care-sim benchmark in {', '.join(map(str, places))}: play one with "
            "care-sim benchmark --policy NAME"
        )
        raise _all_bad(problems or [none])
    return found, problems


def _all_bad(problems: Sequence[str]) -> InvalidInput:
    """The error where no file is of use: the last complaint, once all others are printed."""
    report_problems(problems[:-1])
    return InvalidInput(problems[-1])


def _files(places: Sequence[Path]) -> Iterator[Path]:
    """The result files of the folders, and the files that are named."""
    for place in places:
        if not place.is_dir():
            yield place
            continue
        for path in sorted(place.glob("*.json")):
            try:
                mine = is_result(json_content(path))
            # A damaged file may have been a result, and is named as one that cannot be read.
            except (OSError, ValueError):
                mine = True
            if mine:
                yield path


def _of_whole(
    found: dict[Path, BenchmarkResult], quick: bool
) -> tuple[list[BenchmarkResult], list[str]]:
    """Return the results that belong in tables, each entry once, and a line for each of the
    others.
    """
    kept: dict[tuple[object, ...], tuple[Path, BenchmarkResult]] = {}
    first_of: dict[str | None, tuple[Path, BenchmarkResult]] = {}
    problems = []
    for path, result in found.items():
        if result.quick and not quick:
            problems.append(
                f"left out: {path} is of --quick, a tenth of the worlds: play the whole, or "
                "compare tenths with care-sim leaderboard --quick"
            )
            continue
        first, other = first_of.setdefault(result.sealed, (path, result))
        if result.sealed and result.worlds != other.worlds:
            problems.append(
                f"{path} has a table of its own: its worlds are not those of {first}, which names "
                "the same salt; verify both with it"
            )
        # Two people may call theirs mine:Mine; of one policy, code and files are the same.
        key = result.sealed, result.entry.name, own_code_of(result)
        if key in kept:
            # The same policy, whole and as a trial, lies in one folder without harm.
            if not quick:
                problems.append(f"left out: {path}, since {kept[key][0]} has its name and its code")
            continue
        kept[key] = path, result.cut_to_tenth() if quick else result
    return [result for _, result in kept.values()], problems

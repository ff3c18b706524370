"""`care-sim leaderboard`: results of the benchmark in a table, or a tenth of them again."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from random import SystemRandom
from tempfile import TemporaryDirectory

from care_sim.base.errors import (
    InvalidInput,
    MissingExtra,
    counted,
    percent,
    print_lines,
    report_problems,
)
from care_sim.base.files import check_output, describe_output, write_text
from care_sim.base.interrupts import DONE, FAILED
from care_sim.commands.options.results import Leaderboard
from care_sim.commands.shared.console import TableConsole
from care_sim.policies.isolation import isolated_policies
from care_sim.reports.budgets import budget_tables
from care_sim.reports.figures.leaderboard import LEADERBOARD_FIGURE, leaderboard_figure
from care_sim.reports.figures.styles import check_figure, save
from care_sim.study.benchmark.budgets import MAIN_DETECTOR, BudgetResult
from care_sim.study.benchmark.maker import detector_files, elsewhere, own_code_of
from care_sim.study.benchmark.play import player_in
from care_sim.study.benchmark.recorded import recorded_drives
from care_sim.study.benchmark.replay import replayed
from care_sim.study.benchmark.result import is_result, read_result, references, with_references
from care_sim.study.benchmark.suite import Salt

_HEAD = (
    "# Leaderboard\n\nThe page *Submit a score* of the documentation says what is played. Made by "
    "`care-sim leaderboard`.\n"
)


def leaderboard(options: Leaderboard) -> int:
    """Print the table of result files, or verify them."""
    found, problems = _read(options.results)
    if options.verify:
        problems += _verified(options, found)
    else:
        _show(options, _tables(found))
    report_problems(problems)
    return FAILED if problems else DONE


def _tables(found: dict[Path, BudgetResult]) -> list[list[BudgetResult]]:
    """Return the results, a list per set of worlds and detector, with the published entries."""
    if not found:
        return [references(MAIN_DETECTOR)]
    sets: dict[object, list[BudgetResult]] = {}
    for each in found.values():
        sets.setdefault(_worlds_of(each), []).append(each)
    return [with_references(own) for own in sets.values()]


def _worlds_of(result: BudgetResult) -> tuple[object, ...]:
    """Return what two results share that can be compared."""
    looking = result.detector, result.detector_parameters, detector_files(result.made_by)
    return *looking, result.sealed, result.worlds


def _show(options: Leaderboard, sets: Sequence[Sequence[BudgetResult]]) -> None:
    names = [f"{LEADERBOARD_FIGURE}-{n}" if n else LEADERBOARD_FIGURE for n in range(len(sets))]
    page = options.out / f"{LEADERBOARD_FIGURE}.md"
    check_output(page)
    for name in names:
        check_figure(options.out / name)
    told = describe_output(page)
    blocks = [_HEAD]
    for name, own in zip(names, sets, strict=True):
        save(leaderboard_figure(own), options.out / name)
        tables = budget_tables(own)
        TableConsole().print(*(table.rich() for table in tables))
        blocks += [*(table.markdown() for table in tables), f"![B90 with intervals]({name}.svg)\n"]
    write_text(page, "\n".join(blocks))
    print_lines(f"Page: {told}")


@isolated_policies()
def _verified(options: Leaderboard, results: dict[Path, BudgetResult]) -> list[str]:
    """Print how each result holds; a line for each that does not, or cannot be played."""
    salt = Salt.read(options.sealed) if options.sealed else None
    drives = recorded_drives(options.recorded)
    problems = []
    for path, result in results.items():
        try:
            # A journal that lasts would answer with what was played before.
            with (
                TemporaryDirectory(prefix="care-sim-") as folder,
                player_in(Path(folder), options.workers) as player,
            ):
                replay = replayed(result, player, SystemRandom(), salt, drives)
        except (InvalidInput, MissingExtra) as error:
            problems.append(f"{path} cannot be verified: {error}")
            continue
        made = elsewhere(result.entry, result.made_by, result.detector_parameters)
        maker = f"; played {made}" if made else ""
        worlds = f"{counted(replay.played, 'world')} of {len(result.rows)}, drawn by lot,"
        moved = f"sums move by up to {percent(round(replay.moved, 3))}"
        if not replay.false:
            print_lines(
                f"{path}: {worlds} "
                + (f"differ in {len(replay.differing)}: {moved}" if replay.differing else "agree")
                + maker
            )
        problems += [f"{path}: {line} ({moved}){maker}" for line in replay.false]
    return problems


def _read(places: Sequence[Path]) -> tuple[dict[Path, BudgetResult], list[str]]:
    """Return the results by file, and a line for every file that is left out.

    Raises InvalidInput where places hold no result.
    """
    found: dict[Path, BudgetResult] = {}
    first: dict[object, Path] = {}
    problems = []
    for path in _files(places):
        try:
            result = read_result(path)
        except InvalidInput as error:
            problems.append(f"left out: {error}")
            continue
        # Two people may call theirs mine:Mine; one policy has the same code and files.
        key = (
            *_worlds_of(result),
            *(result.entry.full_name, own_code_of(result.made_by)),
        )
        if key in first:
            problems.append(f"left out: {path}, since {first[key]} has its name and its code")
        else:
            first[key] = path
            found[path] = result
    if places and not found:
        report_problems(problems[:-1])
        none = f"no result of care-sim benchmark in {', '.join(map(str, places))}"
        raise InvalidInput((problems or [none])[-1])
    return found, problems


def _files(places: Sequence[Path]) -> Iterator[Path]:
    """Yield the files that are named, and the result files of the folders."""
    for place in places:
        if place.is_dir():
            yield from filter(is_result, sorted(place.glob("*.json")))
        else:
            yield place

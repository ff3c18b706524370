"""`care-sim leaderboard`: results of the benchmark in one table, or a tenth of them again."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from random import SystemRandom
from tempfile import TemporaryDirectory
from typing import Annotated

import tyro

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.errors import InvalidInput, counted, report_problems
from care_sim.base.files import check_output, write_text
from care_sim.base.json_text import json_content
from care_sim.commands.shared.study_command import DONE, FAILED, console
from care_sim.reports.figures.files import check_figure, save
from care_sim.reports.figures.leaderboard import LEADERBOARD_FIGURE, leaderboard_figure
from care_sim.reports.leaderboard import leaderboard_table
from care_sim.study.benchmark.player import player_in
from care_sim.study.benchmark.replay import replayed
from care_sim.study.benchmark.result import BenchmarkResult, is_result, read_result
from care_sim.study.benchmark.worlds import Salt
from care_sim.study.executors import CORES, MOST_WORKERS
from care_sim.study.provenance import code_digest


@dataclass(frozen=True, kw_only=True)
class Leaderboard:
    """Make one table, its figure and its page of results of `care-sim benchmark`; or verify them,
    by playing a random tenth of their episodes again.
    """

    results: Annotated[
        tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="FOLDER...")
    ] = ()
    """Folders with result files, or such files. Of two with one name the first counts."""
    quick: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Compare on the tenth of the worlds that `benchmark --quick` plays: a trial."""
    verify: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Play a random tenth of the episodes of every result again, in place of a table. Their
    policies must be installed here."""
    sealed: Path | None = None
    """With --verify: the file with the salt of sealed results."""
    out: Path = Path("runs/leaderboard")
    """Folder for the page and the figure."""
    workers: int = bounded(CORES, 1, MOST_WORKERS)
    """With --verify: processes that play at the same time."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.sealed and not self.verify:
            raise InvalidInput("sealed is the salt of results that are verified: give verify too")

    def __call__(self) -> int:
        """Run it."""
        found, problems = _read(self.results)
        if self.verify:
            problems += self._verified(found)
        else:
            kept, trials = _of_whole(found, self.quick)
            problems += trials
            if not kept:
                raise InvalidInput("; ".join(problems))
            self._show(kept)
        report_problems(problems)
        return FAILED if problems else DONE

    def _show(self, results: Sequence[BenchmarkResult]) -> None:
        # One table for the published worlds, one for every sealed set.
        sets = {
            each.sealed: [one for one in results if one.sealed == each.sealed] for each in results
        }
        tables = [leaderboard_table(own) for own in sets.values()]
        page = self.out / f"{LEADERBOARD_FIGURE}.md"
        check_output(page)
        check_figure(self.out / LEADERBOARD_FIGURE)
        first = next(iter(sets.values()))
        save(leaderboard_figure(first), self.out / LEADERBOARD_FIGURE)
        write_text(page, _page([table.markdown() for table in tables]))
        for table in tables:
            console().print(table.rich())
        print(f"Page: {page}")

    def _verified(self, results: dict[Path, BenchmarkResult]) -> list[str]:
        """Print how each result holds; a line for each that does not."""
        salt = Salt.read(self.sealed) if self.sealed else None
        problems = []
        for path, result in results.items():
            # A journal that lasts would answer with what was played before.
            with (
                TemporaryDirectory(prefix="care-sim-") as folder,
                player_in(Path(folder), self.workers) as player,
            ):
                replay = replayed(result, player, SystemRandom(), salt)
            drawn = f"{counted(replay.played, 'episode')} of {len(result.rows)}, drawn by lot,"
            if replay.holds:
                print(f"{path}: {drawn} went again as it says")
            problems += [
                f"{path}: of {drawn} {len(replay.differing)} did not go as it says, the first "
                f"world {row.world} of the {row.part} with the {row.camera} camera"
                + ("" if _is_of_this_code(result) else "; it was played by other code than is here")
                for row in replay.differing[:1]
            ]
            problems += [f"{path}: {failure}" for failure in replay.failures[:1]]
        return problems


def _is_of_this_code(result: BenchmarkResult) -> bool:
    told = result.made_by.get("versions")
    return isinstance(told, dict) and told.get("code") == code_digest()


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
        raise InvalidInput("; ".join(problems) or none)
    return found, problems


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
    """Those that belong in one table, each name once, and a line for each of the others."""
    kept: dict[tuple[str | None, str], tuple[Path, BenchmarkResult]] = {}
    problems = []
    for path, result in found.items():
        if result.quick and not quick:
            problems.append(
                f"left out: {path} is of --quick, a tenth of the worlds: play the whole, or "
                "compare tenths with care-sim leaderboard --quick"
            )
            continue
        key = result.sealed, result.entry.name
        if key in kept:
            # The same policy, whole and as a trial, lies in one folder without harm.
            if not quick:
                problems.append(f"left out: {path}, since {kept[key][0]} has its name")
            continue
        kept[key] = path, result.cut_to_tenth() if quick else result
    return [result for _, result in kept.values()], problems


def _page(tables: Sequence[str]) -> str:
    reading = (
        "What is played and why, and how to enter: the page *Report a result* of the "
        "documentation. Made by `care-sim leaderboard`."
    )
    figure = f"![Scores with their intervals, and their parts]({LEADERBOARD_FIGURE}.png)"
    return "\n".join(["# Leaderboard\n", f"{reading}\n", *tables, f"{figure}\n"])

"""Whether a study may take a folder: what lies there already, and whether the new rows hold all of
it.
"""

from collections.abc import Collection, Sequence
from pathlib import Path

from care_sim.base.errors import InvalidInput, counted
from care_sim.core.conditions import DEFAULTS
from care_sim.evaluation.sightings import ANNOTATED
from care_sim.reports.studies import SWEEP, Study
from care_sim.study.journal import Journal
from care_sim.study.results_formats import RESULTS_FORMATS, is_parameter
from care_sim.study.rows.parquet import read_notes, read_rows
from care_sim.study.run_config import Row, RunConfig

WAYS_OUT = "give another --out, or --force to replace it"
_USUAL = DEFAULTS | {"presence": ANNOTATED}
"""What a row was asked with that does not say."""
_NAMES = ("scene", "scenario", "policy", "budget")
_SEEDS = ("seed", "floor_seed")
_MOST_TOLD = 3
"""Differing parameters that a refusal tells."""


def check_kind(folder: Path, study: Study) -> None:
    """Raise InvalidInput where the other kind of results lies, which have files of their own."""
    kind = study.results
    for other in RESULTS_FORMATS:
        if other is not kind and (folder / other.file).exists():
            raise InvalidInput(
                f"{folder} holds {other.unit} of another study; the {kind.unit} of the study "
                f"{study.name} need another "
                "--out, with --force too"
            )


def check_results(folder: Path, configs: Sequence[RunConfig], study: Study) -> None:
    """Raise InvalidInput where the results of another study lie, or rows of this one that were
    asked with parameters that nobody asks for now: they would be gone. Damaged results are told as
    they are read.
    """
    path = folder / study.results.file
    if not path.is_file():
        return
    there = read_notes(path)[0] or SWEEP.name
    rows, gone = _rows_and_gone(path, configs, study)
    unit = study.results.unit.removesuffix("s")
    here, wanted = counted(len(rows), unit), counted(len(configs), unit)
    if there != study.name:
        raise InvalidInput(
            f"{folder} holds the study {there}, {here}, which the study {study.name}, {wanted}, "
            "would replace: "
            f"{WAYS_OUT}"
        )
    if gone:
        raise InvalidInput(
            f"{folder} holds {here} of the study {there}; {len(gone)} of them, the first "
            f"{_label(gone[0])}{_differing(gone[0], configs)}, would be gone from the study "
            f"{study.name} that is asked "
            f"for, {wanted}: {WAYS_OUT}"
        )


def lost(folder: Path, played: Sequence[RunConfig], study: Study) -> str:
    """In one line, which rows of the folder are not among those played, where others failed; empty
    for none.
    """
    path = folder / study.results.file
    rows, gone = _rows_and_gone(path, played, study) if path.is_file() else ([], [])
    unit = study.results.unit.removesuffix("s")
    if not gone:
        return ""
    return (
        f"the results in {folder} stay as they were: {len(gone)} of their "
        f"{counted(len(rows), unit)}, the first "
        f"{_label(gone[0])}, would be gone, since this time only {counted(len(played), unit)} did "
        "not fail; the "
        "journal keeps what was played: mend what failed, or --force to replace them"
    )


def check_journal(
    folder: Path, configs: Sequence[RunConfig], journal: Journal, study: Study
) -> None:
    """Raise InvalidInput where an interrupted study is to go on that has another name, or rows that
    nobody asks for now: once other results lie there, its own command is refused. A row counts by
    its parameters, whatever code played it, so that a command goes on after a change of the code.
    """
    if not len(journal) or (folder / study.results.file).is_file():
        return
    rows = counted(len(journal), "row")
    if study.name not in journal.studies:
        raise InvalidInput(
            f"{folder} holds the unfinished study {_joined(journal.studies)}, {rows}, beside "
            f"which the study {study.name} would be played: {WAYS_OUT}"
        )
    if gone := _gone(journal.rows, configs):
        raise InvalidInput(
            f"{folder} holds the unfinished study {_joined(journal.studies)}, {rows}; {len(gone)} "
            "of them, the first "
            f"{_label(gone[0])}{_differing(gone[0], configs)}, are not asked for now: give the "
            "command that began it, "
            "another --out, or --force to play beside them"
        )


def _rows_and_gone(
    path: Path, configs: Sequence[RunConfig], study: Study
) -> tuple[list[Row], list[Row]]:
    """The rows of a file, and those that are none of `configs`."""
    rows = read_rows(path, study.results.schema.lenient)
    return rows, _gone(rows, configs)


def _gone(rows: Sequence[Row], configs: Sequence[RunConfig]) -> list[Row]:
    own = {_identity(config.row()) for config in configs}
    return [row for row in rows if _identity(row) not in own]


def _identity(row: Row) -> frozenset[tuple[str, object]]:
    return frozenset(_asked(row).items())


def _asked(row: Row) -> Row:
    """What a row was asked with, but for what is usual. A file that was given counts as given,
    whatever it held.
    """
    given = {name: value for name, value in row.items() if is_parameter(name) and value is not None}
    if "camera_detections" in given:
        given["camera_detections"] = True
    return {name: value for name, value in given.items() if value != _USUAL.get(name)}


def _label(row: Row) -> str:
    main = [str(row[name]) for name in _NAMES if row.get(name) is not None]
    return " ".join([*main, *(f"{name} {row[name]}" for name in _SEEDS if row.get(name))])


def _differing(row: Row, configs: Sequence[RunConfig]) -> str:
    """In brackets, what tells a row from the task nearest to it, where their labels are the
    same.
    """
    label, there, found = _label(row), _asked(row), []
    for asked in (config.row() for config in configs):
        if _label(asked) == label:
            now = _asked(asked)
            names = [name for name in sorted({*there, *now}) if there.get(name) != now.get(name)]
            found.append([f"{name} {_told(name, there)}, now {_told(name, now)}" for name in names])
    nearest = min(found, key=len, default=[])
    return f" ({'; '.join(nearest[:_MOST_TOLD])})" if nearest else ""


def _told(name: str, asked: Row) -> str:
    value = asked.get(name, _USUAL.get(name))
    return "not given" if value is None else str(value)


def _joined(names: Collection[str]) -> str:
    return " and ".join(sorted(names))

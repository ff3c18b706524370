"""Whether a study may take a folder: what lies there already, and whether the new rows hold all of it."""

from collections.abc import Collection, Sequence
from pathlib import Path

from care_sim.base.errors import InvalidInput
from care_sim.base.text import counted
from care_sim.core.conditions import DEFAULTS
from care_sim.reports.studies import SWEEP, Study
from care_sim.study.journal import Journal
from care_sim.study.results_files import KINDS, is_parameter
from care_sim.study.rows import read_notes, read_rows
from care_sim.study.task import Row, Task

WAYS_OUT = "give another --out, or --force to replace it"


def check_kind(folder: Path, study: Study) -> None:
    """Raise InvalidInput where the other kind of results lies, which have files of their own."""
    kind = study.kind
    for other in KINDS:
        if other is not kind and (folder / other.file).exists():
            raise InvalidInput(
                f"{folder} holds {other.unit} of another study; the {kind.unit} of the study {study.name} need another "
                "--out"
            )


def check_results(folder: Path, configs: Sequence[Task], study: Study) -> None:
    """Raise InvalidInput where the results of another study lie, or rows of this one that were asked with parameters
    that nobody asks for now: they would be gone. Damaged results are told as they are read.
    """
    path = folder / study.kind.file
    if not path.is_file():
        return
    there = read_notes(path)[0] or SWEEP.name
    rows, gone = _rows_and_gone(path, configs, study)
    unit = study.kind.unit.removesuffix("s")
    here, wanted = counted(len(rows), unit), counted(len(configs), unit)
    if there != study.name:
        raise InvalidInput(
            f"{folder} holds the study {there}, {here}, which the study {study.name}, {wanted}, would replace: "
            f"{WAYS_OUT}"
        )
    if gone:
        raise InvalidInput(
            f"{folder} holds {here} of the study {there}; {len(gone)} of them, the first {_label(gone[0])}, would be "
            f"gone from the study {study.name} that is asked for, {wanted}: {WAYS_OUT}"
        )


def lost(folder: Path, played: Sequence[Task], study: Study) -> str:
    """In one line, which rows of the folder are not among those played, where others failed; empty for none."""
    path = folder / study.kind.file
    rows, gone = _rows_and_gone(path, played, study) if path.is_file() else ([], [])
    unit = study.kind.unit.removesuffix("s")
    if not gone:
        return ""
    return (
        f"the results in {folder} stay as they were: {len(gone)} of their {counted(len(rows), unit)}, the first "
        f"{_label(gone[0])}, would be gone, since this time only {counted(len(played), unit)} did not fail; the "
        "journal keeps what was played: mend what failed, or --force to replace them"
    )


def check_journal(folder: Path, journal: Journal, study: Study) -> None:
    """Raise InvalidInput where an interrupted study of another name is to go on."""
    if journal.studies and study.name not in journal.studies and not (folder / study.kind.file).is_file():
        raise InvalidInput(
            f"{folder} holds the unfinished study {_joined(journal.studies)}, {counted(len(journal), 'row')}, beside "
            f"which the study {study.name} would be played: {WAYS_OUT}"
        )


def _rows_and_gone(path: Path, configs: Sequence[Task], study: Study) -> tuple[list[Row], list[Row]]:
    """The rows of a file, and those that are none of `configs`."""
    rows, own = read_rows(path, study.kind.schema.lenient), {_identity(config.row()) for config in configs}
    return rows, [row for row in rows if _identity(row) not in own]


def _identity(row: Row) -> frozenset[tuple[str, object]]:
    """What a row was asked with. A file that was given counts as given, whatever it held."""
    given = {name: value for name, value in row.items() if is_parameter(name) and value is not None}
    if "camera_detections" in given:
        given["camera_detections"] = True
    return frozenset((name, value) for name, value in given.items() if value != DEFAULTS.get(name))


def _label(row: Row) -> str:
    names = ("scene", "scenario", "policy", "budget")
    main = [str(row[name]) for name in names if row.get(name) is not None]
    return " ".join([*main, *(f"{name} {row[name]}" for name in ("seed", "floor_seed") if row.get(name))])


def _joined(names: Collection[str]) -> str:
    return " and ".join(sorted(names))

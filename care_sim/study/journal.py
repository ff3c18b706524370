"""The journal of a study: one line for every finished task, so that nothing computed is lost.

A line is a row as JSON, the name of its study, and at the end a checksum of all before it.
"""

import fcntl
import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import pyarrow as pa

from care_sim.base.errors import InvalidInput, counted
from care_sim.base.files import (
    check_file_size,
    check_no_link,
    json_content,
    parsed_json,
    write_text,
)
from care_sim.study.rows.parquet import with_tuples
from care_sim.study.rows.schema import PARAMETERS, Schema
from care_sim.study.run_config import Row, RunConfig

JOURNAL = "journal.jsonl"
"""Name of the file in a folder of results."""
_STUDY = "study"
_CHECK = "check"
LARGEST_JOURNAL = 2**32
"""Bytes of a journal: the plays of the largest study (100,000 of 10 kB), four times over."""
_LINE = re.compile(rf'(\{{.*), "{_CHECK}": "([0-9a-f]{{16}})"\}}')


class Finished(NamedTuple):
    """The rows of a journal, each once, the studies that they are of, and how many of its lines are
    damaged.
    """

    rows: list[Row]
    studies: set[str]
    damaged: int


class Journal:
    """Finished rows by digest, in a file of JSON lines that only ever grows.

    Opening it reads the rows of earlier runs. A line that was torn by a crash, or whose checksum is
    not that of its text, is passed over, so that its task runs again; `damaged` counts such lines.
    `studies` are those of the rows; `study` is the one whose rows are added.

    Raises OSError when the folder cannot be written, and InvalidInput while another study writes
    there and for a journal larger than `LARGEST_JOURNAL`.
    """

    def __init__(self, path: Path, study: str = "sweep"):
        self._study = study
        path.parent.mkdir(parents=True, exist_ok=True)
        check_no_link(path)
        if path.exists():
            _check_journal(path)
        self._file = path.open("a+", encoding="utf-8", errors="replace")
        # Locked before it is read: another process may be adding lines.
        self._lock(path.parent)
        self._file.seek(0)
        text = self._file.read()
        there = _finished(text)
        self.damaged = there.damaged
        self.studies = there.studies
        self._rows = {row["digest"]: row for row in there.rows}
        # A torn last line is closed, so that the next row does not continue it.
        if text and not text.endswith("\n"):
            self._write("\n")

    def __contains__(self, digest: str) -> bool:
        return digest in self._rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, digest: str) -> Row:
        return self._rows[digest]

    @property
    def rows(self) -> list[Row]:
        """All rows, those of other options too."""
        return [*self._rows.values()]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()

    def drop_unsound(self, configs: Sequence[RunConfig], schema: Schema) -> None:
        """Drop rows whose parameters are not those of the task under whose key they stand, and rows
        that lack a column of the schema. Their tasks run again.
        """
        found = [config for config in configs if config.key in self]
        sound = [config for config in found if _is_of(config, self[config.key])]
        # Row by row only where the table of all rows has a fault.
        if sound and _has_fault([self[config.key] for config in sound], schema):
            sound = [config for config in sound if not _has_fault([self[config.key]], schema)]
        for key in {config.key for config in found} - {config.key for config in sound}:
            del self._rows[key]
            self.damaged += 1

    def append(self, row: Row) -> None:
        """Keep a finished row. When this returns, the operating system has it, and it outlives this
        process.
        """
        self._write(_line(row | {_STUDY: self._study}))
        self._rows[row["digest"]] = row

    def _lock(self, folder: Path) -> None:
        """Keep other processes out until the file is closed, however this process ends."""
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            self._file.close()
            raise InvalidInput(
                f"another study writes to {folder} now; wait for its end or give another --out"
            ) from error
        except OSError:
            pass  # a file system without locks

    def _write(self, text: str) -> None:
        try:
            self._file.write(text)
            self._file.flush()
        except OSError as error:
            # With the name of the file, which errors of write lack.
            raise OSError(error.errno, error.strerror, self._file.name) from error


def _is_of(config: RunConfig, row: Row) -> bool:
    """Whether the row has the parameters of the task, and no others."""
    asked = config.row()
    return all(name in row and row[name] == value for name, value in asked.items()) and not any(
        name.startswith(PARAMETERS) and name not in asked for name in row
    )


def _has_fault(rows: Sequence[Row], schema: Schema) -> bool:
    names = schema.known([*dict.fromkeys(name for row in rows for name in row)])
    try:
        table = pa.table({name: [row.get(name) for row in rows] for name in names})
    except (pa.ArrowException, OverflowError):
        return True
    return any(schema.faults(table))


def read_journal(path: Path) -> Finished:
    """What a journal holds, none where there is no file; another process may be adding lines."""
    if not path.is_file():
        return Finished([], set(), 0)
    _check_journal(path)
    return _finished(path.read_text(encoding="utf-8", errors="replace"))


def is_written(path: Path) -> bool:
    """Whether a process that runs now adds lines to the journal."""
    if not path.is_file():
        return False
    try:
        with path.open(encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass  # no journal, or a file system without locks
    return False


def _finished(text: str) -> Finished:
    # Not splitlines: a text in a row may hold other line separators.
    lines = [line for line in text.split("\n") if line]
    sound = [row for line in lines if (row := _read(line)) is not None]
    studies = {row.pop(_STUDY) for row in sound}
    rows = {row["digest"]: row for row in sound}
    return Finished([*rows.values()], studies, len(lines) - len(sound))


def _check_journal(path: Path) -> None:
    try:
        check_file_size(path, LARGEST_JOURNAL)
    except ValueError as error:
        raise InvalidInput(f"{path} is no journal: {error}") from error


def _line(row: Row) -> str:
    text = json.dumps(row).removesuffix("}")
    return f'{text}, "{_CHECK}": "{_checksum(text)}"}}\n'


def _read(line: str) -> Row | None:
    """The row of a line with the name of its study, None of a damaged one."""
    whole = _LINE.fullmatch(line)
    if whole is None or _checksum(whole[1]) != whole[2]:
        return None
    try:
        row = parsed_json(whole[1] + "}")
    except ValueError:
        return None
    named = all(isinstance(row.get(name), str) for name in ("digest", _STUDY))
    return with_tuples(row) if named else None


def _checksum(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:16]


UNFINISHED = "unfinished.json"
"""Name of the file, which is there from the begin of a study to its end."""


@dataclass(frozen=True)
class Unfinished:
    """A study by name, its `tasks`, called by their `unit` (episodes), and the `command` that
    plays it. The journal held `others` rows before that it does not ask for.
    """

    study: str
    unit: str
    tasks: int
    others: int
    command: str

    def write(self, folder: Path) -> None:
        """Leave it in the folder."""
        write_text(folder / UNFINISHED, json.dumps(asdict(self), indent=1) + "\n")

    @classmethod
    def read(cls, folder: Path) -> Self | None:
        """What lies in the folder; None where nothing does that can be read."""
        try:
            plain = json_content(folder / UNFINISHED)
            told = cls(**plain)
        except (OSError, ValueError, TypeError):
            return None
        kinds = dict.fromkeys(("study", "unit", "command"), str) | {"tasks": int, "others": int}
        whole = all(type(plain[name]) is kind for name, kind in kinds.items())
        return told if whole else None


def how_far(folder: Path) -> str:
    """A line on the study that has begun in the folder and not ended; empty where none has.

    Raises InvalidInput for a journal that is too large.
    """
    begun = Unfinished.read(folder)
    if begun is None and not (folder / JOURNAL).is_file():
        return ""
    kept = len(read_journal(folder / JOURNAL).rows)
    if begun is None:
        return (
            f"{folder} holds an unfinished study, {counted(kept, 'row')}; run again the command "
            "that began it"
        )
    done = f"{kept - begun.others} of {begun.tasks} {begun.unit}"
    line = f"{folder} holds an unfinished study, {begun.study}: {done} are played"
    if is_written(folder / JOURNAL):
        return f"{line}, and it is being played now"
    return f"{line}; to go on: {begun.command or 'run again the command that began it'}"


def forget(folder: Path) -> None:
    """The study in the folder has ended."""
    (folder / UNFINISHED).unlink(missing_ok=True)

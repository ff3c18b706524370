"""The journal of a study, with a line for every finished task, so that no result is lost. Also the
note in a folder while its study has not ended.

A line is a row as JSON, the name of its study, and at the end a checksum of all before it.
"""

import fcntl
import hashlib
import json
import re
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

from care_sim.base.errors import InvalidInput, counted
from care_sim.base.files import (
    check_file_size,
    check_no_link,
    json_content,
    parsed_json,
    write_text,
)
from care_sim.study.rows.parquet import with_tuples
from care_sim.study.run_config import Row

JOURNAL = "journal.jsonl"
"""Name of the file in a folder of results."""
UNFINISHED = "unfinished.json"
"""Name of the note, which exists from the beginning of a study to its end."""
_STUDY = "study"
_CHECK = "check"
LARGEST_JOURNAL = 2**32
"""Bytes of a journal: the plays of the largest study (100,000 of 10 kB), four times over."""
_LINE = re.compile(rf'(\{{.*), "{_CHECK}": "([0-9a-f]{{16}})"\}}')


class Finished(NamedTuple):
    """The rows of a journal, each once, their studies, and the number of damaged lines."""

    rows: list[Row]
    studies: set[str]
    damaged: int


class Journal:
    """Finished rows by digest, in a file of JSON lines that only ever grows.

    Opening it reads the rows of earlier runs. Lines that are torn by a crash, or have a wrong
    checksum, are skipped, so that their tasks run again; `damaged` counts them. `studies` are those
    of the rows; `study` is the one whose rows are added.

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
        rows, self.studies, self.damaged = _finished(text)
        self._rows = {row["digest"]: row for row in rows}
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
        """Return all rows, also those of other options."""
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

    def append(self, row: Row) -> None:
        """Keep a finished row. When this returns, the operating system has it, and it outlives this
        process.
        """
        text = json.dumps(row | {_STUDY: self._study}).removesuffix("}")
        self._write(f'{text}, "{_CHECK}": "{_checksum(text)}"}}\n')
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


def read_journal(path: Path) -> Finished:
    """Read a journal, empty if there is no file; another process may be adding lines."""
    if not path.is_file():
        return Finished([], set(), 0)
    _check_journal(path)
    return _finished(path.read_text(encoding="utf-8", errors="replace"))


def is_written(path: Path) -> bool:
    """Whether a process that runs now adds lines to the journal."""
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


def note_begin(folder: Path, study: str, tasks: str, others: int, command: str) -> None:
    """Write the note into the folder, until `forget`: the study, its `tasks` in words, and the
    `command` that plays them. `others` is the number of earlier journal rows outside the study.
    """
    note = {"study": study, "tasks": tasks, "others": others, "command": command}
    write_text(folder / UNFINISHED, json.dumps(note, indent=1) + "\n")


def describe_progress(folder: Path) -> str:
    """Return a line on an unfinished study in the folder; empty without one.

    Raises InvalidInput for a journal that is too large.
    """
    if not any((folder / name).is_file() for name in (UNFINISHED, JOURNAL)):
        return ""
    kept = len(read_journal(folder / JOURNAL).rows)
    line = f"{folder} holds an unfinished study"
    again = "run again the command that began it"
    try:
        note = json_content(folder / UNFINISHED)
        played = f"{kept - note['others']} of {note['tasks']} are played"
        line = f"{line}, {note['study']}: {played}"
        command = note["command"] or again
    except (OSError, ValueError, TypeError, KeyError):
        # The note is lost or damaged.
        return f"{line}, {counted(kept, 'row')}; {again}"
    if is_written(folder / JOURNAL):
        return f"{line}, and it is being played now"
    return f"{line}; to go on: {command}"


def forget(folder: Path) -> None:
    """Remove the note: the study in the folder has ended."""
    (folder / UNFINISHED).unlink(missing_ok=True)

"""The journal of a study: a line for every finished episode, so that nothing computed is lost."""

import fcntl
import json
from pathlib import Path
from types import TracebackType
from typing import Self

from care_sim.errors import InvalidInput
from care_sim.study.rows import with_tuples
from care_sim.study.task import Row


class Journal:
    """Finished rows by digest, in a file of JSON lines that only ever grows.

    Opening it reads the rows of earlier runs. A line that was torn by a crash is passed over, so its
    episode runs again. Raises OSError when the folder cannot be written, InvalidInput while another study
    writes there.
    """

    def __init__(self, path: Path):
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("a+", encoding="utf-8", errors="replace")
        self._lock(path.parent)
        self._file.seek(0)
        text = self._file.read()
        self._rows = {row["digest"]: row for line in text.splitlines() if (row := _parsed(line)) is not None}
        if text and not text.endswith("\n"):
            self._write("\n")

    def __contains__(self, digest: str) -> bool:
        return digest in self._rows

    def __len__(self) -> int:
        return len(self._rows)

    def __getitem__(self, digest: str) -> Row:
        return self._rows[digest]

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()

    def append(self, row: Row) -> None:
        """Keep a finished episode; with the operating system when this returns."""
        self._write(json.dumps(row) + "\n")
        self._rows[row["digest"]] = row

    def _lock(self, folder: Path) -> None:
        """Keep others out until the file is closed, however this process ends."""
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
        self._file.write(text)
        self._file.flush()


def _parsed(line: str) -> Row | None:
    try:
        row = json.loads(line)
    except json.JSONDecodeError:
        return None
    return with_tuples(row) if isinstance(row, dict) and "digest" in row else None

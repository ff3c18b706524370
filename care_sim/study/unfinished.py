"""What a folder of results tells of a study that has begun in it and not ended: how far it is, and
the command that goes on.
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Self

from care_sim.base.errors import counted
from care_sim.base.files import json_content, write_text
from care_sim.study.journal import JOURNAL, is_written, read_journal

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

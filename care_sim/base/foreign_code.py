"""Where an error was raised in code that is not ours: the place that its author looks for."""

import inspect
import site
import sysconfig
from importlib.metadata import entry_points
from pathlib import Path
from traceback import walk_tb
from types import FrameType

_OURS = Path(__file__).parent.parent
_FOLDERS = (
    *(sysconfig.get_path(name) for name in ("stdlib", "purelib", "platlib")),
    # A system's own packages and those of `pip install --user` lie elsewhere.
    *site.getsitepackages(),
    site.getusersitepackages(),
)
_LIBRARIES = [Path(folder) for folder in dict.fromkeys(_FOLDERS)]
_GROUPS = "care_sim."
"""How the names of our groups of entry points begin."""


def foreign_place(error: BaseException) -> str:
    """File and line, in brackets after a space, where an error left the code of a user or of a
    package that adds something to the benchmark; empty where no such code was running.
    """
    places = [
        f" ({Path(frame.f_code.co_filename).name}, line {line})"
        for frame, line in walk_tb(error.__traceback__)
        if _is_foreign(frame)
    ]
    # The innermost one: what it calls is ours or a library's, and was called wrongly.
    return places[-1] if places else ""


def raised_place(error: BaseException) -> str:
    """File and line that raised an error, in brackets after a space; empty where there is none."""
    places = [(frame.f_code.co_filename, line) for frame, line in walk_tb(error.__traceback__)]
    return f" ({Path(places[-1][0]).name}, line {places[-1][1]})" if places else ""


def is_raised_by_foreign(error: BaseException) -> bool:
    """Whether foreign code raised an error itself, not what it called."""
    frames = [frame for frame, _ in walk_tb(error.__traceback__)]
    return bool(frames) and _is_foreign(frames[-1])


def class_place(kind: type) -> str:
    """A class with its file and line, in brackets after a space; empty where it has no file."""
    try:
        _, line = inspect.getsourcelines(kind)
        return f" (class {kind.__name__}, {Path(inspect.getfile(kind)).name}, line {line})"
    except (OSError, TypeError):
        return ""


def _is_foreign(frame: FrameType) -> bool:
    """Whether the code of a frame is neither ours nor that of a library which adds nothing."""
    file = Path(frame.f_code.co_filename)
    # What Python itself makes, such as the methods of dataclasses, has a name in brackets.
    if not file.is_absolute() or file.is_relative_to(_OURS):
        return False
    if not any(map(file.is_relative_to, _LIBRARIES)):
        return True
    return _top(frame.f_globals.get("__name__", "")) in _plugged_in()


def _plugged_in() -> set[str]:
    """The top-level modules of packages that add something."""
    try:
        installed = entry_points()
    except (OSError, MemoryError):  # the error at hand may be of a limit that holds here, too
        return set()
    ours = [group for group in installed.groups if group.startswith(_GROUPS)]
    return {_top(entry.module) for group in ours for entry in installed.select(group=group)}


def _top(module: str) -> str:
    return module.partition(".")[0]

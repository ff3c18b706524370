"""What ends a command from outside: an interrupt or a quit typed, a terminal that closes, a request
to end; and the exit codes of commands.

It imports nothing that takes time: the command `care-sim` is interrupted in one line from the first
of its imports on.
"""

import os
import signal
import sys
from collections.abc import Callable
from typing import Any

DONE = 0
FAILED = 1
"""Something failed, such as code of the user's own or a limit of the machine, or was left out."""
BAD_INPUT = 2
UNEXPECTED = 70
"""A fault in the software: `EX_SOFTWARE` of BSD."""
INTERRUPTED = 130
UNREAD = 141
"""Nobody reads the output: what a shell gives for SIGPIPE, 128 + 13."""

SIGNALS = tuple(
    getattr(signal, name)
    for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")
    if hasattr(signal, name)
)
"""All end a command in the same way."""
_heard: list[int] = []


def end_at_once() -> None:
    """From now on an interrupt ends the process: one line, and nothing is waited for."""
    _listen(_end)


def raise_them() -> None:
    """From now on an interrupt is a KeyboardInterrupt."""
    _listen(_raise)


def end_in_silence() -> None:
    """From now on an interrupt is the system's to handle: all is said, and the interpreter is
    ending.
    """
    _listen(signal.SIG_DFL)


def was_interrupted(error: BaseException) -> bool:
    """Whether an error is an interrupt, or came after one: code that is interrupted in the middle,
    such as an import, may raise an error of its own.
    """
    return bool(_heard) or isinstance(error, KeyboardInterrupt)


def _listen(handler: Callable[[int, Any], Any] | signal.Handlers) -> None:
    """What a shell or nohup has told this process to ignore stays ignored."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _end(*_: object) -> None:
    # Written to the descriptor itself: in a handler, what prints may be in the middle of printing.
    os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, b"care-sim: interrupted\n")
    os._exit(INTERRUPTED)


def _raise(number: int, _: object) -> None:
    _heard.append(number)
    raise KeyboardInterrupt


def is_command() -> bool:
    """Whether this process is the command `care-sim` or begins as `python -m care_sim`, and none
    that the command started.
    """
    arguments = getattr(sys, "argv", None) or [""]
    name = os.path.basename(arguments[0])
    # Python calls a module "-m" until it is found. Its name stands before its arguments.
    is_module = name == "-m" and sys.orig_argv[-len(arguments)].removeprefix("-m") == "care_sim"
    return (name == "care-sim" or is_module) and "--multiprocessing-fork" not in sys.orig_argv


if is_command():
    end_at_once()

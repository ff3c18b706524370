"""Events that end a command from outside (an interrupt or a quit typed, a terminal that closes, a
request to end), and the exit codes of commands.

It imports nothing that takes time: the command `care-sim` is interrupted in one line from the first
of its imports on.
"""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
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
_HEARD = (*SIGNALS, signal.SIGALRM)
SOON_S = 0.02
"""Seconds after which an interrupt that came at a bad moment is raised again."""


def end_at_once() -> None:
    """Let later interrupts end the process at once, with one line."""
    _listen(_end)


def raise_interrupts() -> None:
    """Raise later interrupts as KeyboardInterrupt, where they are not lost.

    An import may turn an interrupt into another error: the interrupt is then raised after the
    import, or with the next one. Errors in finalisers and callbacks cannot be caught: an interrupt
    in them is raised again.
    """
    _listen(_raise)
    signal.signal(signal.SIGALRM, _raise)
    sys.unraisablehook = _raise_again


def end_in_silence() -> None:
    """Leave later interrupts to the system, since the interpreter is ending."""
    signal.setitimer(signal.ITIMER_REAL, 0)
    _listen(signal.SIG_DFL)


@contextmanager
def hold_interrupts() -> Iterator[None]:
    """Hold interrupts back until the end of the block, for work that must not be left half done."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    # Only handlers of Python can wait in a list. Signals that are ignored, or that the system
    # handles, stay so.
    waiting: list[int] = []
    with _defer_signals():
        handlers = {number: signal.getsignal(number) for number in _HEARD}
        before = {number: handler for number, handler in handlers.items() if callable(handler)}
        for number in before:
            signal.signal(number, lambda number, _: waiting.append(number))
    try:
        yield
    finally:
        with _defer_signals():
            for number, handler in before.items():
                signal.signal(number, handler)
        # One is enough: all end a command in the same way. It is raised when the handlers are back.
        for number in waiting[:1]:
            signal.raise_signal(number)


@contextmanager
def _defer_signals() -> Iterator[None]:
    """Handle signals that come meanwhile at the end, so that handlers change all at once."""
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, ())
    try:
        signal.pthread_sigmask(signal.SIG_BLOCK, _HEARD)
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _listen(handler: Callable[[int, Any], Any] | signal.Handlers) -> None:
    """Set the handler of all signals but those that a shell or nohup made this process ignore."""
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, handler)


def _end(*_: object) -> None:
    # Written to the descriptor itself: in a handler, what prints may be in the middle of printing.
    os.write(sys.__stderr__.fileno() if sys.__stderr__ else 2, b"care-sim: interrupted\n")
    os._exit(INTERRUPTED)


def _raise(number: int, frame: FrameType | None) -> None:
    # An import may catch what is raised within it and raise an error of its own. So an interrupt
    # that falls into an import is put off: an alarm calls this handler again, until the import has
    # ended. If a second interrupt comes while the alarm is set, it is raised at once.
    is_alarm = number == signal.SIGALRM
    one_waits = signal.getitimer(signal.ITIMER_REAL)[0] > 0
    is_second = one_waits and not is_alarm
    if _imports(frame) and not is_second:
        signal.setitimer(signal.ITIMER_REAL, SOON_S)
    else:
        raise KeyboardInterrupt


def _imports(frame: FrameType | None) -> bool:
    """Whether an import is going on: its machinery is among the callers."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def _raise_again(lost: "sys.UnraisableHookArgs") -> None:
    """Have an interrupt that nobody could catch raised once more, a moment later."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        signal.setitimer(signal.ITIMER_REAL, SOON_S)
    else:
        sys.__unraisablehook__(lost)


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

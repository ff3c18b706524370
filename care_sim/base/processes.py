"""Processes that this one starts: deaf to interrupts, which are this one's to handle, gone when it
is gone, and blind to what lies in the current folder.
"""

import multiprocessing
import os
import signal
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from multiprocessing import resource_tracker, util
from typing import TypeVar

from care_sim.base.interrupts import SIGNALS, hold_interrupts

_T = TypeVar("_T")

LOOK_S = 1.0
"""Seconds between two looks at whether the starter is there."""

UNHEARD = {number for number in SIGNALS if number != signal.SIGTERM}
"""Signals that a terminal sends to all its processes. Pools end workers by SIGTERM."""

_LONGEST_FOLDER = 75
"""Bytes of the folder for temporary files: the address of a socket inside one of its folders holds
107 in all.
"""
_SAFE_PATH = "PYTHONSAFEPATH"
"""Where it is set, a new Python does not search the current folder before all libraries."""


@contextmanager
def starting() -> Iterator[None]:
    """Processes started meanwhile, and theirs, never hear the terminal's interrupts; this one hears
    them afterwards, when nothing is half started.

    They search for modules where this one does: no file of the current folder stands for a library.
    """
    _shorten_socket_folder()
    with hold_interrupts(), _safe_path():
        # Blocked signals stay blocked over fork and exec: a new process is deaf before it runs a
        # line.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, UNHEARD)
        try:
            # It outlives the processes whose leavings it clears away; starting it unblocks SIGINT.
            resource_tracker.ensure_running()
            signal.pthread_sigmask(signal.SIG_BLOCK, UNHEARD)
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _safe_path() -> Iterator[None]:
    # multiprocessing starts Python with `-c`, and the fork server imports before it knows where.
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        del os.environ[_SAFE_PATH]
        if before is not None:
            os.environ[_SAFE_PATH] = before


def _shorten_socket_folder() -> None:
    """Make the folder for the sockets of multiprocessing in /tmp where TMPDIR is too long for one;
    the processes that this one starts use the same folder.
    """
    if len(os.fsencode(tempfile.gettempdir())) > _LONGEST_FOLDER:
        usual, tempfile.tempdir = tempfile.tempdir, "/tmp"
        try:
            util.get_temp_dir()
        finally:
            tempfile.tempdir = usual


def end_with_parent() -> None:
    """End this process, which multiprocessing started, soon after the process that requested it,
    however that ended. A fork server's worker waits for the process that asked for it, not
    for the fork server, which ends after its last worker.
    """
    # A thread waits for the parent, and as a daemon it keeps nobody: no signal tells a child that
    # its parent was killed.
    parent = multiprocessing.parent_process()
    if parent is not None:
        threading.Thread(
            target=_end_after, args=[parent], name="end with parent", daemon=True
        ).start()


def following(make: Callable[[], _T]) -> _T:
    """Return what `make` makes, in a process that ends with its parent."""
    end_with_parent()
    return make()


def lead_group() -> None:
    """Put this process into a group of its own, with the processes that it starts from now on."""
    os.setpgid(0, 0)


def end_group_with_work() -> None:
    """End this process and its group as soon as its work is done, whatever threads and processes
    were started meanwhile.
    """
    lead_group()
    # multiprocessing waits for threads and child processes after these finalizers.
    util.Finalize(None, _end_group, exitpriority=0)
    util.Finalize(None, flush_output, exitpriority=1)


def flush_output() -> None:
    """Write out what was printed, since a process that is killed does not."""
    with suppress(Exception):  # whatever foreign code has put there
        sys.stdout.flush()


def _end_after(parent: "multiprocessing.process.BaseProcess") -> None:
    parent.join()
    _end_group()


def _end_group() -> None:
    """End this process, and its group if it leads one."""
    if os.getpgrp() == os.getpid():
        os.killpg(0, signal.SIGKILL)
    os._exit(1)

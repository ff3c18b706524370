"""Limits of memory, processes and open files that a shell, a batch system or a container sets.

The command `care-sim` checks them before it imports its libraries, which end a process in their own
words where they find too little. So this module imports nothing that takes time.
"""

import errno
import os
import resource
import threading

from care_sim.base.causes import causes
from care_sim.base.cores import CORES
from care_sim.base.interrupts import is_command

FAILED = 1
"""Exit code of a command that a limit has ended."""
_BYTES_PER_THREAD = 100_000_000
_MEMORY = {
    "address space": (resource.RLIMIT_AS, 3_000_000_000, "ulimit -v"),
    "data": (resource.RLIMIT_DATA, 1_500_000_000, "ulimit -d"),
}
"""Bytes that the libraries of a study reserve besides their threads, measured on two cores. The
libraries hang or abort where one of their threads cannot start.
"""
_TASKS_OF_A_WORKER = 4
_TASKS_OF_A_POOL = 16
"""The fork server, the tracker of resources, and threads of libraries."""
_FILES = 16
"""Files that a command opens beside those that it inherits. Rerun aborts where it is imported with
fewer than 5.
"""
_STACK_BYTES = 2**16
_UNMAPPED = ("failed to map segment", "cannot allocate memory", "cannot create shared object")
"""How the system's loader says that there is no room for a library."""


class LimitReached(OSError):
    """The machine, or a limit that is set on it, allows too little."""


def check_memory() -> None:
    """Raise LimitReached where a limit leaves too little memory for the libraries."""
    for name, (number, reserved, command) in _MEMORY.items():
        limit, _ = resource.getrlimit(number)
        least = reserved + _BYTES_PER_THREAD * _library_threads()
        if 0 <= limit < least:
            suffices = reserved + _BYTES_PER_THREAD <= limit
            instead = ", or set OMP_NUM_THREADS=1" if suffices else ""
            raise LimitReached(
                f"{name} is limited to {limit / 1e9:.2f} GB, and care-sim needs "
                f"{least / 1e9:.2f} GB: raise the limit ({command}){instead}"
            )


def _library_threads() -> int:
    """Count the threads that each library starts: one per core, unless OMP_NUM_THREADS is less."""
    asked = os.environ.get("OMP_NUM_THREADS", "")
    return min(CORES, max(int(asked), 1)) if asked.isdecimal() else CORES


def check_workers(workers: int) -> None:
    """Raise LimitReached unless so many worker processes can be started now."""
    _check_tasks(_TASKS_OF_A_WORKER * workers + _TASKS_OF_A_POOL, ", or lower --workers")


def limit_in(error: BaseException) -> str:
    """Say in one line which limit an error or one of its causes ran into; empty for another one."""
    for link in causes(error):
        if isinstance(link, LimitReached):
            return str(link)
        number = link.errno if isinstance(link, OSError) else None
        if number in (errno.EMFILE, errno.ENFILE):
            return "too many files are open: raise the limit (ulimit -n), or lower --workers"
        if number == errno.EAGAIN or link.args == ("can't start new thread",):
            return "too many processes or threads: raise the limit (ulimit -u), or lower --workers"
        is_unmapped = isinstance(link, ImportError) and any(w in str(link.msg) for w in _UNMAPPED)
        if number == errno.ENOMEM or isinstance(link, MemoryError) or is_unmapped:
            return (
                "the memory does not suffice: raise the limit (ulimit -v, ulimit -d), or lower "
                "--workers"
            )
    return ""


def _check_tasks(count: int, instead: str = "") -> None:
    """Raise LimitReached unless so many processes or threads can be added: Linux counts both."""
    end, started = threading.Event(), list[threading.Thread]()
    usual = threading.stack_size(_STACK_BYTES)
    try:
        for _ in range(count):
            thread = threading.Thread(target=end.wait, daemon=True)
            thread.start()
            started.append(thread)
    except RuntimeError:
        raise LimitReached(
            f"{len(started)} processes or threads can be added, and care-sim needs {count}: raise "
            f"the limit (ulimit -u){instead}"
        ) from None
    finally:
        threading.stack_size(usual)
        end.set()
        for thread in started:
            thread.join()


def check_files() -> None:
    """Raise LimitReached unless a command can open the files that it needs."""
    opened = list[int]()
    try:
        while len(opened) < _FILES:
            opened.append(os.open(os.devnull, os.O_RDONLY))
    except OSError as error:
        if error.errno not in (errno.EMFILE, errno.ENFILE):
            raise
        raise LimitReached(
            f"{len(opened)} files can be opened, and care-sim needs {_FILES}: raise the limit "
            "(ulimit -n)"
        ) from None
    finally:
        for file in opened:
            os.close(file)


def check_at_start() -> None:
    """End the process in one line where its limits leave too little for the libraries."""
    try:
        check_memory()
        check_files()
        # Linear algebra starts its threads when it is imported.
        _check_tasks(_library_threads() + 1)
    except LimitReached as reached:
        os.write(2, f"care-sim: {reached}\n".encode())
        os._exit(FAILED)
    # Arrow's own allocator reserves a gigabyte at once. Under a limit, the rest may be too small
    # for another library, which then aborts.
    os.environ["ARROW_DEFAULT_MEMORY_POOL"] = "system"


if is_command():
    check_at_start()

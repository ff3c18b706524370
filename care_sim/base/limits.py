"""Limits that the machine sets this process: cores, memory, processes, a folder for caches.

A shell, a batch system or a container may set limits. Libraries that find too little end a process
with unclear messages. So the command `care-sim` checks limits before it imports its libraries, and
this module imports nothing that takes time.
"""

import errno
import os
import resource
import stat
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import ceil
from pathlib import Path
from typing import Any

from care_sim.base.interrupts import FAILED, is_command


def usable_cores(
    groups: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")
) -> int:
    """Count the cores that the affinity and the control groups of Linux leave to this process.

    `groups` is where control groups of version 2 are mounted. `own` lists those of the process.
    """
    affinity = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min([affinity or 1, *(ceil(quota) for quota in _quotas(groups, own))]))


def _quotas(groups: Path, own: Path) -> Iterator[float]:
    """Yield the cores that each control group of the process allows, and each group above."""
    lines = own.read_text().splitlines() if own.exists() else []
    for line in lines:
        if not line.startswith("0::"):
            continue
        place = groups / line.removeprefix("0::").strip("/")
        # In a container the path may be the host's, of which only the mount's root is there.
        for folder in (place, *place.parents):
            with suppress(OSError, ValueError, ZeroDivisionError):  # "max" allows all
                quota, period = map(int, (folder / "cpu.max").read_text().split())
                yield quota / period
            if folder == groups:
                break


CORES = usable_cores()
"""Cores that this process may use, as counted when the package was imported."""
MOST_WORKERS = 1024
"""Most worker processes; each takes about 100 MB."""
WORKERS = min(CORES, MOST_WORKERS)
"""Workers unless another number is asked for."""

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


def causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an error, the error that led to it, and so on, as Python's trace shows them.

    An error raised `from None` has no cause. Each error comes once: code that raises an error again
    while it handles another one may close a circle.
    """
    known: set[int] = set()
    while error is not None and id(error) not in known:
        known.add(id(error))
        yield error
        is_hidden = error.__cause__ is not None or error.__suppress_context__
        error = error.__cause__ if is_hidden else error.__context__


def is_interrupt(error: BaseException) -> bool:
    """Whether an error is an interrupt, or what compiled code has made of one."""
    # A compiled module that is interrupted while it is imported raises ImportError or SystemError,
    # a compiled function SystemError. Both keep the interrupt as the cause.
    links = causes(error) if isinstance(error, ImportError | SystemError) else [error]
    return any(isinstance(link, KeyboardInterrupt) for link in links)


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


@contextmanager
def one_thread(torch: Any) -> Iterator[None]:
    """Let PyTorch compute in one thread while this lasts."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _settle_caches() -> None:
    """Send the caches of this process, and of those that it starts, to a private temporary folder
    where the home folder cannot be written. The command `care-sim` says so in one line.
    """
    given = os.environ.get("MPLCONFIGDIR")
    if given and not _can_be_written(given):
        # Matplotlib would complain with the whole name, and take a new folder at every start.
        del os.environ["MPLCONFIGDIR"]
        if is_command():
            print("care-sim: MPLCONFIGDIR cannot be written, and is ignored", file=sys.stderr)
    home = os.path.expanduser("~")
    has_home = os.path.isabs(home)
    settled = {"XDG_CACHE_HOME", "MPLCONFIGDIR"} <= {*os.environ}
    if has_home and (settled or os.access(home, os.W_OK)):
        return
    try:
        folder = _private_folder()
    except OSError:  # a container whose whole disk is read-only
        folder = Path(os.devnull)
    if not has_home:
        os.environ["HOME"] = str(folder)
    os.environ.setdefault("XDG_CACHE_HOME", str(folder))
    os.environ.setdefault("MPLCONFIGDIR", str(folder / "matplotlib"))
    if is_command():
        print(f"care-sim: no home folder to write to: caches go to {folder}", file=sys.stderr)


def _can_be_written(folder: str) -> bool:
    """Return True if a folder, or the nearest one above it that exists, can be written."""
    path = Path(folder)
    try:
        nearest = next((each for each in (path, *path.parents) if each.exists()), path)
        return nearest.is_dir() and os.access(nearest, os.W_OK)
    except OSError:
        return False


def _private_folder() -> Path:
    """The folder of this user among the temporary files; a new one where somebody else could write
    to it, since caches of Numba hold code. Raises OSError where there is no place for it.
    """
    folder = Path(tempfile.gettempdir()) / f"care-sim-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()
    is_private = (found.st_uid, stat.S_IMODE(found.st_mode)) == (os.getuid(), 0o700)
    return folder if is_private and stat.S_ISDIR(found.st_mode) else Path(tempfile.mkdtemp())


if is_command():
    check_at_start()
_settle_caches()

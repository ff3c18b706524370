"""Campaign: commands under odd limits of memory, processes, files, stack and time."""

import os
import resource
import shutil
import signal
import tempfile
from pathlib import Path

from tests.torture import warm
from tests.torture.case import FOUND, REFUSED
from tests.torture.judge import ending
from tests.torture.processes import Command

LIMIT_S = 60.0
SIZES = {
    "AS": (0, 2**20, 500_000_000, 2**31, 4 * 2**30, 2**40),
    "DATA": (0, 2**20, 500_000_000, 1_650_000_000, 2**31, 2**33),
    "NOFILE": (0, 3, 4, 8, 16, 32, 64, 256, 4096),
    "FSIZE": (2**15, 2**16, 2**18, 2**20),  # what a case says goes to files, too
    "STACK": (2**16, 2**18, 2**20, 2**23, 2**30),
    "CPU": (1, 2, 5, 1000),
    "CORE": (0, 1, 2**20),
}
PROCESSES = (0, 1, 2, 3, 4, 8, 16, 64)
STUDY = ("sweep", "--scenarios", "dartout", "--policies", "care", "--seeds", "2", "--workers", "2")
CANNOT_EXECUTE = 126
"""The exit code of a shell, and of `setpriv`, for a program that cannot be started."""
HONEST = (signal.SIGXCPU, signal.SIGKILL)
"""The system ends what has used up its time."""
FOUND_CASES = (
    ("AS", 500_000_000, ("run", "dartout", *warm.TINY)),
    ("NPROC", 3, (*STUDY, *warm.TINY)),
    ("NOFILE", 7, ("list", "policies")),
)

prepare, FORKS = warm.prepare, warm.FORKS


def drawn(case):
    """A limit, its size, and a command line."""
    if case.name.seed == FOUND:
        return FOUND_CASES[case.name.number]
    # Another user needs a process of its own, which takes seconds.
    name = "NPROC" if case.rng.random() < 0.02 else case.rng.choice((*SIZES,))
    if name == "NPROC":
        line = case.rng.choice(((*STUDY, *warm.TINY), ("list", "policies")))
        return name, case.rng.choice(PROCESSES), line
    around = case.rng.choice((1.0, 1.0, 0.9, 1.1))
    return name, int(case.rng.choice(SIZES[name]) * around), case.rng.choice(warm.LINES)


def play(case):
    name, size, arguments = drawn(case)
    case.tell(f"RLIMIT_{name} {size}: care-sim {' '.join(arguments)}")
    number = getattr(resource, f"RLIMIT_{name}")
    if name == "NPROC":
        return _another_user(arguments, case.folder, size)
    honest = HONEST if name == "CPU" else ()
    return warm.play(arguments, case.folder, lambda: _limit(number, size), honest)


def _limit(number, size):
    _, most = resource.getrlimit(number)
    if most != resource.RLIM_INFINITY:
        size = min(size, most)
    used = resource.getrusage(resource.RUSAGE_SELF) if number == resource.RLIMIT_CPU else None
    if used:
        size += int(used.ru_utime + used.ru_stime)
    resource.setrlimit(number, (size, most))


def _another_user(arguments, folder, size):
    """Root may start as many processes as it likes."""
    if os.geteuid() != 0 or not shutil.which("setpriv"):
        arguments = ("--version",)
    for place in (folder, *folder.parents):
        if place == Path(tempfile.gettempdir()):
            break
        place.chmod(0o777)
    own = dict.fromkeys(("HOME", "MPLCONFIGDIR"), str(folder))
    with Command(arguments, folder, tasks=size, **own) as command:
        code = command.wait()
        out, err = command.said()
        command.check_gone()
    # Linux starts no program for a user who is over the limit already.
    if code == CANNOT_EXECUTE and err.startswith("setpriv: failed to execute"):
        return REFUSED
    return ending(code, out, err, arguments)

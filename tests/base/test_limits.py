"""Limits of memory and processes end a command in one line that names the limit."""

import errno
import os
import resource
import shutil
import subprocess
import sys

import pytest

from care_sim.base import limits
from care_sim.base.limits import LimitReached, causes, check_workers, limit_in
from care_sim.study.executors import processes
from tests.torture.commands import TINY
from tests.torture.processes import ANOTHER_USER, entry_point


def ended(arguments, prefix=(), limited=None):
    """Exit code and stderr of the command."""
    done = subprocess.run(
        [*prefix, sys.executable, "-c", entry_point(), *arguments],
        capture_output=True,
        text=True,
        preexec_fn=limited,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("name", ["AS", "DATA"])
@pytest.mark.parametrize("size", [200_000_000, 500_000_000, 1_500_000_000])
def test_too_little_memory(name, size):
    number = getattr(resource, f"RLIMIT_{name}")
    code, err = ended(
        ["list", "policies"], limited=lambda: resource.setrlimit(number, (size, size))
    )
    assert code == limits.FAILED
    command = {"AS": "ulimit -v", "DATA": "ulimit -d"}[name]
    (line,) = err.splitlines()
    assert line.startswith("care-sim: ")
    assert f"raise the limit ({command})" in line


def test_the_module_is_checked_as_the_command_is():
    done = subprocess.run(
        [sys.executable, "-m", "care_sim", "policies"],
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (500_000_000, 500_000_000)),
    )
    line = "care-sim: address space is limited to 0.50 GB, and care-sim needs "
    assert (done.returncode, done.stderr[: len(line)]) == (limits.FAILED, line)


def test_many_cores_need_less_with_one_thread_each(monkeypatch):
    monkeypatch.setattr(limits, "CORES", 64)
    monkeypatch.setattr(limits.resource, "getrlimit", lambda _: (8_000_000_000, -1))
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with pytest.raises(LimitReached, match=r"needs 9.40 GB: raise .*, or set OMP_NUM_THREADS=1$"):
        limits.check_memory()
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    limits.check_memory()


@pytest.mark.parametrize(("name", "size"), [("AS", 3_600_000_000), ("DATA", 1_600_000_000)])
def test_memory_that_suffices(name, size, tmp_path):
    number = getattr(resource, f"RLIMIT_{name}")
    code, err = ended(
        ["run", "dartout", "--record", str(tmp_path / "x.rrd"), *TINY],
        ("env", "OMP_NUM_THREADS=1"),
        limited=lambda: resource.setrlimit(number, (size, size)),
    )
    assert (code, err) == (0, "")


@pytest.mark.skipif(os.geteuid() != 0 or not shutil.which("setpriv"), reason="needs another user")
def test_too_few_processes():
    code, err = ended(
        ["list", "policies"],
        ANOTHER_USER,
        lambda: resource.setrlimit(resource.RLIMIT_NPROC, (1, 1)),
    )
    assert code == limits.FAILED
    (line,) = err.splitlines()
    assert line.startswith("care-sim: 0 processes or threads can be added, and care-sim needs ")
    assert line.endswith("raise the limit (ulimit -u)")


def test_workers_that_cannot_be_started(monkeypatch):
    starts, usual = [], limits.threading.Thread.start

    def start(thread):
        if len(starts) == 9:
            raise RuntimeError("can't start new thread")
        starts.append(thread)
        usual(thread)

    monkeypatch.setattr(limits.threading.Thread, "start", start)
    with pytest.raises(LimitReached, match=r"^9 processes .* needs 24: .* or lower --workers$"):
        processes(2)
    assert not any(thread.is_alive() for thread in starts)


def test_workers_that_can_be_started():
    check_workers(2)


@pytest.mark.parametrize(
    ("error", "named"),
    [
        (MemoryError(), "ulimit -v"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "ulimit -v"),
        (ImportError("x.so: failed to map segment from shared object"), "ulimit -v"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "ulimit -u"),
        (RuntimeError("can't start new thread"), "ulimit -u"),
        (OSError(errno.EMFILE, "Too many open files"), "ulimit -n"),
        (OSError(errno.ENOSPC, "No space left on device"), ""),
        (ImportError("No module named x"), ""),
        (ValueError("memory"), ""),
    ],
)
def test_an_error_names_its_limit(error, named):
    other = ValueError("behind")
    other.__cause__ = error
    for told in (limit_in(error), limit_in(other)):
        assert named in told
        assert bool(told) == bool(named)


def test_a_circle_of_errors_has_an_end():
    first, second = ValueError("first"), OSError(errno.ENOSPC, "No space left on device")
    first.__cause__, second.__cause__ = second, first
    assert limit_in(first) == ""
    assert [*causes(first)] == [first, second]


def test_an_error_raised_from_none_hides_what_was_handled():
    error = ValueError("behind")
    error.__context__ = MemoryError()
    assert "ulimit -v" in limit_in(error)
    error.__suppress_context__ = True
    assert limit_in(error) == ""

"""The processes that a process has started, found by a mark in their environment, whoever their
parent is by now.
"""

import os
import signal
import subprocess
import time
import uuid
from contextlib import suppress
from pathlib import Path

import pytest

INTERRUPTS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT)


class Marked:
    """A process in a session of its own, and all that it starts."""

    def __init__(self, command, **options):
        if not Path("/proc/self/environ").exists():
            pytest.skip("needs /proc")
        self._mark = f"CARE_SIM_TEST={uuid.uuid4().hex}"
        name, _, value = self._mark.partition("=")
        quiet = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True} | options
        environment = os.environ | {name: value}
        self.process = subprocess.Popen(
            command,
            env=environment,
            start_new_session=True,
            preexec_fn=listen_to_interrupts,
            **quiet,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for pid in self.alive():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self.process.communicate()

    def alive(self):
        """The processes that run, the process itself included."""
        return marked(self._mark)

    def all_end_within(self, seconds):
        """Whether none is left after that time."""
        return until(lambda: not self.alive(), seconds)


def marked(mark):
    """The ids of the processes that run and have a mark somewhere in their environment."""
    return [int(folder.name) for folder in Path("/proc").glob("[0-9]*") if _runs(folder, mark)]


def _runs(folder, mark):
    try:
        state = (folder / "stat").read_text().rpartition(")")[2].split()[0]
        return mark.encode() in (folder / "environ").read_bytes() and state not in "ZX"
    except OSError:
        return False


def until(condition, seconds):
    """Wait for a condition; whether it came true."""
    deadline = time.monotonic() + seconds
    while not (there := condition()) and time.monotonic() < deadline:
        time.sleep(0.02)
    return there


def listen_to_interrupts():
    """A process that is started in the background, as the tests may be, inherits ignored
    interrupts.
    """
    for number in INTERRUPTS:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_SETMASK, [])

"""Real processes of `care-sim`: started as the installed command is, watched, and looked for when
they should be gone.

Every process that a case starts carries a mark in its environment, which those that it starts
inherit, fork servers and workers among them; marks of the one who started it stand before it.
"""

import os
import resource
import signal
import subprocess
import sys
import threading
import time
import tomllib
import uuid
from contextlib import suppress
from pathlib import Path

from tests.helpers.descendants import listen_to_interrupts, marked
from tests.helpers.places import ROOT
from tests.torture.case import Fault

MARK = "CARE_SIM_TORTURE"
MEMORY = 2**30
_RIGHTS = "-all,+dac_override"
ANOTHER_USER = (
    *("setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", f"--inh-caps={_RIGHTS}"),
    *(f"--ambient-caps={_RIGHTS}", f"--bounding-set={_RIGHTS}"),
)
"""Before a command: it runs as nobody, who may read and write where root does."""
HANGS_S = 10.0
"""On a quiet machine; others are given `patience` times as long."""
LEAVES_S = 6.0
"""Seconds until all that an ended process leaves behind has to be gone."""
POLL_S = 0.02


def new_mark():
    return uuid.uuid4().hex


def end(mark):
    """End all of a mark."""
    for _ in range(50):
        left = marked(mark)
        for pid in left:
            with suppress(OSError):
                os.kill(pid, signal.SIGKILL)
        if not left:
            return
        time.sleep(0.02)


def patience():
    """How many times longer a thing may take by the clock: where many wait for a core, all are
    slow.
    """
    return 2 * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


def entry_point():
    """Python code that does what the command `care-sim` does, under its name."""
    scripts = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["scripts"]
    module, function = scripts["care-sim"].split(":")
    return (
        f"import sys; sys.argv[0] = 'care-sim'; "
        f"from {module} import {function}; sys.exit({function}())"
    )


class Command:
    """`care-sim` with arguments, in a session of its own; a context manager that leaves nothing
    behind.

    `file_bytes`: the largest file that it may write, which stands in for a full disk. `stdout`: a
    device in its place, or a "closed pipe". `tasks`: how many processes and threads it may have, as
    another user than root.
    """

    def __init__(self, arguments, folder, file_bytes=None, stdout=None, tasks=None, **environment):
        self.arguments, self.mark = [str(argument) for argument in arguments], new_mark()

        def limited():
            listen_to_interrupts()
            # Its memory is watched (`wait`). The limit of a case counts from what the server had
            # imported, which may be less than a command reserves.
            resource.setrlimit(resource.RLIMIT_DATA, (resource.RLIM_INFINITY,) * 2)
            if file_bytes is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (file_bytes, file_bytes))
            if tasks is not None:
                resource.setrlimit(resource.RLIMIT_NPROC, (tasks, tasks))

        usual = {"PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
        usual[MARK] = f"{os.environ.get(MARK, '')}/{self.mark}"
        output = _output(stdout)
        self.process = subprocess.Popen(
            [
                *(() if tasks is None else ANOTHER_USER),
                *(sys.executable, "-c", entry_point(), *self.arguments),
            ],
            cwd=folder,
            stdin=subprocess.DEVNULL,
            stdout=output,
            stderr=subprocess.PIPE,
            env=os.environ | usual | environment,
            start_new_session=True,
            preexec_fn=limited,
        )
        if stdout is not None:
            os.close(output)
        self._said = [bytearray(), bytearray()]
        streams = self.process.stdout, self.process.stderr
        for stream, said in zip(streams, self._said, strict=True):
            if stream:
                threading.Thread(target=_listen, args=(stream, said), daemon=True).start()
        self.started = time.monotonic()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        end(self.mark)
        self.process.wait()

    def until(self, condition, seconds=60.0):
        """Wait until something holds or it ends."""
        deadline = time.monotonic() + seconds
        while not condition() and self.process.poll() is None and time.monotonic() < deadline:
            time.sleep(POLL_S)

    def wait(self, seconds=HANGS_S):
        """Its exit code; a fault where it takes longer than `seconds`, or more memory than is
        allowed.
        """
        deadline = time.monotonic() + seconds * patience()
        while self.process.poll() is None:
            if time.monotonic() > deadline:
                told = f"{self.arguments}\n{self.said()}\n{self.stacks()}"
                raise Fault("hang", told, "a process of its own")
            for held in map(_resident, marked(self.mark)):
                if held > MEMORY:
                    told = f"{held} bytes: {self.arguments}"
                    raise Fault("memory above 1 GB", told, "a process of its own")
            time.sleep(5 * POLL_S)
        return self.process.returncode

    def said(self):
        """Stdout and stderr so far; what it said last may take a moment."""
        time.sleep(POLL_S)
        return [bytes(said).decode("utf-8", "replace") for said in self._said]

    def others(self):
        """The processes that it has started, and those have."""
        return [pid for pid in marked(self.mark) if pid != self.process.pid]

    def check_gone(self):
        """A fault where it left a process behind."""
        deadline = time.monotonic() + LEAVES_S
        while marked(self.mark):
            if time.monotonic() > deadline:
                raise Fault("processes left behind", f"{self.arguments}\n{self.stacks()}")
            time.sleep(0.1)

    def stacks(self):
        """The calls in which its processes wait, as far as the kernel tells."""
        return "\n".join(f"{pid} {_told(pid)}" for pid in marked(self.mark))


def _output(name):
    """Where stdout goes."""
    if name is None:
        return subprocess.PIPE
    if name != "closed pipe":
        return os.open(name, os.O_WRONLY)
    reading, writing = os.pipe()
    os.close(reading)
    return writing


def _listen(stream, said):
    with stream:
        while block := os.read(stream.fileno(), 2**16):
            said += block


def _resident(pid):
    with suppress(OSError, ValueError):
        return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")
    return 0


def _told(pid):
    folder = Path("/proc") / str(pid)
    with suppress(OSError):
        words = (folder / "cmdline").read_bytes().split(b"\0")
        line = b" ".join(words).decode("utf-8", "replace")
        return f"{line[:200]} ({(folder / 'wchan').read_text()})"
    return ""

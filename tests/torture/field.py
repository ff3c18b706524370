"""Where campaigns are held: a few workers, a clock, and a list of what went wrong.

A case hangs that takes longer than the campaign's `LIMIT_S` of processor time, or
`processes.patience` times that on the clock, which forgives a busy machine. Its stack tells where;
the worker is ended and another takes its place.
"""

import importlib
import json
import os
import selectors
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from tests.helpers.places import ROOT
from tests.torture import processes
from tests.torture.case import Name
from tests.torture.judge import place_of_stack

MOST_CASES = 4000
"""Of one worker: what it gathers is let go then."""
PREPARES_S = 300.0
"""What a case needs has to be there by then, templates and imports."""


@dataclass(frozen=True)
class Failure:
    """A fault by its case; `key` is what it has in common with others that are the same fault."""

    name: str
    kind: str
    place: str
    detail: str
    steps: tuple[str, ...]

    @property
    def key(self):
        return self.kind, self.place

    def __str__(self):
        steps = "\n".join(f"  {step[:3000]}" for step in self.steps)
        title = f"{self.name}: {self.kind} at {self.place or '?'}"
        return f"{title}\n{steps}\n{self.detail}\nalone: make torture CASE={self.name}"


@dataclass
class Tally:
    """What came of a campaign."""

    endings: Counter = field(default_factory=Counter)
    failures: list[Failure] = field(default_factory=list)
    seconds: float = 0.0
    slowest: tuple[float, str] = (0.0, "")

    def __str__(self):
        cases = sum(self.endings.values())
        ends = ", ".join(f"{count} {ending}" for ending, count in sorted(self.endings.items()))
        distinct = len({failure.key for failure in self.failures})
        return (
            f"{cases} cases in {self.seconds:.0f} s ({ends}); "
            f"{len(self.failures)} faults, {distinct} distinct; "
            f"slowest {self.slowest[0]:.1f} s, {self.slowest[1]}"
        )


class Field:
    """Workers that play the cases of a campaign; a context manager."""

    def __init__(self, workers, told=lambda failure: None):
        self.folder = Path(tempfile.mkdtemp(prefix="torture-"))
        self._workers = [_Worker(self.folder, number) for number in range(workers)]
        self._told = told

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for worker in self._workers:
            worker.end()
        shutil.rmtree(self.folder, ignore_errors=True)

    def play(self, names, until=float("inf")):
        """Play the cases of one campaign, until the clock (`time.monotonic`) says so; what came of
        them.
        """
        tally, names, started = Tally(), iter(names), time.monotonic()
        waiting = dict.fromkeys(self._workers)
        while waiting:
            for worker in list(waiting):
                if not worker.busy:
                    name = next(names, None) if time.monotonic() < until else None
                    if name is None:
                        del waiting[worker]
                    else:
                        worker.hand(name)
            for worker in _ready(waiting):
                for answer in worker.answers():
                    self._count(tally, answer)
        tally.seconds = time.monotonic() - started
        return tally

    def _count(self, tally, answer):
        tally.endings[answer["ended"]] += 1
        tally.slowest = max(tally.slowest, (answer["seconds"], answer["name"]))
        if answer["ended"] == "fault":
            failure = Failure(
                answer["name"],
                answer["kind"],
                answer["place"],
                answer["detail"],
                tuple(answer["steps"]),
            )
            tally.failures.append(failure)
            self._told(failure)


def _ready(workers):
    """The workers that have something to say, or have hung; waits a moment for one."""
    with selectors.DefaultSelector() as selector:
        for worker in workers:
            selector.register(worker.output, selectors.EVENT_READ, worker)
        ready = [key.data for key, _ in selector.select(0.5)]
    return ready or [worker for worker in workers if worker.overdue()]


class _Worker:
    def __init__(self, folder, number):
        self._folder, self._stacks = folder, folder / f"stacks-{number}"
        self._steps = folder / f"steps-{number}"
        self._mark = processes.new_mark()
        self._process = None
        self._played = 0
        self._name = self._began = self._handed = self._campaign = None

    @property
    def busy(self):
        return self._name is not None

    @property
    def output(self):
        return self._process.stdout

    def hand(self, name):
        """Give it a case."""
        campaign = importlib.import_module(f"tests.torture.{name.campaign}")
        is_unfit = getattr(campaign, "FORKS", False) and name.campaign != self._campaign
        if self._process is None or self._played >= MOST_CASES or is_unfit:
            self._begin_anew()
        self._campaign = name.campaign
        self._name, self._began, self._buffer = name, None, b""
        self._handed = time.monotonic()
        self._played += 1
        self._process.stdin.write(f"{name}\n".encode())
        self._process.stdin.flush()

    def overdue(self):
        """Whether its case, or what that needs first, has taken too long."""
        if self._name is None:
            return False
        if self._began is None:
            return time.monotonic() - self._handed > processes.patience() * PREPARES_S
        limit = importlib.import_module(f"tests.torture.{self._name.campaign}").LIMIT_S
        clock, busy = self._began
        return (
            time.monotonic() - clock > processes.patience() * limit or self._busy_s() - busy > limit
        )

    def answers(self):
        """What it has to say of its case: nothing yet, or one answer."""
        if self.overdue():
            return [self._given_up()]
        data = os.read(self.output.fileno(), 2**20)
        if not data:
            return [self._died()]
        self._buffer += data
        *lines, self._buffer = self._buffer.split(b"\n")
        return [answer for line in lines for answer in self._heard(json.loads(line))]

    def _heard(self, message):
        if "broken" in message:
            raise RuntimeError(f"campaign {self._name}: {message['broken']}")
        if "begins" in message:
            self._began = time.monotonic(), self._busy_s()
            return []
        self._name = self._began = None
        if message.pop("spent"):
            self._played = MOST_CASES
        return [message]

    def _given_up(self):
        self._process.send_signal(signal.SIGUSR1)
        time.sleep(1.0)
        return self._lost("hang" if self._began else "hang before it begins")

    def _died(self):
        code = self._process.wait()
        return self._lost(
            "memory above 1 GB" if code == -signal.SIGKILL else f"the process died ({code})"
        )

    def _lost(self, kind):
        stack, steps = (
            path.read_text(errors="replace") if path.exists() else ""
            for path in (self._stacks, self._steps)
        )
        name, seconds = self._name, time.monotonic() - (self._began or (time.monotonic(),))[0]
        self.end()
        lost = {"kind": kind, "place": place_of_stack(stack), "detail": stack[:4000]}
        lost["steps"] = steps.splitlines() if self._began else []
        return lost | {"name": str(name), "ended": "fault", "seconds": seconds}

    def _begin_anew(self):
        self.end()
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = os.environ | {
            "PYTHONPATH": path,
            "OMP_NUM_THREADS": "1",
            "PYTHONHASHSEED": "0",
            processes.MARK: self._mark,
        }
        self._process = subprocess.Popen(
            [
                sys.executable,
                "-m",
                "tests.torture.worker",
                str(self._folder),
                str(self._stacks),
                str(self._steps),
            ],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment,
            start_new_session=True,
        )
        self._played = 0

    def _busy_s(self):
        with suppress(OSError, IndexError):
            fields = Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()
            return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        return 0.0

    def end(self):
        """End it and all that it started."""
        self._name = self._began = None
        if self._process is not None:
            for stream in (self._process.stdin, self._process.stdout):
                with suppress(OSError):
                    stream.close()
            processes.end(self._mark)
            self._process.wait()
            self._process = None


def names(campaign, seed, first=0):
    """The names of a campaign's cases, without end."""
    number = first
    while True:
        yield Name(campaign, seed, number)
        number += 1

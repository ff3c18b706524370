"""Where campaigns are held: servers that play cases, a clock, and a list of what went wrong."""

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from threading import Lock

from tests.helpers.places import ROOT
from tests.torture import processes
from tests.torture.case import Name


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
    """The outcome of a campaign."""

    endings: Counter = field(default_factory=Counter)
    failures: list[Failure] = field(default_factory=list)
    seconds: float = 0.0
    slowest: tuple[float, str] = (0.0, "")

    def note(self, answer):
        """Take in the answer of a case."""
        self.endings[answer["ended"]] += 1
        self.slowest = max(self.slowest, (answer["seconds"], answer["name"]))
        if answer["ended"] == "fault":
            told = (answer[one] for one in ("name", "kind", "place", "detail"))
            self.failures.append(Failure(*told, tuple(answer["steps"])))

    def __str__(self):
        ends = ", ".join(f"{count} {ending}" for ending, count in sorted(self.endings.items()))
        distinct = len({failure.key for failure in self.failures})
        return (
            f"{sum(self.endings.values())} cases in {self.seconds:.0f} s ({ends}); "
            f"{len(self.failures)} faults, {distinct} distinct; "
            f"slowest {self.slowest[0]:.1f} s, {self.slowest[1]}"
        )


class Field:
    """Servers that play the cases of a campaign; a context manager."""

    def __init__(self, servers):
        self._folder = Path(tempfile.mkdtemp(prefix="torture-"))
        self._mark = processes.new_mark()
        self._servers = [self._server(number) for number in range(servers)]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        processes.end(self._mark)
        for server in self._servers:
            server.communicate()
        shutil.rmtree(self._folder, ignore_errors=True)

    def play(self, names, until=float("inf")):
        """Play the cases of one campaign, until the clock (`time.monotonic`) says so; what came of
        them.
        """
        tally, started, lock, names = Tally(), time.monotonic(), Lock(), iter(names)

        def serve(server):
            while time.monotonic() < until:
                with lock:
                    name = next(names, None)
                if name is None:
                    return
                answer = _asked(server, name)
                with lock:
                    tally.note(answer)

        with ThreadPoolExecutor(len(self._servers)) as pool:
            list(pool.map(serve, self._servers))
        tally.seconds = time.monotonic() - started
        return tally

    def _server(self, number):
        folder = self._folder / str(number)
        folder.mkdir()
        path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
        environment = {"PYTHONPATH": path, "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "0"}
        return subprocess.Popen(
            [sys.executable, "-m", "tests.torture.server", str(folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | environment | {processes.MARK: self._mark},
            start_new_session=True,
            text=True,
        )


def _asked(server, name):
    """The answer of a server to the name of a case."""
    server.stdin.write(f"{name}\n")
    server.stdin.flush()
    answer = json.loads(server.stdout.readline() or '{"broken": "its server died"}')
    if "broken" in answer:
        raise RuntimeError(f"campaign {name}: {answer['broken']}")
    return answer


def names(campaign, seed, first=0):
    """The names of a campaign's cases, without end."""
    return (Name(campaign, seed, number) for number in count(first))

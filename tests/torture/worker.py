"""A process that plays cases, one after the other, under limits; `care_sim` lives and, if so, dies
in here.

It reads names of cases on stdin, a line each, and answers with JSON lines: that a case begins, and
how it ended. A case may take `MEMORY` bytes more than the process had before it. Who reads the
answers ends it when a case hangs.
"""

import contextlib
import faulthandler
import gc
import importlib
import io
import json
import os
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
from pathlib import Path

from tests.torture.case import Case, Fault, Name
from tests.torture.judge import exception

MEMORY = 2**30


class Streams:
    """Files in the place of stdout and stderr, for C code too; what a case wrote to them can be
    read.
    """

    def __init__(self):
        self._files = [tempfile.TemporaryFile() for _ in range(2)]  # noqa: SIM115
        for number, file in zip((1, 2), self._files, strict=True):
            os.dup2(file.fileno(), number)
        self.encode("utf-8")

    def encode(self, encoding):
        """Begin anew, with the encoding that the environment of a user asks for."""
        for file in self._files:
            file.truncate(0)
            os.lseek(file.fileno(), 0, os.SEEK_SET)
        sys.stdout = io.TextIOWrapper(
            io.FileIO(1, "w", closefd=False), encoding, "strict", write_through=True
        )
        sys.stderr = io.TextIOWrapper(
            io.FileIO(2, "w", closefd=False), encoding, "backslashreplace", write_through=True
        )

    def read(self):
        """Stdout and stderr of the case."""
        texts = []
        for file in self._files:
            size = os.fstat(file.fileno()).st_size
            texts.append(os.pread(file.fileno(), size, 0).decode("utf-8", "replace"))
        return texts


streams = None
"""Those of this process, where it plays cases."""


def play(name, folder, listener=str):
    """Play a case in a new folder under `folder`; its answer as plain data."""
    module = importlib.import_module(f"tests.torture.{name.campaign}")
    place = Path(tempfile.mkdtemp(dir=folder)) / "a" / "b"
    place.mkdir(parents=True)
    case = Case(name, place, listener)
    started = time.monotonic()
    with _restored():
        os.chdir(place)
        answer = _judged(module, case)
    shutil.rmtree(place.parents[1], ignore_errors=True)
    return answer | {"steps": case.steps, "seconds": time.monotonic() - started}


def _judged(module, case):
    try:
        return {"ended": module.play(case)}
    except Fault as fault:
        found = fault
    except KeyboardInterrupt as error:
        found = exception(error)
    except BaseException as error:  # a campaign that stumbles is a fault too: of the campaign
        found = exception(error)
        found.kind = f"{found.kind} in the campaign"
    return {"ended": "fault", "kind": found.kind, "place": found.place, "detail": found.detail}


@contextlib.contextmanager
def _restored():
    """What a case may have changed, as it was: working folder, handlers of signals, environment,
    memory limit.
    """
    handlers = {number: signal.getsignal(number) for number in _SIGNALS}
    environment = dict(os.environ)
    gc.collect(1)
    soft = _data_bytes() + MEMORY
    resource.setrlimit(resource.RLIMIT_DATA, (soft, resource.RLIM_INFINITY))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        resource.setrlimit(resource.RLIMIT_DATA, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        for number, handler in handlers.items():
            signal.signal(number, handler)
        if dict(os.environ) != environment:
            os.environ.clear()
            os.environ.update(environment)
        os.chdir("/")


_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGALRM)


def _data_bytes():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmData"))


def _has_children():
    """Whether a case left processes to this one, as a pool does: the next case gets a worker of its
    own.
    """
    return bool(Path(f"/proc/self/task/{os.getpid()}/children").read_text().strip())


def main():
    """Serve names until stdin ends. Arguments: the folder for the cases, and two files: for the
    stacks of a hang, and for the steps of the case."""
    global streams
    folder, stacks, told = sys.argv[1:4]
    os.environ["TORTURE_FOLDER"] = folder
    names, answers = os.fdopen(os.dup(0), "r"), os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    streams = Streams()
    # Both are open as long as the process lives.
    hung, steps = open(stacks, "w"), open(told, "w", buffering=1, errors="backslashreplace")  # noqa: SIM115
    faulthandler.enable(hung)
    faulthandler.register(signal.SIGUSR1, hung, all_threads=False)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for line in names:
        name = Name.of(line.strip())
        try:
            campaign = importlib.import_module(f"tests.torture.{name.campaign}")
            getattr(campaign, "prepare", lambda _name: None)(name)
        except Exception:
            answers.write(json.dumps({"broken": traceback.format_exc()}) + "\n")
            return
        answers.write(json.dumps({"begins": str(name)}) + "\n")
        steps.seek(0)
        steps.truncate()
        answer = {"name": str(name)} | play(name, folder, steps.write)
        answers.write(json.dumps(answer | {"spent": _has_children()}) + "\n")


if __name__ == "__main__":
    from tests.torture import worker  # the module that campaigns import, not this copy of it

    worker.main()

"""A process that has imported what cases need, and plays each in a fork of itself, under limits;
`care_sim` lives and, if so, dies in there.

It reads names of cases on stdin, a line each, and answers each with a line of JSON. A case may take
`MEMORY` bytes more than the process had before it, and the campaign's `LIMIT_S` of processor time,
or `patience` times that on the clock, which forgives a busy machine.
"""

import faulthandler
import json
import os
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from contextlib import suppress
from pathlib import Path

from care_sim.base.limits import check_at_start
from tests.torture.case import INTERRUPTED, Case, Fault, Name
from tests.torture.judge import ending, exception, place_of_stack
from tests.torture.processes import patience

MEMORY = 2**30
_NO_LIMIT = resource.RLIM_INFINITY


def main():
    """Serve names until stdin ends. Argument: the folder for the cases."""
    folder = os.environ["TORTURE_FOLDER"] = sys.argv[1]
    check_at_start()  # as every command does: it chooses how libraries take memory
    names, answers = os.fdopen(os.dup(0)), os.fdopen(os.dup(1), "w", buffering=1)
    for number, mode in ((0, os.O_RDONLY), (1, os.O_WRONLY)):
        os.dup2(os.open(os.devnull, mode), number)
    for line in names:
        name = Name.of(line.strip())
        try:
            getattr(name.module, "prepare", lambda _name: None)(name)
        except Exception:
            answers.write(json.dumps({"broken": traceback.format_exc()}) + "\n")
            return
        answers.write(json.dumps(_answer(name, Path(tempfile.mkdtemp(dir=folder)))) + "\n")


def _answer(name, place):
    """The outcome of a case that is played in a folder of its own."""
    started = time.monotonic()
    child = os.fork()
    if not child:
        _play(name, place)
    hung = _end(child, name.module.LIMIT_S)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)
    told = {one: _text(place / one) for one in ("steps", "stack", "out", "err")}
    try:
        answer = json.loads(_text(place / "answer"))
    except ValueError:
        answer = _lost(name, code, hung, told)
    shutil.rmtree(place, ignore_errors=True)
    steps, seconds = told["steps"].splitlines(), time.monotonic() - started
    return answer | {"name": str(name), "steps": steps, "seconds": seconds}


def _end(child, limit_s):
    """Wait until a fork ends, and make it end after its time; whether that was so."""
    watched = os.pidfd_open(child)
    try:
        if select.select([watched], [], [], patience() * limit_s)[0]:
            return False
        os.kill(child, signal.SIGUSR1)
        if not select.select([watched], [], [], 1.0)[0]:
            os.kill(child, signal.SIGKILL)
        return True
    finally:
        os.close(watched)


def _text(path):
    return path.read_text(errors="replace") if path.exists() else ""


def _lost(name, code, hung, told):
    """The answer of a fork that did not live to give one."""
    if not hung and -code in getattr(name.module, "HONEST", ()):
        return {"ended": INTERRUPTED}
    if not hung and code >= 0:  # the command has ended the process itself
        return _verdict(lambda: ending(code, told["out"], told["err"]))
    kind = "hang" if hung or code == -signal.SIGXCPU else f"the process died ({code})"
    if code == -signal.SIGKILL and not hung:
        kind = "memory above 1 GB"
    detail = f"{told['stack'][:4000]}\n{told['err'][-2000:]}"
    return {"ended": "fault", "kind": kind, "place": place_of_stack(told["stack"])} | {
        "detail": detail
    }


def _play(name, place):
    """Play a case in this process, which ends with it."""
    os.setsid()
    for number, file in ((1, "out"), (2, "err")):
        os.dup2(os.open(place / file, os.O_RDWR | os.O_CREAT), number)
    # All three are open as long as the process lives.
    steps = (place / "steps").open("w", buffering=1, errors="backslashreplace")
    stack, answer = (place / "stack").open("w"), (place / "answer").open("w")
    faulthandler.enable(stack)
    for number in (signal.SIGUSR1, signal.SIGXCPU):
        faulthandler.register(number, stack, all_threads=False, chain=True)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    work = place / "a" / "b"
    work.mkdir(parents=True)
    os.chdir(work)
    resource.setrlimit(resource.RLIMIT_DATA, (_data_bytes() + MEMORY, _NO_LIMIT))
    resource.setrlimit(resource.RLIMIT_CPU, (int(name.module.LIMIT_S) + 1, _NO_LIMIT))
    case = Case(name, work, steps)
    ended = _verdict(lambda: name.module.play(case))
    for number in (resource.RLIMIT_DATA, resource.RLIMIT_CPU):
        resource.setrlimit(number, (_NO_LIMIT, _NO_LIMIT))
    answer.write(json.dumps(ended))
    answer.flush()
    os._exit(0)


def _verdict(play):
    try:
        return {"ended": play()}
    except Fault as fault:
        found = fault
    except KeyboardInterrupt as error:
        found = exception(error)
    except BaseException as error:  # a campaign that stumbles is a fault too: of the campaign
        found = exception(error)
        found.kind = f"{found.kind} in the campaign"
    return {"ended": "fault", "kind": found.kind, "place": found.place, "detail": found.detail}


def _data_bytes():
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) * 1024 for line in status if line.startswith("VmData"))


if __name__ == "__main__":
    main()

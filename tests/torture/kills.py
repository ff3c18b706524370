"""Campaign: a study is killed or interrupted at random moments, then the same command goes on."""

import os
import signal
import time
from contextlib import suppress
from pathlib import Path

from tests.torture import judge, study
from tests.torture.case import DONE, Fault
from tests.torture.processes import Command

LIMIT_S = 240.0
"""Of a case: several runs of a study; each of its commands has a limit of its own."""
SIGNALS = {
    signal.SIGKILL: 6, signal.SIGINT: 5, signal.SIGTERM: 4, signal.SIGHUP: 3, signal.SIGQUIT: 2,
}  # fmt: skip
SAYS_WHY = set(SIGNALS) - {signal.SIGKILL}
"""Signals after which a command says that it was interrupted."""
ENDS_WITHIN_S = 10.0


def prepare(_name):
    study.expected()


def play(case):
    out = case.folder / "out"
    for _ in range(case.rng.choice((1, 1, 2))):
        if _disturbed(case, out):
            break
    case.tell("the same command, undisturbed")
    with Command(study.command("out"), case.folder) as command:
        code = command.wait(60)
        out_said, err = command.said()
        if judge.ending(code, out_said, err, command.arguments) != DONE:
            raise Fault("a study that does not go on", err)
        command.check_gone()
    study.check_whole(out)
    return DONE


def _disturbed(case, out):
    """Start the study and disturb it; whether it had ended before."""
    rng = case.rng
    number = rng.choices(list(SIGNALS), list(SIGNALS.values()))[0]
    whom = rng.choice(("parent", "parent", "parent", "group", "child", "all"))
    twice = number == signal.SIGINT and rng.random() < 0.2
    with Command(study.command("out"), case.folder) as command:
        moment = _wait(case, command, out)
        case.tell(f"{signal.Signals(number).name} to {whom} {moment}{', twice' if twice else ''}")
        started = _has_begun(command)
        whole = command.process.poll() is None
        told = _send(case, command, number, whom)
        if twice:
            time.sleep(rng.uniform(0, 0.3))
            _send(case, command, number, whom)
        code = command.wait(ENDS_WITHIN_S if told != "child" else 60)
        out_said, err = command.said()
        case.tell(f"ended with {code} ({told}); stderr: {err.strip()[-300:]!r}")
        command.check_gone()
        _judge(code, number, told, out_said, err, command, started)
        study.check_not_torn(out) if out.exists() else None
        return not whole


def _wait(case, command, out):
    """Let some time pass; in words, until when."""
    rng = case.rng
    stage = rng.choice(("start", "start", "playing", "playing", "playing", "ending", "clock"))
    journal = out / study.JOURNAL
    if stage == "start":
        seconds = rng.uniform(0.0, 2.5)
        command.until(lambda: False, seconds)
        return f"after {seconds:.2f} s"
    if stage == "playing":
        rows, more = rng.randrange(study.ROWS), rng.uniform(0, 0.1)
        command.until(lambda: journal.exists() and journal.read_bytes().count(b"\n") > rows)
        command.until(lambda: False, more)
        return f"{more:.2f} s after row {rows}"
    if stage == "ending":
        name, more = (
            rng.choice(("config.json", study.ROWS_FILE, "tables.md", "tables.tex")),
            rng.uniform(0, 0.4),
        )
        command.until((out / name).exists)
        command.until(lambda: False, more)
        return f"{more:.2f} s after {name} is there"
    seconds = rng.uniform(0, 10)
    command.until(lambda: False, seconds)
    return f"after {seconds:.2f} s"


def _has_begun(command):
    """Whether its own code has begun: the interpreter's first moments are Python's."""
    with suppress(OSError):
        return "multiarray" in Path(f"/proc/{command.process.pid}/maps").read_text()
    return False


def _send(case, command, number, whom):
    """Send a signal; who got it."""
    pids = [command.process.pid]
    if whom == "group":
        with suppress(ProcessLookupError):
            os.killpg(command.process.pid, number)
        return whom
    if whom == "child":
        others = command.others()
        if others:
            pids = [case.rng.choice(sorted(others))]
        else:
            whom = "parent"
    elif whom == "all":
        pids += command.others()
    for pid in pids:
        with suppress(ProcessLookupError):
            os.kill(pid, number)
    return whom


def _judge(code, number, whom, out, err, command, started):
    """What may come of it: its end, or that of the signal, which leaves no traceback."""
    if code == -number and number not in SAYS_WHY:
        code = 130 if "care-sim: " in err else 0
        return _check_quiet(out, err, command) if code == 0 else None
    if code in (-number, 1) and number in SAYS_WHY and not started:
        return None  # Python itself was starting
    judge.ending(code, out, err, command.arguments)
    if whom == "child" and code == 130:
        raise Fault("a worker's end taken for an interrupt", err)
    return None


def _check_quiet(out, err, command):
    if "Traceback" in out + err:
        judge.ending(0, out, err, command.arguments)

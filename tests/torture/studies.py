"""Campaign: a study is killed or interrupted, two of it write to one folder, or the disk is full;
then the same command goes on.
"""

import os
import shutil
import signal
import time
from contextlib import ExitStack, suppress
from pathlib import Path

from tests.torture import judge, props, study
from tests.torture.case import DONE, INTERRUPTED, REFUSED, Fault
from tests.torture.commands import TINY
from tests.torture.processes import Command

LIMIT_S = 240.0
"""Limit of a case: several runs of a study; each of its commands has a limit of its own."""
SIGNALS = {
    signal.SIGKILL: 6, signal.SIGINT: 5, signal.SIGTERM: 4, signal.SIGHUP: 3, signal.SIGQUIT: 2,
}  # fmt: skip
ENDS_WITHIN_S = 10.0
REFUSES = "another study writes to"
SPACE = ("No space left on device", "File too large")
REMADE = ("tables.md", "tables.tex")
"""Files that a report makes again."""


def prepare(_name):
    study.expected()
    props.template("results")


def play(case):
    return case.rng.choice((killed, killed, killed, killed, same_study, full, full, same_file))(
        case
    )


def _went_on(line, folder):
    """The command undisturbed: it does what it was told."""
    with Command(line, folder) as command:
        code = command.wait(60)
        if judge.ending(code, *command.said(), command.arguments) != DONE:
            raise Fault("a command that does not go on", str(command.said()))
        command.check_gone()


def killed(case):
    """Signals at random moments."""
    out = case.folder / "out"
    for _ in range(case.rng.choice((1, 1, 2))):
        if _disturbed(case, out):
            break
    case.tell("the same command, undisturbed")
    _went_on(study.command("out"), case.folder)
    study.check_whole(out)
    return DONE


def _disturbed(case, out):
    """Start the study and disturb it; whether it had ended before."""
    rng = case.rng
    number = rng.choices([*SIGNALS], [*SIGNALS.values()])[0]
    whom = rng.choice(("parent", "parent", "parent", "group", "child", "all"))
    times = 2 if number == signal.SIGINT and rng.random() < 0.2 else 1
    with Command(study.command("out"), case.folder) as command:
        moment = _wait(rng, command, out)
        case.tell(f"{signal.Signals(number).name} to {whom} {moment}, {times} times")
        started, whole = _has_begun(command), command.process.poll() is None
        for _ in range(times):
            told = _send(rng, command, number, whom)
            time.sleep(rng.uniform(0, 0.3) if times > 1 else 0)
        code = command.wait(ENDS_WITHIN_S if told != "child" else 60)
        out_said, err = command.said()
        case.tell(f"ended with {code} ({told}); stderr: {err.strip()[-300:]!r}")
        command.check_gone()
        _judge(code, number, told, out_said, err, command, started)
        if out.exists():
            study.check_not_torn(out)
        return not whole


def _wait(rng, command, out):
    """Let some time pass; in words, until when."""
    stage = rng.choice(("start", "start", "playing", "playing", "playing", "ending", "clock"))
    more = rng.uniform(0, {"start": 2.5, "playing": 0.1, "ending": 0.4, "clock": 10.0}[stage])
    journal, name = out / study.JOURNAL, rng.choice(("config.json", study.ROWS_FILE, *REMADE))
    rows = rng.randrange(study.ROWS)
    if stage == "playing":
        command.until(lambda: journal.exists() and journal.read_bytes().count(b"\n") > rows)
    elif stage == "ending":
        command.until((out / name).exists)
    command.until(lambda: False, more)
    since = {"playing": f"row {rows}", "ending": f"{name} is there"}
    return f"{more:.2f} s after {since.get(stage, 'it began')}"


def _has_begun(command):
    """Whether its own code has begun: the interpreter's first moments are Python's."""
    with suppress(OSError):
        return "multiarray" in Path(f"/proc/{command.process.pid}/maps").read_text()
    return False


def _send(rng, command, number, whom):
    """Send a signal; who got it."""
    pid, others = command.process.pid, sorted(command.others())
    if whom == "group":
        with suppress(ProcessLookupError):
            os.killpg(pid, number)
        return whom
    if whom == "child" and not others:
        whom = "parent"
    pids = {"parent": [pid], "child": others and [rng.choice(others)], "all": [pid, *others]}
    for one in pids[whom]:
        with suppress(ProcessLookupError):
            os.kill(one, number)
    return whom


def _judge(code, number, whom, out, err, command, started):
    """Judge the end of a command: its own, or that of the signal, which leaves no traceback."""
    if code == -number == -signal.SIGKILL:
        if "Traceback" in out + err:
            judge.ending(0, out, err, command.arguments)
    elif started or code not in (-number, 1):
        judge.ending(code, out, err, command.arguments)
        if whom == "child" and code == 130:
            raise Fault("a worker's end taken for an interrupt", err)


def same_study(case):
    """Two or three of one study in one folder at once."""
    out = case.folder / "out"
    with ExitStack() as stack:
        line = study.command("out", case.rng.choice((1, 2)))
        commands = _started(case, line, stack)
        # Files are whole whenever they are read.
        while any(command.process.poll() is None for command in commands):
            if out.exists():
                study.check_not_torn(out)
            time.sleep(0.05)
            if time.monotonic() - commands[0].started > 120:
                stacks = "\n".join(command.stacks() for command in commands)
                raise Fault("hang", stacks, "several writers")
        endings = _endings(commands, REFUSES)
        for command in commands:
            command.check_gone()
    case.tell(f"endings {endings}")
    study.check_whole(out)
    return DONE


def same_file(case):
    """Two or three of one picture or recording in one file at once."""
    name = case.rng.choice(("x.gif", "x.webp", "x.png", "x.rrd"))
    option = "--record" if name == "x.rrd" else "--video"
    with ExitStack() as stack:
        line = ["run", "dartout", option, name, *TINY]
        endings = _endings(_started(case, line, stack))
    case.tell(f"endings {endings}")
    check_file(case.folder / name)
    return DONE


def _started(case, line, stack):
    """Start commands a random moment apart."""
    count, commands = case.rng.choice((2, 2, 3)), []
    case.tell(f"{count} x care-sim {' '.join(line)}")
    for _ in range(count):
        time.sleep(case.rng.choice((0.0, 0.0, case.rng.uniform(0, 2.5))))
        commands.append(stack.enter_context(Command(line, case.folder)))
    return commands


def _endings(commands, reason=""):
    """How they end: one is done, others may be refused for the reason."""
    endings = []
    for command in commands:
        code = command.wait(60)
        out, err = command.said()
        endings.append(judge.ending(code, out, err, command.arguments))
        if endings[-1] == REFUSED and reason not in err:
            raise Fault("a writer that is refused for another reason", err)
    if DONE not in endings or INTERRUPTED in endings:
        raise Fault("of several writers not one came to an end", str(endings))
    return endings


def full(case):
    """A limit on the size of a file, which the system reports in the same place of the same calls
    as a full disk.
    """
    line, product = case.rng.choice(WRITERS)
    size = case.rng.choice((0, 1, 100, 4096, 2**15, 2**17, case.rng.randrange(1, 2**19)))
    case.tell(f"care-sim {' '.join(line)}, room for {size} bytes")
    props.lay_out({"results"} & set(line), case.folder)
    before = {p.name: p.read_bytes() for p in case.folder.rglob("*") if p.is_file()}
    with Command(line, case.folder, size) as command:
        code = command.wait(20)
        out, err = command.said()
        case.tell(f"ended with {code}: {err.strip()[-200:]!r}")
        command.check_gone()
        ended = judge.ending(code, out, err, command.arguments)
    # A report prints its tables all the same, and ends with 1.
    if ended != DONE and (code not in (1, 2) or not any(reason in err for reason in SPACE)):
        raise Fault("a full disk that is not said", f"{code} {err}")
    if (case.folder / product).is_file():
        check_file(case.folder / product)
    if ended != DONE:
        _check_left(case.folder, case.folder / product, before)
    if "--export" in line:
        shutil.rmtree(case.folder / product, ignore_errors=True)
    _went_on(line, case.folder)
    if line[0] == "sweep":
        study.check_whole(case.folder / product)
    elif (case.folder / product).is_file():
        check_file(case.folder / product)
    return ended


def _check_left(folder, product, before):
    """Old files are still there; new ones are whole or absent."""
    for name, content in before.items():
        found = [path for path in folder.rglob(name) if path.is_file()]
        if not any(path.read_bytes() == content for path in found) and name not in REMADE:
            raise Fault("a file lost for want of space", name, name)
    if (product / study.JOURNAL).exists():
        study.check_not_torn(product)


SHORT = ("--scenario-parameters", "duration_s=0.6")
STUDY = (study.command("out", workers=1), "out")
WRITERS = (
    *(STUDY, STUDY, STUDY, STUDY),
    (["run", "dartout", "--picture", "x.png", "--seed", "0"], "x.png"),
    (["run", "dartout", "--video", "x.gif", *SHORT], "x.gif"),
    (["run", "dartout", "--video", "x.mp4", *SHORT], "x.mp4"),
    (["run", "dartout", "--record", "x.rrd", *SHORT], "x.rrd"),
    (["compare", "dartout", "--record", "x.rrd", "--video", "x.webp", *SHORT], "x.rrd"),
    (["run", "dartout", "--export", "scans", *SHORT], "scans"),
    (["report", "results", "-o", "x.html", "--episodes", "0"], "x.html"),
    (["report", "results"], "results/episodes.parquet"),
)
"""Commands, and what they write."""


ENDS = {".html": b"</html>", ".mp4": b"moov"}
"""Bytes at the end of a whole file."""


def check_file(path):
    """A fault for a picture, a recording, a page or rows that are not whole."""
    from PIL import Image, ImageSequence

    if path.suffix == ".parquet":
        study.steady(path.parent)
    elif path.suffix == ".rrd":
        from rerun.chunk import RrdReader

        RrdReader(str(path)).stream().to_chunks()
    elif path.suffix in ENDS:
        if ENDS[path.suffix] not in path.read_bytes()[-2000:]:
            raise Fault("a file torn", path.name, path.suffix)
    else:
        try:
            with Image.open(path) as image:
                for frame in ImageSequence.Iterator(image):
                    frame.load()
        except Exception as error:
            raise Fault("a file torn", f"{path.name}: {error}", path.suffix) from error

"""Campaign: random command lines as real processes, in the surroundings that people have.

Their terminals speak other encodings, their disks and pipes are full or gone, and the viewer shows
damaged recordings.
"""

import os
import signal

from tests.torture import commands, props, spoil
from tests.torture.case import DONE, INTERRUPTED, Fault
from tests.torture.judge import UNREAD, ending
from tests.torture.processes import Command

LIMIT_S = 120.0
HONEST_S = 4.0
"""As in `commands`, with the start of the program."""
SURROUNDINGS = (
    {},
    {},
    {},
    {"LC_ALL": "C"},
    {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"},
    {"PYTHONIOENCODING": "ascii"},
    {"PYTHONIOENCODING": "latin-1"},
    {"COLUMNS": "1"},
    {"COLUMNS": "x"},
    {"HOME": "/nowhere"},
    {"TMPDIR": "/nowhere"},
    {"TERM": "dumb"},
    {"NO_COLOR": "1"},
    {"FORCE_COLOR": "1"},
    {"OMP_NUM_THREADS": "x"},
    {"MPLBACKEND": "svg"},
    {"TZ": "nowhere"},
    {"PYTHONHASHSEED": "7"},
    {"PYTHONOPTIMIZE": "2"},
)
LISTS = (
    ["list", "policies"],
    ["list", "agents"],
    ["list", "scenarios"],
    ["list", "detectors"],
    ["list", "sources"],
    ["--help"],
    ["sweep", "--help"],
    ["report", "results"],
)
"""What people pipe into something that stops reading."""


def prepare(_name):
    props.template("results")
    props.template("recording")


def play(case):
    roll = case.rng.random()
    if roll < 0.1:
        return _viewed(case)
    if roll < 0.25:
        return _nobody_reads(case)
    return _drawn(case)


def _drawn(case):
    """A line of the grammar, in some surroundings."""
    arguments, long, _ = commands.drawn_line(case.rng)
    arguments = [_bytes(word) for word in arguments]
    surroundings = case.rng.choice(SURROUNDINGS)
    case.tell(f"{_shown(surroundings)}care-sim {' '.join(map(ascii, arguments))}")
    commands.lay_out(arguments, case.folder)
    with Command(arguments, case.folder, **surroundings) as command:
        if long:
            command.until(lambda: False, HONEST_S)
            os.kill(command.process.pid, signal.SIGINT) if command.process.poll() is None else None
        code = command.wait()
        out, err = command.said()
        command.check_gone()
    return ending(code, out, err, arguments)


def _nobody_reads(case):
    """Stdout is a pipe that nobody reads any more, or a full disk."""
    arguments, stdout = case.rng.choice(LISTS), case.rng.choice(("/dev/full", "closed pipe"))
    case.tell(f"care-sim {' '.join(arguments)}, stdout: {stdout}")
    props.lay_out({"results"} & set(arguments), case.folder)
    with Command(arguments, case.folder, stdout=stdout) as command:
        code = command.wait()
        _, err = command.said()
        command.check_gone()
    if stdout == "closed pipe" and code in (0, UNREAD, -signal.SIGPIPE) and not err:
        return DONE
    return ending(code, "", err, arguments)


def _viewed(case):
    """A recording, damaged perhaps, in a browser that is not there; Ctrl-C ends it."""
    path = props.copy("recording", case.folder / "out.rrd")
    if case.rng.random() < 0.7:
        case.tell(f"out.rrd: {spoil.raw(case.rng, path)}")
    after, number, whom = (
        case.rng.uniform(0.5, 5),
        case.rng.choice(ENDS),
        case.rng.choice(("parent", "group")),
    )
    case.tell(f"care-sim view out.rrd --web, {number.name} to the {whom} after {after:.1f} s")
    with Command(["view", "out.rrd", "--web"], case.folder) as command:
        command.until(lambda: False, after)
        early = command.process.poll() is not None
        if not early:
            (os.killpg if whom == "group" else os.kill)(command.process.pid, number)
        code = command.wait()
        out, err = command.said()
        command.check_gone()
    if "Traceback" in err + out or code not in (0, 1, 2, 130, -signal.SIGHUP):
        ending(code, out, err, command.arguments)
        raise Fault(f"exit code {code} of the viewer", err[-2000:])
    return DONE if early else INTERRUPTED


ENDS = (signal.SIGINT, signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def _bytes(word):
    """A word as the operating system hands it over: it ends at a NUL, and is bytes."""
    return os.fsdecode(
        word.partition("\0")[0].encode("utf-8", "surrogateescape" if _escaped(word) else "replace")
    )


def _escaped(word):
    return all(
        not 0xD800 <= ord(letter) <= 0xDFFF or 0xDC80 <= ord(letter) <= 0xDCFF for letter in word
    )


def _shown(surroundings):
    return "".join(f"{name}={value} " for name, value in surroundings.items())

"""Allowed answers of a command or a call, and faults.

A command ends with code 0 (done), 1 (something failed or was left out), 2 (bad input), 130
(interrupted) or 141 (nobody reads its output any more). 70, a fault of the software itself, is
always one. On stderr stand whole lines: `care-sim: ...`, or how far a study is. With 2 and 130 the
last line says why, and it is the only one of its kind but for what was left out before; with 1
there is at least one. No line holds control codes, rules of a box or a Python traceback.

A call returns, or raises InvalidInput or MissingExtra with one line, or Gymnasium's own error for a
step without a reset. TypeError is Python's own where the call itself does not fit the signature (a
keyword that there is not, a missing or surplus argument), and only there: a wrong value is
InvalidInput. Gymnasium itself refuses some calls before anything of ours is called, in its own
words.
"""

import re
import signal
import traceback

from tests.torture.case import DONE, INTERRUPTED, REFUSED, Fault

OF_THE_SOFTWARE, UNREAD = 70, 141
ENDINGS = {0: DONE, 1: REFUSED, 2: REFUSED, 130: INTERRUPTED, UNREAD: INTERRUPTED}
BY_SIGNAL = (-signal.SIGINT, -signal.SIGTERM, -signal.SIGHUP, -signal.SIGQUIT)
"""Ends by a signal, which a shell shows as 130 and the like: as good as 130 where a line has said
why, or where all was said and done and Python was about to leave."""
NOTICES = (
    r"Results go to .*",
    r"another folder is taken, because .*",
    r"(episodes|plays) \d+/\d+.*",
    r"\d+ lines? of .* passed over, damaged or .*",
    r"\d+ (episodes|plays)? ?of \d+ .* found in .*",
    r"\d+ (episodes?|plays?) .*",
    r"full fires every cell, whatever the budget",
    r"playing \d+ episodes? again to be watched( \(--episodes \d+: all\))?",
    r"interrupted: .*",
    r"the car never braked: no picture",
    r"measuring .*",
    r"([a-z ]+ )?(street|drive|test|world) \d+ of \d+ *",
    r"the first take longer on a machine that has not played before: .*",
)
"""Lines on stderr about the progress of a command, beside lines of its own name."""
OWN_SIGNATURE = re.compile(
    r"unexpected keyword argument|required (positional|keyword-only) argument"
    r"|positional arguments? but"
    r"|takes no (keyword )?arguments|takes no arguments|multiple values for"
    r"|keywords must be strings"
    r"|must be a mapping, not|positional-only"
)
"""Python's words for a call that does not fit the signature."""

OWN_EXCEPTION = re.compile(
    r": ([A-Z]\w+(?:Error|Exception)): .*\((\w+\.py), line \d+\)|refuses .*: ([A-Z]\w+Error):"
)
"""How a command tells of an exception in a policy that is not its own; where there are only its
own, it is a fault.
"""


def exception(error):
    """The fault that an exception is which nobody caught."""
    return Fault(
        type(error).__name__,
        "".join(traceback.format_exception(error))[-6000:],
        place(error.__traceback__),
    )


def place(trace):
    """Where in the package an exception came from: the innermost of its own frames."""
    own = [frame for frame in traceback.extract_tb(trace) if "/care_sim/" in frame.filename]
    return _told(own[-1].filename, own[-1].name) if own else "outside the package"


def place_of_stack(text):
    """The same of a stack that faulthandler wrote, innermost first."""
    frames = re.findall(r'File "([^"]*/care_sim/[^"]*)", line \d+ in (\S+)', text)
    return _told(*frames[0]) if frames else "outside the package"


def _told(file, function):
    return f"care_sim/{file.rpartition('/care_sim/')[2]}:{function}"


SAID_ALL = "\nResults are in "
"""The last line of a study that is done."""


def ending(code, out, err, arguments=()):
    """How a command ended, of `ENDINGS`. Raises Fault."""
    told = f"{_shown(arguments)}\nexit code {code}\nstdout ...{out[-1500:]!r}\nstderr {err[-4000:]}"
    if "Traceback (most recent call last)" in err + out:
        _raise_traceback(err + out, told)
    if code == OF_THE_SOFTWARE:
        raise Fault("a fault of the software", told, _kind_of(err.strip().rpartition("\n")[2]))
    lines = [line.rpartition("\r")[2] for line in err.splitlines()]
    lines = [line for line in lines if line.strip()]
    own = [line for line in lines if line.startswith("care-sim: ")]
    for line in lines:
        if line not in own and not any(re.fullmatch(notice, line) for notice in NOTICES):
            raise Fault(
                "a line on stderr that is neither its own nor progress", told, _kind_of(line)
            )
    for line in own:
        _check_line(line, told)
    _check_control_codes(err, told, "stderr")
    _check_control_codes(out, told, "stdout")
    return _ending(code, out, lines, own, told)


def _ending(code, out, lines, own, told):
    if code in BY_SIGNAL and own:
        code = 130
    # The system ends a command that has said all: its results are whole, and Python is taking
    # itself down.
    if code in BY_SIGNAL and out.strip() and (not lines or (not own and SAID_ALL in out)):
        return INTERRUPTED
    if code not in ENDINGS:
        raise Fault(f"exit code {code}", told)
    _check_count(code, lines, own, told)
    return ENDINGS[code]


def _check_count(code, lines, own, told):
    if code == 1 and not own:
        raise Fault("exit code 1 without a reason", told)
    if code not in (2, 130):
        return
    if not own or lines[-1] != own[-1]:
        raise Fault(f"exit code {code} without a last line that says why", told)
    # The new name of a command, and what a partial data set lacks, stand before a refusal.
    before = re.compile(r"care-sim: (left out: |failed: |`.*` is now `|.* scenes of the split )")
    if not all(map(before.match, own[:-1])):
        raise Fault("more than one line", told)


def _check_line(line, told):
    text = line.removeprefix("care-sim: ")
    if not text.strip() or text.strip() in ("None", "''", "()"):
        raise Fault("a line that says nothing", told)
    if "-----" in text or "─" in text or "For full helptext" in text:
        raise Fault("a line with the rules of a box", told)
    if re.match(r"(?:[A-Z]\w+Error|Exception)\b", text):
        raise Fault("a line that is a bare exception", told, text.split(":")[0])
    if hidden := OWN_EXCEPTION.search(text):
        raise Fault(
            "an exception told as if it were a reason",
            told,
            " ".join(filter(None, hidden.groups())),
        )


def _check_control_codes(text, told, stream):
    found = re.search(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]", text)
    if found:
        line = next(line for line in re.split(r"\n", text) if found.group() in line)
        raise Fault(f"control codes on {stream}", f"{line[:300]!r}\n{told}", told.partition(" ")[0])


def _raise_traceback(text, told):
    frames = re.findall(r'File "([^"]*/care_sim/[^"]*)", line \d+, in (\S+)', text)
    last = [
        line
        for line in text.splitlines()
        if re.match(r"[\w.]*(Error|Exception|Interrupt|Input|Exit|Warning)\b", line)
    ]
    kind = last[-1].split(":")[0] if last else "a traceback"
    raise Fault(kind, told, _told(*frames[-1]) if frames else "outside the package")


def _kind_of(line):
    """A line without what differs from case to case."""
    return re.sub(r"0x\w+|\d+|'[^']*'|/\S+", "#", line)[:80]


def _shown(arguments):
    text = " ".join(repr(str(argument)) for argument in arguments)
    return text if len(text) < 3000 else f"{text[:3000]}... ({len(text)} characters)"


def call(error):
    """How a call ended that raised: REFUSED. Raises Fault for anything but a documented error of
    one line.
    """
    import gymnasium

    from care_sim.base.errors import InvalidInput, MissingExtra

    if isinstance(error, InvalidInput | MissingExtra):
        text = str(error)
        if not text.strip() or "\n" in text:
            raise Fault("not one line", repr(text[:2000]), place(error.__traceback__)) from error
    elif (
        isinstance(error, TypeError)
        and OWN_SIGNATURE.search(str(error))
        and _raised_by_the_call(error)
    ):
        pass
    elif not (isinstance(error, gymnasium.error.Error) or _gymnasiums_own(error)):
        raise exception(error) from error
    return REFUSED


def _raised_by_the_call(error):
    """Whether the call itself was refused: no frame of the package stands between, but constructors
    that hand on.
    """
    names = [
        frame.name
        for frame in traceback.extract_tb(error.__traceback__)
        if "/care_sim/" in frame.filename
    ]
    return all(name == "__init__" for name in names)


def _gymnasiums_own(error):
    """Whether Gymnasium refused an argument of its own."""
    files = [frame.filename for frame in traceback.extract_tb(error.__traceback__)]
    return not any("/care_sim/" in file for file in files) and any(
        "/gymnasium/" in file for file in files
    )

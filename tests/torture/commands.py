"""Campaign: random command lines, played in this process."""

import io
import os
import re
import signal
import sys

from tests.torture import props
from tests.torture.case import FOUND, Case, Fault
from tests.torture.grammar import Grammar, is_safe
from tests.torture.judge import ending, exception

LIMIT_S = 10.0
HONEST_S = 0.7
"""After this a command that may take long is interrupted; it has to end as one that was."""
ENCODINGS = ("utf-8",) * 12 + ("ascii", "latin-1")
"""Encodings of stdout and stderr, as the environments of users have them."""
TINY = ("--scenario-parameters", "duration_s=0.2")
FOUND_CASES = (
    (("study", "crowding", "--seeds", "2147483647", "--workers", "1"), True, "utf-8"),
    (("sweep", "--seeds", "9999999999999999999999", *TINY), True, "utf-8"),
    (("view", "x\x00y"), False, "utf-8"),
    (("{0}", "[[1]]"), False, "latin-1"),
    (("run", "dense", "--budget", "x"), False, "ascii"),
    (("a=b=c", "\x07", "|"), False, "utf-8"),
    (("view", "pipe"), False, "utf-8"),
    (("compare", "dense", "--ego-speed-sigma", "1e300", *TINY), False, "utf-8"),
    (("sweep", "--seeds", "1", "--workers", "1", *TINY), False, "latin-1"),
    (("run", "dense", "--policy-parameters", "a={[1]}"), False, "utf-8"),
    (("run", "dense", "--policy-parameters", f"a={'-' * 5000}1"), False, "utf-8"),
)
"""Lines that once ended otherwise: arguments, whether they may honestly take long, the encoding of
the terminal.
"""


def line(name):
    """The command line of a case, whether it may take long, and the encoding."""
    return FOUND_CASES[name.number] if name.seed == FOUND else drawn_line(Case(name).rng)


def drawn_line(rng):
    """The same of dice."""
    while True:
        grammar = Grammar(rng)
        drawn = grammar.line()
        if is_safe(drawn):
            return drawn, grammar.long, rng.choice(ENCODINGS)


def prepare(name):
    """Import what the case's command imports, before its time counts."""
    drawn, *_ = line(name)
    text = " ".join(drawn)
    if drawn[:1] == ["train"]:
        import sb3_contrib  # noqa: F401
        import stable_baselines3  # noqa: F401
    if "--cluster" in text:
        import dask.distributed  # noqa: F401
    for known in ("results", "drive", "base"):
        if known in text:
            props.template(known)
    warm_up()


def warm_up():
    """Import what most commands import, and load compiled code, which takes seconds."""
    import rerun  # noqa: F401

    import care_sim.commands.certify
    import care_sim.reports.page.build
    import care_sim.reports.report
    import care_sim.sources.street_films
    import care_sim.study.episode_play
    import care_sim.study.scene_play
    import care_sim.training.curves_figure  # noqa: F401

    if not warm_up.__dict__.setdefault("done", False):
        warm_up.done = True
        props.care_sim("run", "dense", "--scenario-parameters", "duration_s=0.3")


def play(case):
    arguments, long, encoding = line(case.name)
    case.tell(f"care-sim {' '.join(map(_quoted, arguments))} ({encoding})")
    lay_out(arguments, case.folder)
    return run(arguments, encoding, HONEST_S if long else None)


def lay_out(arguments, folder):
    """Put the files that a line speaks of where it looks for them."""
    parts = {part for word in arguments for part in re.split(r"[=:]", word)}
    props.lay_out({part.split("/")[0] for part in parts}, folder)


def run(arguments, encoding="utf-8", interrupted_after=0.0, before=None, after=None):
    """Play a command line in this process, between the calls `before` and `after`, and judge its
    ending.
    """
    from care_sim.base.interrupts import raise_interrupts
    from care_sim.base.limits import check_at_start
    from care_sim.cli import main

    _speak(encoding)
    code = None
    try:
        if before:
            before()
        raise_interrupts()  # as the command does that has the process to itself
        signal.signal(signal.SIGALRM, signal.getsignal(signal.SIGINT))
        check_at_start()
        signal.setitimer(signal.ITIMER_REAL, interrupted_after or 0.0)
        with props.inline():
            main([*arguments])
    except SystemExit as end:
        code = end.code
    except BaseException as error:
        signal.setitimer(signal.ITIMER_REAL, 0)
        raise exception(error) from error
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        if after:
            after()
    if code is not None and not isinstance(code, int):
        raise Fault("an exit code that is no number", repr(code)[:500])
    return ending(code or 0, *_said(), arguments)


def _speak(encoding):
    """Let stdout and stderr, which are files, begin anew in the encoding of a user."""
    for number, name, errors in ((1, "stdout", "strict"), (2, "stderr", "backslashreplace")):
        os.ftruncate(number, 0)
        os.lseek(number, 0, os.SEEK_SET)
        file = io.FileIO(number, "w", closefd=False)
        setattr(sys, name, io.TextIOWrapper(file, encoding, errors, write_through=True))


def _said():
    """The content of stdout and stderr, without the colours that FORCE_COLOR gives them."""
    sys.stdout.flush()
    sys.stderr.flush()
    texts = [os.pread(number, os.fstat(number).st_size, 0) for number in (1, 2)]
    return [uncoloured(text.decode("utf-8", "replace")) for text in texts]


def uncoloured(text):
    return re.sub(r"\x1b\[[\d;]*m", "", text)


def _quoted(word):
    is_plain = re.fullmatch(r"[\w./=:+-]{1,200}", word, re.ASCII)
    return word if is_plain else ascii(word)[:300]

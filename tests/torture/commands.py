"""Campaign: random command lines, played in this process."""

import re
import signal
import sys

from tests.torture import props, worker
from tests.torture.case import FOUND, Case, Fault
from tests.torture.grammar import Grammar, is_safe
from tests.torture.judge import ending, exception

LIMIT_S = 10.0
HONEST_S = 0.7
"""After this a command that may take long is interrupted; it has to end as one that was."""
ENCODINGS = ("utf-8",) * 12 + ("ascii", "latin-1")
"""Of stdout and stderr, as the environments of users have them."""


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
    return FOUND_CASES[name.number] if name.seed == FOUND else drawn_line(Case(name, None).rng)


def drawn_line(rng):
    """The same of dice."""
    while True:
        grammar = Grammar(rng)
        drawn = grammar.line()
        if is_safe(drawn):
            return drawn, grammar.long, rng.choice(ENCODINGS)


def prepare(name):
    """Import what the case's command imports, before its time counts: an import that is interrupted
    leaves a mess.
    """
    import care_sim.reports.page.build
    import care_sim.reports.report
    import care_sim.sources.street_films
    import care_sim.study.episode_play
    import care_sim.study.scene_play

    drawn, *_ = line(name)
    first, text = " ".join(drawn[:1]), " ".join(drawn)
    if first == "train":
        import sb3_contrib  # noqa: F401
        import stable_baselines3  # noqa: F401
    if first == "certify":
        import care_sim.commands.certify  # noqa: F401
    if "--record" in text:
        import rerun  # noqa: F401
    if "--cluster" in text:
        import dask.distributed  # noqa: F401
    for known in ("results", "drive", "base"):
        if known in text:
            props.template(known)
    _play_once()


def _play_once():
    """Compiled code is loaded at its first use, which takes seconds."""
    if not _play_once.__dict__.setdefault("done", False):
        _play_once.done = True
        props.care_sim("run", "dense", "--scenario-parameters", "duration_s=0.3")
        props.template("results")


def play(case):
    arguments, long, encoding = line(case.name)
    case.tell(
        f"care-sim {' '.join(_quoted(word) for word in arguments)}"
        + ("" if encoding == "utf-8" else f" ({encoding})")
    )
    lay_out(arguments, case.folder)
    return run(arguments, encoding, HONEST_S if long else None)


def lay_out(arguments, folder):
    """Put the files that a line speaks of where it looks for them."""
    parts = {part for word in arguments for part in re.split(r"[=:]", word)}
    props.lay_out({part.split("/")[0] for part in parts}, folder)


def run(arguments, encoding="utf-8", interrupted_after=None):
    """Play a command line in this process and judge its ending."""
    from care_sim.base.interrupts import raise_them
    from care_sim.cli import main

    worker.streams.encode(encoding)
    code = None
    raise_them()  # as the command does that has the process to itself
    if interrupted_after is not None:
        signal.setitimer(signal.ITIMER_REAL, interrupted_after)
    try:
        with props.inline():
            main(list(arguments))
    except SystemExit as end:
        code = end.code
    except BaseException as error:
        signal.setitimer(signal.ITIMER_REAL, 0)
        raise exception(error) from error
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
    sys.stdout.flush()
    sys.stderr.flush()
    out, err = worker.streams.read()
    if code is not None and not isinstance(code, int):
        raise Fault("an exit code that is no number", repr(code)[:500])
    return ending(code or 0, out, err, arguments)


def _quoted(word):
    return (
        word
        if re.fullmatch(r"[\w./=:+-]+", word, re.ASCII) and len(word) < 200
        else ascii(word)[:300]
    )

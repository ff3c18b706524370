"""Campaign: commands in odd surroundings: variables of the environment, limits of the system, a
reader who has gone, a viewer that shows a damaged recording.
"""

import os
import resource
import shutil
import signal
import tempfile
from pathlib import Path

from tests.torture import commands, props, spoil
from tests.torture.case import DONE, FOUND, INTERRUPTED, REFUSED, Fault, words
from tests.torture.commands import TINY, uncoloured
from tests.torture.judge import ending
from tests.torture.processes import Command

LIMIT_S = 120.0
ENDS_WITHIN_S = 60.0
HONEST_S = 4.0
"""As in `commands`, with the start of the program."""
LINES = (
    ("run", "dartout", *TINY),
    ("run", "cutin", "--policy", "all-camera", *TINY),
    ("run", "dartout", "--record", "out.rrd", *TINY),
    ("sweep", "--scenarios", "dartout", "--policies", "care", "--seeds", "1", *TINY),
    ("report", "results"),
    ("list", "policies"),
    ("list", "scenarios"),
    ("run", "--help"),
    ("--help",),
    ("--version",),
)
AT_START = words(
    "MKL_NUM_THREADS MPLBACKEND MPLCONFIGDIR NUMBA_CACHE_DIR NUMBA_DISABLE_JIT NUMBA_NUM_THREADS "
    "NUMBA_THREADING_LAYER OMP_NUM_THREADS OPENBLAS_NUM_THREADS PYTHONCOERCECLOCALE PYTHONDEVMODE "
    "PYTHONDONTWRITEBYTECODE PYTHONFAULTHANDLER PYTHONHASHSEED PYTHONIOENCODING PYTHONNOUSERSITE "
    "PYTHONOPTIMIZE PYTHONUNBUFFERED PYTHONUTF8 ARROW_DEFAULT_MEMORY_POOL"
)
"""Read once, when a process starts or a library is imported."""
LATE = words(
    "COLUMNS LINES TERM NO_COLOR FORCE_COLOR COLORTERM LANG LC_ALL LC_CTYPE TZ HOME USER LOGNAME "
    "SHELL TMPDIR TEMP XDG_CACHE_HOME XDG_CONFIG_HOME XDG_DATA_HOME XDG_RUNTIME_DIR RERUN "
    "RERUN_STRICT RERUN_FLUSH_TICK_SECS SOURCE_DATE_EPOCH DISPLAY BROWSER PAGER EDITOR http_proxy "
    "https_proxy NO_PROXY CARE_SIM_DEBUG CARE_SIM_UNKNOWN PATH MATPLOTLIBRC CUDA_VISIBLE_DEVICES "
    "CI TYRO_BACKEND"
)
"""Read when they are needed."""
VALUES = [
    *words("0 1 2 -1 7 x on off true nan 1e9 99999999999999999999 /nowhere /dev/null . C C.UTF-8"),
    *words("de_DE.UTF-8 ascii utf-8 Agg svg dumb xterm-256color UTC Mars/Base :0 a=b ä %s tbb"),
    *("http://localhost:1", "system", "", " ", "\x1b[31m", "x" * 5000),
]
ALLOWED = {
    "NUMBA_DISABLE_JIT": ("0", "1"),
    "NUMBA_NUM_THREADS": ("1", "2"),
    "PYTHONIOENCODING": ("", "ascii", "utf-8", "latin-1:strict"),
    "PYTHONUTF8": ("", "0", "1"),
    "PYTHONHASHSEED": ("0", "7", "random"),
}
"""Python itself ends at once with any other value, and Numba warns with a traceback."""
SIZES = {
    "AS": (0, 2**20, 500_000_000, 2**31, 4 * 2**30, 2**40),
    "DATA": (0, 2**20, 500_000_000, 1_650_000_000, 2**31, 2**33),
    "NOFILE": (0, 3, 4, 8, 16, 32, 64, 256, 4096),
    "FSIZE": (2**15, 2**16, 2**18, 2**20),  # what a case says goes to files, too
    "STACK": (2**16, 2**18, 2**20, 2**23, 2**30),
    "CPU": (1, 2, 5, 1000),
    "CORE": (0, 1, 2**20),
}
PROCESSES = (0, 1, 2, 3, 4, 8, 16, 64)
STUDY = ("sweep", "--scenarios", "dartout", "--policies", "care", "--seeds", "2", "--workers", "2")
CANNOT_EXECUTE = 126
"""The exit code of a shell, and of `setpriv`, for a program that cannot be started."""
HONEST = (signal.SIGXCPU, signal.SIGKILL)
"""The system ends what has used up its time."""
FOUND_CASES = (
    ({"NUMBA_DISABLE_JIT": "1"}, ("list", "policies")),
    # Rerun raised NameError while it was imported.
    ({"RERUN_STRICT": " "}, ("run", "dartout", "--record", "out.rrd", *TINY)),
    (("AS", 500_000_000), ("run", "dartout", *TINY)),
    (("NPROC", 3), (*STUDY, *TINY)),
    (("NOFILE", 7), ("list", "policies")),
)


def prepare(_name):
    commands.warm_up()
    props.template("results")
    props.template("recording")


def play(case):
    if case.name.seed == FOUND:
        given, arguments = FOUND_CASES[case.name.number]
        return (_with_variables if isinstance(given, dict) else _limited)(case, given, arguments)
    rng = case.rng
    # A process of its own takes seconds, as other users and other interpreters need one.
    if rng.random() < 0.1:
        return rng.choice((_drawn, _nobody_reads, _viewed, _started, _another_user))(case)
    arguments = rng.choice(LINES)
    if rng.random() < 0.5:
        return _with_variables(case, _variables(rng, LATE), arguments)
    name = rng.choice([*SIZES])
    size = int(rng.choice(SIZES[name]) * rng.choice((1.0, 1.0, 0.9, 1.1)))
    return _limited(case, (name, size), arguments)


def _variables(rng, family):
    names = rng.sample(family, rng.randint(1, 3))
    return {name: rng.choice(ALLOWED.get(name, VALUES)) for name in names}


def _with_variables(case, variables, arguments):
    """A line with other environment variables, in a process of its own where they are read at its
    start.
    """
    shown = " ".join(f"{name}={value[:200]!a}" for name, value in variables.items())
    case.tell(f"{shown} care-sim {' '.join(arguments)}")
    if {*variables} & {*AT_START}:
        return _ended(case, arguments, **variables)
    return _here(case, arguments, lambda: os.environ.update(variables))


def _limited(case, limit, arguments):
    name, size = limit
    if name == "NPROC":
        return _another_user(case, size, arguments)
    case.tell(f"RLIMIT_{name} {size}: care-sim {' '.join(arguments)}")
    number = getattr(resource, f"RLIMIT_{name}")
    usual, most = resource.getrlimit(number)
    if name == "CPU":
        size += int(resource.getrusage(resource.RUSAGE_SELF).ru_utime)
    if most != resource.RLIM_INFINITY:
        size = min(size, most)
    # Memory is limited by what is asked for here, not by the limit of every case.
    resource.setrlimit(resource.RLIMIT_DATA, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    return _here(
        case,
        arguments,
        lambda: resource.setrlimit(number, (size, most)),
        lambda: resource.setrlimit(number, (usual, most)),
    )


def _here(case, arguments, before, after=None):
    props.lay_out({"results"} & {*arguments}, case.folder)
    outside = sorted(os.listdir(case.folder.parent))
    ended = commands.run(arguments, before=before, after=after)
    if sorted(os.listdir(case.folder.parent)) != outside:
        raise Fault("a file outside", f"{arguments}: {os.listdir(case.folder.parent)}")
    return ended


def _ended(case, arguments, long=False, **options):
    """How a process of its own ends, which is interrupted where it may take `long`."""
    commands.lay_out(arguments, case.folder)
    with Command(arguments, case.folder, **options) as command:
        if long:
            command.until(lambda: False, HONEST_S)
            if command.process.poll() is None:
                os.kill(command.process.pid, signal.SIGINT)
        code = command.wait(ENDS_WITHIN_S)
        out, err = map(uncoloured, command.said())
        command.check_gone()
    # Linux starts no program for a user who is over the limit already.
    if code == CANNOT_EXECUTE and err.startswith("setpriv: failed to execute"):
        return REFUSED
    if options.get("stdout") == "closed pipe" and code in (0, -signal.SIGPIPE) and not err:
        return DONE
    return ending(code, out, err, arguments)


def _started(case):
    """Variables that are read when a process starts."""
    return _with_variables(case, _variables(case.rng, AT_START), case.rng.choice(LINES))


def _drawn(case):
    """A line of the grammar as a real process."""
    arguments, long, _ = commands.drawn_line(case.rng)
    arguments = [_bytes(word) for word in arguments]
    case.tell(f"care-sim {' '.join(map(ascii, arguments))}")
    return _ended(case, arguments, long)


def _bytes(word):
    """A word as the operating system hands it over: it ends at a NUL, and is bytes."""
    word = word.partition("\0")[0]
    try:
        return os.fsdecode(word.encode("utf-8", "surrogateescape"))
    except UnicodeEncodeError:
        return os.fsdecode(word.encode("utf-8", "replace"))


def _nobody_reads(case):
    """Stdout is a pipe that nobody reads any more, or a full disk."""
    lines = (*LINES[4:], ("list", "agents"), ("list", "detectors"), ("list", "sources"))
    arguments, stdout = case.rng.choice(lines), case.rng.choice(("/dev/full", "closed pipe"))
    case.tell(f"care-sim {' '.join(arguments)}, stdout: {stdout}")
    return _ended(case, arguments, stdout=stdout)


def _another_user(case, size=None, arguments=None):
    """A user who may have so many processes; root may start as many as it likes."""
    size = case.rng.choice(PROCESSES) if size is None else size
    arguments = arguments or case.rng.choice(((*STUDY, *TINY), ("list", "policies")))
    case.tell(f"RLIMIT_NPROC {size}: care-sim {' '.join(arguments)}")
    if os.geteuid() != 0 or not shutil.which("setpriv"):
        return DONE
    for place in (case.folder, *case.folder.parents):
        if place == Path(tempfile.gettempdir()):
            break
        place.chmod(0o777)
    own = dict.fromkeys(("HOME", "MPLCONFIGDIR"), str(case.folder))
    return _ended(case, arguments, tasks=size, **own)


def _viewed(case):
    """A recording, damaged perhaps, in a browser that is not there; an interrupt ends it."""
    rng, path = case.rng, props.copy("recording", case.folder / "out.rrd")
    if rng.random() < 0.7:
        case.tell(f"out.rrd: {spoil.raw(rng, path)}")
    after, whom = rng.uniform(0.5, 5), rng.choice(("parent", "group"))
    number = rng.choice((signal.SIGINT, signal.SIGINT, signal.SIGTERM, signal.SIGHUP))
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

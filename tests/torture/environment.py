"""Campaign: commands with odd values in the environment variables of libraries and the system."""

import os

from tests.torture import warm
from tests.torture.case import FOUND
from tests.torture.judge import ending
from tests.torture.processes import Command

LIMIT_S = 60.0
HANGS_S = 60.0
AT_START = (
    *("MKL_NUM_THREADS", "MPLBACKEND", "MPLCONFIGDIR", "NUMBA_CACHE_DIR", "NUMBA_DISABLE_JIT"),
    *("NUMBA_NUM_THREADS", "NUMBA_THREADING_LAYER", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"),
    *("PYTHONCOERCECLOCALE", "PYTHONDEVMODE", "PYTHONDONTWRITEBYTECODE", "PYTHONFAULTHANDLER"),
    *(
        "PYTHONHASHSEED",
        "PYTHONIOENCODING",
        "PYTHONNOUSERSITE",
        "PYTHONOPTIMIZE",
        "PYTHONUNBUFFERED",
    ),
    *("PYTHONUTF8", "ARROW_DEFAULT_MEMORY_POOL"),
)
"""Read once, when a process starts or a library is imported."""
LATE = (
    *("COLUMNS", "LINES", "TERM", "NO_COLOR", "FORCE_COLOR", "COLORTERM", "LANG", "LC_ALL"),
    *("LC_CTYPE", "TZ", "HOME", "USER", "LOGNAME", "SHELL", "TMPDIR", "TEMP", "XDG_CACHE_HOME"),
    *("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_RUNTIME_DIR", "RERUN", "RERUN_STRICT"),
    *("RERUN_FLUSH_TICK_SECS", "SOURCE_DATE_EPOCH", "DISPLAY", "BROWSER", "PAGER", "EDITOR"),
    *("http_proxy", "https_proxy", "NO_PROXY", "CARE_SIM_DEBUG", "CARE_SIM_UNKNOWN", "PATH"),
    *("MATPLOTLIBRC", "CUDA_VISIBLE_DEVICES", "CI", "TYRO_BACKEND"),
)
"""Read when they are needed."""
VALUES = (
    *("", "0", "1", "2", "-1", "7", "x", "on", "off", "true", "nan", "1e9", "99999999999999999999"),
    *("/nowhere", "/dev/null", ".", "C", "C.UTF-8", "de_DE.UTF-8", "ascii", "utf-8", "Agg", "svg"),
    *("dumb", "xterm-256color", "UTC", "Mars/Base", "http://localhost:1", ":0", " ", "a=b"),
    *("\x1b[31m",),
    *("ä", "x" * 5000, "%s", "tbb", "system"),
)
ALLOWED = {
    "NUMBA_DISABLE_JIT": ("0", "1"),
    "NUMBA_NUM_THREADS": ("1", "2"),
    "PYTHONIOENCODING": ("", "ascii", "utf-8", "latin-1:strict"),
    "PYTHONUTF8": ("", "0", "1"),
    "PYTHONHASHSEED": ("0", "7", "random"),
}
"""Python itself ends at once with any other value, and Numba warns with a traceback."""
FOUND_CASES = (
    ({"NUMBA_DISABLE_JIT": "1"}, ("list", "policies")),
    # Rerun raised NameError while it was imported.
    ({"RERUN_STRICT": " "}, ("run", "dartout", "--record", "out.rrd", *warm.TINY)),
)

prepare, FORKS = warm.prepare, warm.FORKS


def drawn(case):
    """Variables and a command line."""
    if case.name.seed == FOUND:
        return FOUND_CASES[case.name.number]
    # A process of its own takes seconds.
    family = AT_START if case.rng.random() < 0.02 else LATE
    names = case.rng.sample(family, case.rng.randint(1, 3))
    values = {name: case.rng.choice(ALLOWED.get(name, VALUES)) for name in names}
    return values, case.rng.choice(warm.LINES)


def play(case):
    variables, arguments = drawn(case)
    shown = " ".join(f"{name}={value[:200]!a}" for name, value in variables.items())
    case.tell(f"{shown} care-sim {' '.join(arguments)}")
    if not {*variables} & {*AT_START}:
        return warm.play(arguments, case.folder, lambda: os.environ.update(variables))
    warm.props.lay_out({"results"} & {*arguments}, case.folder)
    with Command(arguments, case.folder, **variables) as command:
        code = command.wait(HANGS_S)
        out, err = command.said()
        command.check_gone()
    return ending(code, warm.uncoloured(out), warm.uncoloured(err), arguments)

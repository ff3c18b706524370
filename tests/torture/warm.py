"""Commands in forks of this process, which has imported what they need: a case costs little, and
may change what is a process's own.
"""

import os
import re
import resource
import sys
import traceback

from tests.torture import commands, props, worker
from tests.torture.case import FOUND, INTERRUPTED, Fault, Name
from tests.torture.judge import ending

TINY = ("--scenario-parameters", "duration_s=0.2")
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

FORKS = True
"""Rerun makes no recording in a fork of a process that has made one: these campaigns begin in new
processes."""


def prepare(_name):
    """Load what the lines need."""
    commands.prepare(Name("commands", FOUND, 0))
    props.template("results")
    for arguments in LINES:
        if arguments[0] == "list":
            props.care_sim(*arguments)


def play(arguments, folder, before, honest=()):
    """How a command ends that a fork runs after the call `before`; ends by one of the signals
    `honest` are right, too.
    """
    props.lay_out({"results"} & {*arguments}, folder)
    outside = sorted(os.listdir(folder.parent))
    worker.streams.encode("utf-8")
    child = os.fork()
    if child == 0:
        os._exit(_code(arguments, before))
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    out, err = worker.streams.read()
    if sorted(os.listdir(folder.parent)) != outside:
        raise Fault("a file outside", f"{arguments}: {os.listdir(folder.parent)}")
    if -code in honest:
        return INTERRUPTED
    return ending(code, uncoloured(out), uncoloured(err), arguments)


def uncoloured(text):
    """What a terminal shows of a text: FORCE_COLOR colours it elsewhere, too."""
    return re.sub(r"\x1b\[[\d;]*m", "", text)


def _code(arguments, before):
    """Run the command here; its exit code."""
    from care_sim.base.interrupts import raise_them
    from care_sim.base.limits import check_at_start
    from care_sim.cli import main

    # The limit of a case of this process is none of the fork's.
    resource.setrlimit(resource.RLIMIT_DATA, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    try:
        before()
        check_at_start()
        raise_them()
        with props.inline():
            main([*arguments])
    except SystemExit as end:
        return end.code or 0
    except BaseException:
        traceback.print_exc()
        return 70
    finally:
        sys.stdout.flush()
        sys.stderr.flush()

"""Interrupts at bad moments: one line, exit code 130, from the first import to the last words."""

import signal
import sys

import pytest

from tests.helpers.descendants import Marked

AT_AN_IMPORT = """
import os, signal, sys
from importlib.abc import MetaPathFinder

class Interrupts(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            try:
                os.kill(os.getpid(), signal.{end})
                sum(range(1000))
            except BaseException as lost:
                raise ImportError("initialization failed") from lost

sys.meta_path.insert(0, Interrupts())
sys.argv = {arguments!r}
from care_sim.cli import main
main()
"""


@pytest.mark.parametrize(
    ("module", "end"),
    [
        ("numpy", "SIGINT"),
        ("tyro", "SIGTERM"),
        ("care_sim.commands.run", "SIGHUP"),
        ("care_sim.reports.episodes.clips", "SIGINT"),
    ],
)
def test_an_interrupt_within_an_import_of_the_command_is_one_line(module, end):
    arguments = ["/usr/bin/care-sim", "run", "dartout", "--scenario-parameters", "duration_s=0.1"]
    program = AT_AN_IMPORT.format(module=module, end=end, arguments=arguments)
    with Marked([sys.executable, "-c", program]) as started:
        assert started.process.communicate(timeout=60) == ("", "care-sim: interrupted\n")
        assert started.process.returncode == 130


def test_a_library_does_not_touch_the_handlers_of_its_user():
    program = (
        "import signal, care_sim; "
        "print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
    )
    with Marked([sys.executable, "-c", program]) as started:
        assert started.process.communicate(timeout=60)[0] == "True\n"


def test_what_is_ignored_stays_ignored():
    """As under nohup."""
    program = (
        "import signal; from care_sim.base import interrupts; "
        "interrupts.raise_them(); print(signal.getsignal(1))"
    )
    ignoring = f"import signal; signal.signal(1, signal.SIG_IGN)\n{program}"
    with Marked([sys.executable, "-c", ignoring]) as started:
        assert started.process.communicate(timeout=60)[0].strip() == str(int(signal.SIG_IGN))

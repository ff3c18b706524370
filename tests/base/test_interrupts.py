"""Interrupts at bad moments: one line, exit code 130, from the first import to the last words."""

import signal
import sys

import pytest

from care_sim.base import interrupts
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

class HalfMade:
    def __del__(self):
        raise AttributeError("an interrupt left it half made")

sys.meta_path.insert(0, Interrupts())
sys.argv = {arguments!r}
half_made = HalfMade()
from care_sim.cli import main
main()
"""
IN_A_FINALISER = """
import os, signal, sys, time
from care_sim.base import interrupts

class Interrupted:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        sum(range(1000))

interrupts.raise_interrupts()
try:
    Interrupted()
    time.sleep(60)
except KeyboardInterrupt:
    print("heard")
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


def test_an_interrupt_that_a_finaliser_swallows_comes_again():
    with Marked([sys.executable, "-c", IN_A_FINALISER]) as started:
        assert started.process.communicate(timeout=60) == ("heard\n", "")


IN_A_LONG_IMPORT = """
import os, signal, sys
from importlib.abc import MetaPathFinder
from care_sim.base import interrupts

class Interrupts(MetaPathFinder):
    def find_spec(self, name, path, target=None):
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
            sum(range(1000))
        print("deaf")

interrupts.raise_interrupts()
sys.meta_path.insert(0, Interrupts())
try:
    import colorsys
except KeyboardInterrupt:
    print("heard")
"""


def test_a_second_interrupt_ends_an_import_that_takes_long():
    with Marked([sys.executable, "-c", IN_A_LONG_IMPORT]) as started:
        assert started.process.communicate(timeout=60) == ("heard\n", "")


@pytest.mark.parametrize("moment", range(4))
def test_an_interrupt_finds_all_handlers_changed_or_none(moment, monkeypatch):
    heard = []
    kept = {
        number: signal.signal(number, lambda *_: heard.append(1))
        for number in (signal.SIGINT, signal.SIGTERM)
    }
    ours = {number: signal.getsignal(number) for number in kept}
    change, changes = signal.signal, []

    def interrupted(number, handler):
        if len(changes) == moment:
            signal.raise_signal(signal.SIGINT)
        changes.append(number)
        return change(number, handler)

    monkeypatch.setattr(signal, "signal", interrupted)
    try:
        with interrupts.hold_interrupts():
            assert not heard
        assert (len(changes), heard) == (4, [1])
        assert {number: signal.getsignal(number) for number in kept} == ours
    finally:
        monkeypatch.undo()
        for number, handler in kept.items():
            signal.signal(number, handler)


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
        "interrupts.raise_interrupts(); print(signal.getsignal(1))"
    )
    ignoring = f"import signal; signal.signal(1, signal.SIG_IGN)\n{program}"
    with Marked([sys.executable, "-c", ignoring]) as started:
        assert started.process.communicate(timeout=60)[0].strip() == str(int(signal.SIG_IGN))

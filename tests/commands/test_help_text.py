"""Helps: as wide as the terminal, every option under what it is for."""

import io
import os
import re
import subprocess
import sys
from contextlib import suppress
from itertools import chain
from pathlib import Path

import pytest

from care_sim.cli import main
from care_sim.commands.entries import COMMANDS
from care_sim.commands.shared.help_text import PURPOSES, Captured, grouped, wrapped

LEARNERS = COMMANDS["train"].loaded()
HELPS = [[name] for name in COMMANDS] + [["train", name] for name in LEARNERS]
SHELL = {**os.environ, "TERM": "xterm", "COLUMNS": "80", "PYTHONIOENCODING": "utf-8"}
BOX = """\
usage: care-sim sweep

╭─ options ────────────╮
│ -h, --help   show    │
│ --seeds INT  so many │
│              of them │
│ -o PATH, --page PATH │
│ --mine INT   unheard │
╰──────────────────────╯
"""
PARTED = """\
usage: care-sim sweep

╭─ what is played ─────╮
│ --seeds INT  so many │
│              of them │
╰──────────────────────╯
╭─ what is written ────╮
│ -o PATH, --page PATH │
╰──────────────────────╯
╭─ help ───────────────╮
│ -h, --help   show    │
╰──────────────────────╯
╭─ options ────────────╮
│ --mine INT   unheard │
╰──────────────────────╯
"""


def help_of(capsys, words, asked):
    with pytest.raises(SystemExit) as end:
        main([*words, asked])
    assert end.value.code == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("words", HELPS, ids=" ".join)
def test_a_help_fits_its_terminal_and_has_a_purpose_for_every_option(words, capsys, monkeypatch):
    for columns in (80, 40, 24):
        monkeypatch.setenv("COLUMNS", str(columns))
        lines = help_of(capsys, words, "--help-all").splitlines()
        assert max(map(len, lines)) <= columns
        # A narrower terminal cuts the names of options, by which they are grouped.
        assert columns < 40 or not any(line.startswith("╭─ options ") for line in lines)


def test_no_option_has_two_purposes_and_none_is_of_an_option_that_is_gone(capsys):
    listed = [*chain.from_iterable(options.split(", ") for options in PURPOSES.values())]
    assert len(set(listed)) == len(listed)
    told = " ".join(help_of(capsys, words, "--help-all") for words in HELPS)
    assert {*listed} - {*re.findall(r"--([a-z0-9-]+)", told)} == set()


def test_a_box_is_parted_by_purpose_and_what_is_not_known_comes_last(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert grouped(BOX) == PARTED
    assert grouped(BOX.replace("╭─", "--")) == BOX.replace("╭─", "--")


@pytest.mark.parametrize("words", [["train"], ["sweep"], ["policies"]], ids=" ".join)
def test_a_terminal_shows_the_same_help_as_a_pipe(words):
    """A terminal's ends of lines are two characters."""
    command = [str(Path(sys.executable).with_name("care-sim")), *words, "--help"]
    piped = subprocess.run(command, capture_output=True, check=True, env=SHELL).stdout
    here, there = os.openpty()
    shown = subprocess.Popen(command, stdout=there, env=SHELL)
    os.close(there)
    told = b""
    # Linux tells the end of a terminal by an error.
    with suppress(OSError):
        while part := os.read(here, 4096):
            told += part
    os.close(here)
    assert shown.wait() == 0
    assert told.replace(b"\r\n", b"\n") == piped


def test_only_what_is_too_wide_is_wrapped(monkeypatch):
    monkeypatch.setenv("COLUMNS", "30")
    assert wrapped(BOX) == BOX
    long = "usage: care-sim train [-h] {ppo,sac,learned-sets}\n"
    assert wrapped(long) == "usage: care-sim train [-h]\n       {ppo,sac,learned-sets}\n"


def test_help_is_drawn_for_the_output_that_it_goes_to():
    assert Captured(io.TextIOWrapper(io.BytesIO(), encoding="ascii")).encoding == "ascii"

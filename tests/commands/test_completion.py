"""Completion in a shell: commands, learners and options, as the shell itself finds them."""

import subprocess
import sys

import pytest

from care_sim.commands.completion import Completion

ASK = """
source /dev/stdin
for line in "re" "train pp" "train ppo --res" "run dartout --rec" "certify --a" "run xy"; do
    COMP_WORDS=(care-sim $line); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=()
    _care_sim; echo "${COMPREPLY[@]}"
done
"""


@pytest.fixture
def script(capsys):
    def script_of(shell):
        assert Completion(shell)() == 0
        return capsys.readouterr().out

    return script_of


def test_bash_completes_commands_learners_and_options(script):
    found = subprocess.run(
        ["bash", "-c", ASK], input=script("bash"), capture_output=True, text=True, check=True
    )
    assert found.stdout.splitlines() == [
        "reproduce realism report",
        "ppo",
        "--resume",
        "--record",
        "--all",
        "",
    ]


def test_other_shells_complete_the_same(script):
    assert script("zsh").endswith(script("bash"))
    lines = script("fish").splitlines()
    assert "complete -c care-sim -n __fish_use_subcommand -a run" in lines
    assert "complete -c care-sim -n '__fish_seen_subcommand_from run' -l record" in lines


def test_the_package_runs_as_a_module():
    said = subprocess.run(
        [sys.executable, "-m", "care_sim", "--version"], capture_output=True, text=True, check=True
    )
    assert said.stdout.startswith("care-sim ")

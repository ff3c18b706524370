"""Help, lists, old names and completion: what they say, and how little they load."""

import os
import re
import subprocess
import sys

import pytest

import care_sim
from care_sim.cli import parsed_command
from care_sim.commands.options import results, shared
from care_sim.commands.parsing import option_names
from care_sim.commands.table import COMMANDS, FAMILIES, RENAMED
from care_sim.core.conditions import DEFAULTS
from care_sim.perception.detectors import CLUSTER, PILLARS, PROXY
from care_sim.sensors.setups import DEFAULT_SETUP
from care_sim.study.benchmark.budgets import MAIN_DETECTOR
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.run_config import MOST_TASKS
from tests.helpers.commands import run

HEAVY = {"highway_env", "matplotlib", "numba", "pandas", "pyarrow", "pybullet", "scipy", "torch"}
KINDS = ("policies", "agents", "scenarios", "sources", "detectors", "sensors", "engines")


def test_alone_it_shows_every_command_in_a_line(capsys):
    code, out, err = run(capsys)
    assert (code, err) == (0, "")
    assert run(capsys, "--help") == run(capsys, "-h") == (0, out, "")
    shown = re.findall(r"^  (\S+) +\S", out, re.MULTILINE)
    assert shown == [*dict.fromkeys(name.split()[0] for name in COMMANDS)]
    for first in FAMILIES:
        code, out, _ = run(capsys, first)
        assert run(capsys, first, "--help") == (code, out, "")
        below = re.findall(r"^  (\S+) +\S", out, re.MULTILINE)
        assert [f"{first} {name}" for name in below] == [
            name for name in COMMANDS if name.startswith(f"{first} ")
        ]
    assert run(capsys, "--version") == (0, f"care-sim {care_sim.__version__}\n", "")


@pytest.mark.parametrize("name", COMMANDS)
def test_help_explains_every_option_and_help_all_every_condition(name, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, short, err = run(capsys, *name.split(), "--help")
    assert (code, err) == (0, "")
    whole = run(capsys, *name.split(), "--help-all")[1]
    assert short.startswith(f"usage: care-sim {name} ")
    positional = {"--what", "--world", "--file", "--kind", "--results", "--folders"}
    options = {*option_names(COMMANDS[name].options_class())} - positional
    options -= {"--scenario"} if name != "run" else set()
    conditions = {f"--{each.replace('_', '-')}" for each in DEFAULTS} & options
    explained = explained_in(whole)
    assert explained >= options
    has_group = "Conditions, which --help-all explains:" in short
    hidden = explained - explained_in(short)
    assert hidden <= conditions
    assert bool(hidden) == has_group
    assert all(one in short for one in options)
    assert callable(COMMANDS[name].function())


def explained_in(text):
    """The options at which a line of a help begins."""
    lines = re.findall(r"^[^\w\n-]*((?:-\w.*?, )?--[\w-]+(?:, --[\w-]+)?)", text, re.MULTILINE)
    words = {one for line in lines for one in re.findall(r"--[\w-]+", line)}
    return {one for one in words if f"--{one.removeprefix('--no-')}" not in words - {one}}


def test_help_of_no_command_loads_the_simulator():
    lines = [[], *([*name.split(), "--help"] for name in COMMANDS)]
    code = f"""
import sys
from care_sim.cli import main
for line in {lines}:
    try:
        main(line)
    except SystemExit as end:
        assert end.code == 0
print(*sys.modules, file=sys.stderr)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert {*done.stderr.split()} & HEAVY == set()


@pytest.mark.parametrize("old", RENAMED)
def test_an_old_name_answers_and_names_the_new_one(old, capsys):
    code, out, err = run(capsys, old, "--help" if old != "completion" else "bash")
    assert not code
    assert out
    assert err == f"care-sim: `care-sim {old}` is now `care-sim {RENAMED[old]}`\n"


def test_old_lines_mean_what_they_did(capsys):
    for old, new in (
        ("ablate --source streets", "study ablate --source streets"),
        ("merge a b --out c", "report a b --out c"),
        ("enjoy ppo --seed 3 --view", "run ppo --seed 3 --view"),
        ("collect dense --dataset x/y-v0", "export minari dense --dataset x/y-v0"),
        ("export --source nuscenes:x --out y", "export nuscenes --source nuscenes:x --out y"),
        ("train learned_scorer --out x", "train learned-scorer --out x"),
    ):
        assert parsed_command(old.split()) == parsed_command(new.split())
    assert capsys.readouterr().err.count(" is now ") == 5


def test_the_defaults_of_options_are_those_of_the_simulator():
    """Options name them as texts, so that help does not load what they belong to."""
    usual = EpisodeConfig("dense", "care")
    given = shared.EpisodeOptions().sensing()
    assert given.keys() >= {*DEFAULTS, "sensor", "detector"}
    assert all(getattr(usual, name) == value for name, value in given.items())
    assert (shared.SensingOptions.sensor, shared.PlayOptions.detector) == (DEFAULT_SETUP, PROXY)
    assert results.Judge.detectors == (PROXY, CLUSTER, PILLARS)
    assert results.Benchmark.detector == MAIN_DETECTOR
    assert results.ExportMinari.__dataclass_fields__["episodes"].metadata["bounds"][1] == MOST_TASKS


@pytest.mark.parametrize("kind", KINDS)
def test_a_list_fits_eighty_columns_and_has_its_names_in_python(kind, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, err = run(capsys, "list", kind)
    assert (code, err) == (0, "")
    assert max(map(len, out.splitlines())) <= 80
    names = care_sim.names(kind)
    assert len(names) > 1
    if kind != "agents":
        shown = [re.split(r"[\s:]", line)[0] for line in out.splitlines() if line[:1].strip()]
        assert shown == names
    assert run(capsys, "list", kind.rstrip("s"))[0] == 2


ASK = """
source /dev/stdin
for line in "re" "train pp" "study ab" "train ppo --res" "run dartout --rec" "run xy"; do
    COMP_WORDS=(care-sim $line); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); COMPREPLY=()
    _tyro_care_sim; echo "${COMPREPLY[@]}"
done
"""


def test_a_shell_completes_commands_and_options(capsys):
    script = run(capsys, "--tyro-print-completion", "bash")[1]
    found = subprocess.run(
        ["bash", "-c", ASK], input=script, capture_output=True, text=True, check=True
    )
    assert found.stdout.splitlines() == [
        "report reproduce",
        "ppo",
        "ablate",
        "--resume",
        "--record",
        "",
    ]


SLOW = {"highway_env", "matplotlib", "pandas", "scipy.stats", "torch"}
FIRST = """
import os, sys

class First:
    encoding = "utf-8"

    def write(self, text):
        if text.strip():
            os.write(2, " ".join(sys.modules).encode())
            os._exit(0)

    def flush(self):
        pass

    def isatty(self):
        return False

sys.stdout = sys.stderr = First()
from care_sim.cli import main
main(sys.argv[1:])
"""


@pytest.mark.parametrize("line", ["sweep --seeds 1", "protocol --scenes 1", "report results/dense"])
def test_nothing_slow_that_is_not_needed_yet(line, tmp_path):
    command = [sys.executable, "-c", FIRST, *line.split()]
    ended = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
    )
    loaded = {*ended.stderr.split()}
    assert "care_sim" in loaded
    assert loaded & SLOW == set()

import gc
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import Mock

import pytest

from care_sim.base.interrupts import SIGNALS
from care_sim.cli import main
from care_sim.policies import contenders
from care_sim.scenarios import SCENARIOS
from care_sim.sources.installed import SOURCES
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows, write_rows
from tests.helpers.commands import run
from tests.helpers.made_rows import STUDY

SHORT = ["--scenario-parameters", "duration_s=0.3"]


def test_a_host_that_calls_a_command_keeps_its_handlers_and_may_do_so_in_a_thread(capsys):
    before = [signal.getsignal(number) for number in (*SIGNALS, signal.SIGALRM)]
    collector = gc.get_threshold()
    with ThreadPoolExecutor(1) as threads:
        code, out, err = threads.submit(run, capsys, "list", "detectors").result()
    assert (code, err) == (0, "")
    assert "cluster" in out
    assert run(capsys, "list", "detectors")[0] == 0
    assert [signal.getsignal(number) for number in (*SIGNALS, signal.SIGALRM)] == before
    assert gc.get_threshold() == collector


def test_an_unfinished_study_is_told_from_none(capsys, tmp_path):
    (tmp_path / "journal.jsonl").touch()
    code, _, err = run(capsys, "report", tmp_path)
    assert (code, err) == (
        2,
        f"care-sim: {tmp_path} holds an unfinished study, 0 rows; run again the command that began "
        "it\n",
    )
    (tmp_path / EPISODES.file).write_bytes(b"PAR1 and then nothing")
    code, _, err = run(capsys, "report", tmp_path)
    assert (code, f"{EPISODES.file} is not a readable Parquet file" in err) == (2, True)


def test_a_broken_source_is_listed_with_its_reason(capsys, install):
    install("ours", "import nowhere", SOURCES.group, torn="Torn")
    code, out, err = run(capsys, "list", "sources")
    assert (code, err) == (0, "")
    (torn,) = (line for line in out.splitlines() if line.startswith("torn"))
    assert "(broken) ModuleNotFoundError: No module named 'nowhere'" in torn


@pytest.mark.smoke
def test_run_prints_the_timeline_and_the_outcome(capsys):
    code, out, _ = run(capsys, "run", "dense", "--policy", "full", "--budget", "0.2", *SHORT)
    assert code == 0
    assert out.count("16384") == 2
    assert "detection_distance_m" in out


@pytest.mark.smoke
def test_a_sweep_runs_the_grid_and_its_folder_can_be_reported(capsys, tmp_path):
    axes = "--scenarios dartout --policies random care full --budgets 0.05 --camera-latencies 0 1"
    line = f"sweep {axes} --seeds 3 4 --workers 1"
    code, out, err = run(capsys, *line.split(), "--out", tmp_path, *SHORT)
    assert code == 0, err
    rows = read_rows(tmp_path / EPISODES.file)
    told = [(row["policy"], row["budget"], row["camera_latency"], row["seed"]) for row in rows]
    played = [("care", 0.05, 0), ("care", 0.05, 1), ("full", 1.0, 0)]
    # `random` feels no camera either.
    assert {one for one in told if one[0] != "random"} == {
        (*one, seed) for one in played for seed in (3, 4)
    }
    assert {one[:2] for one in told} == {("random", 0.05), ("care", 0.05), ("full", 1.0)}
    (tmp_path / "tables.md").unlink()
    code, again, _ = run(capsys, "report", tmp_path)
    assert code == 0
    assert again in out
    assert (tmp_path / "tables.md").exists()


@pytest.fixture
def torn(tmp_path, monkeypatch):
    """An installed package whose policy does not load."""
    package = tmp_path / "site" / "torn-1.5.dist-info"
    package.mkdir(parents=True)
    (package / "METADATA").write_text("Metadata-Version: 2.1\nName: torn\nVersion: 1.5\n")
    (package / "entry_points.txt").write_text("[care_sim.policies]\ntorn = torn_policy:Torn\n")
    monkeypatch.syspath_prepend(package.parent)


def test_all_scenarios_and_policies_are_swept_but_for_a_broken_one_which_is_named(
    capsys, tmp_path, torn
):
    out = tmp_path / "out"
    line = "sweep --policies all --scenarios all --seeds 1 --workers 1 --scenario-parameters"
    code, _, err = run(capsys, *line.split(), "duration_s=0.1", "--out", out)
    assert code == 1
    assert err.count("care-sim: left out: policy torn cannot be loaded: ModuleNotFoundError") == 2
    rows = read_rows(out / EPISODES.file)
    assert {row["policy"] for row in rows} == set(contenders()) - {"torn"}
    assert {row["scenario"] for row in rows} == set(SCENARIOS)
    code, _, err = run(capsys, "sweep", "--policies", "torn", "--seeds", "1", "--out", out)
    assert code == 2
    assert "policy torn cannot be loaded" in err
    assert "No module named 'torn_policy' [torn 1.5]" in run(capsys, "list", "policies")[1]
    assert err.endswith("care-sim: none of the policies can be played\n")


def test_a_name_that_a_terminal_would_obey_stays_on_its_line(capsys, tmp_path):
    odd, told = tmp_path / "a\nb\x1b[31m\u202ec", r"a\nb\x1b[31m\u202ec"
    axes = ["--policies", "care", "--scenarios", "dartout", "--budgets", "0.1", "--seeds", "1"]
    sweep = ["sweep", *axes, *SHORT, "--workers", "1", "--out", odd]
    for command in (
        sweep,
        sweep,
        ["report", odd],
        ["report", odd, odd, "--out", odd / "whole"],
        ["run", "dartout", *SHORT, "--video", odd / "film.gif"],
    ):
        code, out, err = run(capsys, *command)
        assert code == 0, err
        text = out + err
        assert text.count(told) == text.count(told[3:]) > 0
        assert all(map(str.isprintable, text.split("\n")))


def test_a_picture_of_the_braking_car(capsys, tmp_path):
    from PIL import Image

    picture = tmp_path / "deep" / "keyframe.png"
    assert run(capsys, "run", "dartout", "--picture", picture)[0] == 0
    assert Image.open(picture).size == (960, 720)


@pytest.mark.parametrize("fault", [RecursionError, MemoryError])
def test_a_fault_of_the_software_is_one_line_and_its_trace_is_to_be_had(fault, capsys, monkeypatch):
    # Raised by the library, since what this file raises is no fault of the software's own.
    fails = Mock(side_effect=fault("deep\ninside"))
    monkeypatch.delenv("CARE_SIM_DEBUG", raising=False)
    monkeypatch.setattr("care_sim.scenarios.listing.scenario_lines", fails)
    code, _, err = run(capsys, "list", "scenarios")
    if fault is MemoryError:
        assert (code, "ulimit -v" in err) == (1, True)
    else:
        assert code == 70
        told = f"care-sim: unexpected {fault.__name__}: deep inside; please report it"
        assert err.startswith(told)
    assert err.count("\n") == 1
    with pytest.raises(fault):
        main(["list", "scenarios", "--debug"])
    monkeypatch.setenv("CARE_SIM_DEBUG", "1")
    with pytest.raises(fault):
        main(["list", "scenarios"])


_FAULTY = """
import numpy
from dataclasses import dataclass
from care_sim.policies.paper.tracks import History
from care_sim.base.errors import InvalidInput
from care_sim.scenarios.dartout import Dartout
from care_sim.sources.scenes import Generated

class Slips(History):
    def demand(self, belief):
        return numpy.concatenate([numpy.zeros(3), belief.tracks.boxes])

@dataclass(frozen=True)
class Peopled(Dartout):
    def build(self, rng):
        world = super().build(rng)
        world.add("x", "unicorn", (1.0, 2.0, 0.0))
        return world

@dataclass(frozen=True)
class Refuses(Dartout):
    def build(self, rng):
        raise InvalidInput("no such gap")

@dataclass(frozen=True)
class Single(Generated):
    def seeds(self):
        return 1
    def street(self, seed):
        pass

@dataclass(frozen=True)
class Seedless(Generated):
    def street(self, seed):
        pass
"""


@pytest.mark.parametrize(
    ("arguments", "code", "place"),
    [
        ("run dartout --policy faulty:Slips", 1, "faulty.py, line 11"),
        ("sweep --scenarios dartout --policies faulty:Slips --seeds 1", 1, "faulty.py, line 11"),
        ("run faulty:Peopled", 1, "faulty.py, line 17"),
        # Ours stumbles over what it gave.
        ("run faulty:Single", 1, "class Single, faulty.py, line 25"),
        ("run faulty:Refuses", 2, "no such gap"),
        ("run faulty:Seedless", 2, "source faulty:Seedless cannot be loaded: faulty:Seedless"),
        ("run faulty:Nobody", 2, "scenario faulty:Nobody cannot be loaded: AttributeError"),
    ],
)
def test_a_fault_in_code_of_ones_own_is_told_with_its_file_and_line_unless_it_refuses(
    arguments, code, place, capsys, tmp_path, monkeypatch
):
    (tmp_path / "faulty.py").write_text(_FAULTY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    ended, _, err = run(capsys, *arguments.split())
    sys.modules.pop("faulty", None)
    assert ended == code, err
    (told,) = [line for line in err.splitlines() if place in line]
    assert (f"({place})" in told) == (code == 1)
    assert "report it" not in err


@pytest.mark.parametrize(
    ("shell", "code", "complaint"),
    [
        ("{} list policies | true; exit ${{PIPESTATUS[0]}}", 141, ""),
        ("{} list policies > /dev/full", 2, "care-sim: [Errno 28] No space left on device\n"),
        ("{} view --help >&- 2>&-", 0, ""),
        ("PYTHONIOENCODING=ascii {} view x --x", 2, "care-sim: unrecognized options: --x\n"),
        ("COLUMNS=² LINES=0 {} report . --minus care | grep -q 'care minus each policy'", 0, ""),
    ],
)
def test_output_that_goes_nowhere_or_has_no_width_ends_quietly(shell, code, complaint, tmp_path):
    write_rows(STUDY, tmp_path / EPISODES.file)
    command = shell.format(f"{sys.executable} -m care_sim")
    ended = subprocess.run(
        ["bash", "-c", command], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (ended.returncode, ended.stderr) == (code, complaint)

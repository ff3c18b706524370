import gc
import re
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from unittest.mock import Mock

import pytest

from care_sim.base.errors import InvalidInput
from care_sim.base.interrupts import SIGNALS
from care_sim.cli import main
from care_sim.commands.options.studies import Reproduce
from care_sim.commands.studies.closed_loop import fixed_study
from care_sim.policies import contenders
from care_sim.scenarios import SCENARIOS
from care_sim.sources.installed import SOURCES
from care_sim.study.episode_config import EpisodeConfig, grid
from care_sim.study.episode_play import run_episode
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows, write_rows
from tests.helpers.made_rows import STUDY

SHORT = ["--scenario-parameters", "duration_s=0.3"]


def run(capsys, *arguments):
    """Exit code, output and error lines of a command."""
    with pytest.raises(SystemExit) as end:
        main([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return end.value.code, out, err


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


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        (["--foo"], ["'--foo' is no option of care-sim", "`care-sim` lists commands"]),
        (["walk"], ["unknown command 'walk'", "reproduce"]),
        (["train", "walk"], ["unknown command after train 'walk'", "curves"]),
        (["run"], ["SCENARIO"]),
        (["run", "dance"], ["'dance'", "dartout"]),
        (["run", "dense", "--policy", "best"], ["'best'", "care"]),
        (["run", "dense", "--bugdet", "1"], ["--bugdet", "--budget"]),
        (["run", "dense", "--budget", "x"], ["--budget", "'x'"]),
        (
            ["study", "crowding", "--driver", "careful-human"],
            ["unrecognized options: --driver careful-human\n"],
        ),
        (["reproduce", "--no_floor"], ["unrecognized options: --no_floor\n"]),
        (["study", "faults", "--camera-latency", "1"], ["camera_latency is a fault that grows"]),
        (
            ["study", "mechanism", "--floor-seeds", "2"],
            ["unrecognized options: --floor-seeds 2", "--floor-seed"],
        ),
        (["study", "ncap", "--wheels", "3"], ["unrecognized options: --wheels 3"]),
        (["run", "dense", "--budget", "0"], ["budget", "(0, 1]"]),
        (["run", "dense", "--budget", "1.5"], ["budget", "(0, 1]"]),
        (["run", "dense", "--camera-latency", "-1"], ["camera_latency", ">= 0"]),
        (["run", "dense", "--false-negative-rate", "1.1"], ["false_negative_rate", "[0, 1]"]),
        (["run", "dense", "--lidar-dropout", "-1"], ["dropout", "[0, 1]"]),
        (["run", "dense", "--reserve-fraction", "2"], ["reserve_fraction", "[0, 1]"]),
        (["run", "dense", "--engine", "warp"], ["'warp'", "bullet"]),
        (["run", "dense", "--min-returns", "0"], ["min_returns", ">= 1"]),
        (["run", "dense", "--seed", "-1"], ["seed", ">= 0"]),
        (["run", "dense", "--scenario-parameters", "wheels=3"], ["'wheels'", "vehicles"]),
        (["run", "dense", "--scenario-parameters", "wheels"], ["NAME=VALUE", "'wheels'"]),
        (
            ["run", "dense", "--scenario-parameters", "vehicles=3", "vehicles=4"],
            ["once", "'vehicles' 2 times"],
        ),
        (["run", "dense", "--policy-parameters", "k=3"], ["care", "k"]),
        (["sweep", "--seeds", "0"], ["seeds", "from 1 to"]),
        (["sweep", "--seeds", "1001"], ["seeds", "from 1 to 1,000"]),
        (["sweep", "--budgets"], ["--budgets", "at least one"]),
        (["sweep", "--scenarios"], ["--scenarios", "at least one"]),
        (["study", "validate"], ["WORLD"]),
        (["study", "validate", "moon"], ["scenario 'moon'", "dartout"]),
        (
            ["study", "validate", "cutin", "--seeds", "1000", "1001"],
            ["seeds of a test", "1,000", "1001"],
        ),
        (["study", "validate", "cutin", "--training-seeds", "0"], ["training_seeds", ">= 1"]),
        (["study", "validate", "cutin", "--factors", "mirrored"], ["NAME=VALUE", "'mirrored'"]),
        (
            ["study", "validate", "cutin", "--factors", "mirrored=half"],
            ["mirrored of cutin 'half'", "drawn"],
        ),
        (["reproduce", "--workers", "0"], ["workers", ">= 1"]),
        (["report", "nowhere"], ["nowhere"]),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(arguments, names, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(capsys, *arguments)
    assert code == 2
    assert err.startswith("care-sim: ")
    assert err.count("\n") == 1
    assert all(name in err for name in names), err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("run dense --fog 50", "unrecognized options: --fog 50"),
        ("run dense --latency 2", "--camera-latency"),
        ("run dense --bugdet 1", "perhaps --budget"),
        ("sweep --policy care", "perhaps --policies"),
        ("sweep --seed 3", "perhaps --seeds"),
        ("train ppo --learning 3", "perhaps --learning-rate"),
        ("train walk", "unknown command after train 'walk'; known: curves, detector, "),
        (
            "run dense --policy kare",
            "unknown policy 'kare'; the nearest is care; known: all-camera, ",
        ),
        ("run dens", "unknown scenario 'dens'; the nearest is dense; known: "),
        ("run moon", "; `care-sim list scenarios` tells what each is"),
        ("polices", "unknown command 'polices'; perhaps `list policies`; known: "),
    ],
)
def test_who_is_lost_is_told_a_way_on(arguments, told, capsys):
    code, _, err = run(capsys, *arguments.split())
    assert (code, err.count("\n")) == (2, 1)
    assert told in err


@pytest.mark.parametrize(
    "command",
    [
        ["sweep"],
        ["study", "ncap"],
        ["study", "r157"],
        ["study", "validate", "dartout"],
        ["reproduce"],
        ["study", "ablate"],
        ["study", "faults"],
        ["study", "crowding"],
        ["study", "order"],
        ["study", "firing"],
        ["study", "realism"],
        ["study", "vehicle"],
    ],
    ids=lambda command: command[0],
)
def test_seeds_of_several_splits_are_no_study(command, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(capsys, *command, "--seeds", "999", "1000", "10000")
    assert code == 2
    assert err.count("\n") == 1
    assert "test 0 to 999" in err
    assert "got 999 of test and 1000 of calibration and 10000 of train" in err
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize(
    "command",
    [
        "run dartout --picture",
        "run dartout --video",
        "run dartout --record",
        "compare dartout --record",
        "train learned-scorer --out",
        "train learned-sets --out",
        "train detector --out",
        "report NOTHING -o",
    ],
)
def test_what_stands_where_a_file_is_wanted_is_one_line_before_anything_is_computed(
    command, capsys, tmp_path
):
    """Somebody's table, and a folder."""
    table, results = tmp_path / "table.png", tmp_path / "results"
    table.write_bytes(b"PAR1 and rows")
    write_rows(
        [
            run_episode(
                EpisodeConfig("dartout", "random", scenario_parameters=(("duration_s", 0.1),))
            )
        ],
        results / EPISODES.file,
    )
    for place in (table, tmp_path) if not command.endswith(("video", "picture")) else (table,):
        code, out, err = run(capsys, *command.replace("NOTHING", str(results)).split(), place)
        assert (code, out, err.count("\n")) == (2, "", 1), err
        assert str(place) in err
    assert table.read_bytes() == b"PAR1 and rows"


def test_a_folder_that_cannot_be_written_is_named(capsys, tmp_path):
    (tmp_path / "file").touch()
    code, _, err = run(capsys, "sweep", "--seeds", "1", "--out", tmp_path / "file" / "out")
    assert (code, err.count("\n")) == (2, 1)
    assert str(tmp_path / "file") in err


def test_a_damaged_parquet_file_is_named(capsys, tmp_path):
    (tmp_path / EPISODES.file).write_bytes(b"PAR1 and then nothing")
    code, _, err = run(capsys, "report", tmp_path)
    assert (code, err.count("\n")) == (2, 1)
    assert EPISODES.file in err


def test_an_unfinished_study_is_told_from_none(capsys, tmp_path):
    (tmp_path / "journal.jsonl").touch()
    code, _, err = run(capsys, "report", tmp_path)
    assert (code, err) == (
        2,
        f"care-sim: {tmp_path} holds an unfinished study, 0 rows; run again the command that began "
        "it\n",
    )
    code, _, err = run(capsys, "report", tmp_path / "nowhere")
    assert "no results at" in err


def test_the_detectors_are_listed_with_a_line_each(capsys):
    code, out, _ = run(capsys, "list", "detectors")
    assert code == 0
    first = [line for line in out.splitlines() if not line.startswith(" ")]
    assert [line.split()[0] for line in first] == [
        "returns",
        "graded",
        "cluster",
        "pillars",
        "torchscript",
    ]
    assert all(len(line.split()) > 5 for line in first)
    # Whole sentences, however many lines they take.
    told = " ".join(out.split())
    assert "classes by size" in told, told
    assert "trained on scans of every budget." in told


def test_the_sources_are_listed_as_they_are_asked_for_and_a_broken_one_with_its_reason(
    capsys, install
):
    install("ours", "import nowhere", SOURCES.group, torn="Torn")
    code, out, err = run(capsys, "list", "sources")
    assert (code, err) == (0, "")
    assert re.findall(r"^\S+", out, re.MULTILINE) == [
        "streets",
        "argoverse2:FOLDER",
        "nuscenes:FOLDER",
        "kitti:FOLDER",
        "sweeps:FOLDER",
        "boreas",
        "torn",
    ]
    assert "    split='val'\n" in out
    (torn,) = (line for line in out.splitlines() if line.startswith("torn"))
    assert "(broken) ModuleNotFoundError: No module named 'nowhere'" in torn


@pytest.mark.smoke
def test_run_prints_the_timeline_and_the_outcome(capsys):
    code, out, _ = run(capsys, "run", "dense", "--policy", "full", "--budget", "0.2", *SHORT)
    assert code == 0
    assert out.count("16384") == 2
    assert max(map(len, out.splitlines())) <= 100
    assert all(
        word in out for word in ("sensor to", "0.3 s after", "detection_distance_m", "episode_hash")
    )


@pytest.mark.smoke
def test_a_sweep_runs_the_grid_and_its_folder_can_be_reported(capsys, tmp_path):
    axes = ["--scenarios", "dartout", "--policies", "random", "full", "--budgets", "0.05", "0.1"]
    code, out, err = run(
        capsys, "sweep", *axes, "--seeds", "3", "4", "--out", tmp_path, "--workers", "1", *SHORT
    )
    assert code == 0, err
    rows = read_rows(tmp_path / EPISODES.file)
    assert {(row["policy"], row["budget"], row["seed"]) for row in rows} == {
        (policy, budget, seed)
        for policy, budget in (("random", 0.05), ("random", 0.1), ("full", 1.0))
        for seed in (3, 4)
    }
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
    axes = [
        "--policies",
        "all",
        "--scenarios",
        "all",
        "--seeds",
        "1",
        "--workers",
        "1",
        "--out",
        out,
    ]
    short = ["--scenario-parameters", "duration_s=0.1"]
    code, _, err = run(capsys, "sweep", *axes, *short)
    assert code == 1
    assert err.count("care-sim: left out: policy torn cannot be loaded: ModuleNotFoundError") == 2
    rows = read_rows(out / EPISODES.file)
    assert {row["policy"] for row in rows} == set(contenders()) - {"torn"}
    assert {row["scenario"] for row in rows} == set(SCENARIOS)
    code, _, err = run(capsys, "sweep", "--policies", "torn", "--seeds", "1", "--out", out)
    assert code == 2
    assert "policy torn cannot be loaded" in err
    assert err.endswith("care-sim: none of the policies can be played\n")


def test_further_policies_join_a_set_study_and_a_broken_one_is_left_out(capsys, tmp_path, torn):
    def short(seeds, also):
        return grid(
            ["dartout"], ["care", *also], [0.1], seeds, scenario_parameters=(("duration_s", 0.1),)
        )

    torn_and_sound = ("torn", "uncertainty")
    study = Reproduce(seeds=(1,), workers=1, also=torn_and_sound, out=tmp_path / "out")
    assert fixed_study(study, "sweep", short, "reproduce") == 1
    assert "left out: policy torn cannot be loaded" in capsys.readouterr().err
    assert {row["policy"] for row in read_rows(tmp_path / "out" / EPISODES.file)} == {
        "care",
        "uncertainty",
    }
    alone = Reproduce(seeds=(1,), workers=1, also=("torn",), out=tmp_path / "alone")
    assert fixed_study(alone, "sweep", short, "reproduce") == 1
    assert {row["policy"] for row in read_rows(tmp_path / "alone" / EPISODES.file)} == {"care"}


def test_a_condition_has_one_value_or_several(capsys, tmp_path):
    rates = ["--false-negative-rate", "0.3", "--false-negative-rates", "0.1", "0.2"]
    code, _, err = run(capsys, "sweep", *rates, "--out", tmp_path)
    assert (code, err.count("\n")) == (2, 1)
    assert "give false_negative_rate one value or several, not both" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("run dense --seed abc", "--seed takes INT: invalid literal for int() with base 10: 'abc'"),
        (
            "sweep --budgets x",
            "--budgets takes [FLOAT [FLOAT ...]]: Could not find valid ",
        ),
        ("sweep --seeds 1 a", "--seeds takes [INT [INT ...]]: Could not find valid parse for "),
        ("run dense --seed", "--seed needs a value: INT"),
        ("list walls", "must be one of policies, agents, scenarios, sources, detectors, sensors, "),
        ("run", "missing: SCENARIO|SOURCE|AGENT"),
        ("report", "report needs the folder of a study, its --out"),
    ],
)
def test_what_an_option_takes_is_told(arguments, message, capsys):
    code, _, err = run(capsys, *arguments.split())
    assert (code, err.count("\n")) == (2, 1)
    assert message in err


def test_an_installed_policy_that_does_not_load_is_listed_with_the_reason(
    capsys, tmp_path, monkeypatch
):
    info = tmp_path / "torn-1.5.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: torn\nVersion: 1.5\n")
    (info / "entry_points.txt").write_text(
        "[care_sim.policies]\ntorn = torn_policy:Torn\nzeta = care_sim:Policy\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    code, out, _ = run(capsys, "list", "policies")
    assert code == 0
    assert "No module named 'torn_policy' [torn 1.5]" in out
    assert "zeta" in out


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
    with pytest.raises(SystemExit) as end:
        main(["run", "dartout", "--policy", "care", "--seed", "0", "--picture", str(picture)])
    assert end.value.code == 0
    assert Image.open(picture).size == (960, 720)


def test_no_picture_when_the_car_never_brakes(capsys, tmp_path):
    picture = tmp_path / "keyframe.png"
    with pytest.raises(SystemExit):
        main(
            ["run", "dartout", "--picture", str(picture), "--scenario-parameters", "duration_s=0.2"]
        )
    assert "no picture" in capsys.readouterr().err
    assert not picture.exists()


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["sweep", "--seeds", "9" * 22], "seeds"),
        (["sweep", "--seeds", "9" * 5000], "seeds"),
        (["reproduce", "--seeds", "1000000000"], "seeds"),
        (["run", "dense", "--seed", str(2**64)], "seed"),
        (["run", "dense", "--floor-seed", str(2**64)], "floor_seed"),
        (["run", "dense", "--false-negative-burst", str(10**19)], "false_negative_burst"),
        (["run", "dense", "--ego-speed-sigma", "1e19"], "ego_speed_sigma"),
        (
            ["run", "dense", "--scenario-parameters", "ego_speed_mps=(1e300,1e300)"],
            "ego_speed_mps of dense",
        ),
        (["run", "dense", "--scenario-parameters", "self=1"], "parameter of dense"),
        (["run", "dense", "--policy-parameters", "a={[1]}"], "unknown parameter"),
        (["run", "dense", "--policy-parameters", "a=" + "-" * 5000 + "1"], "unknown parameter"),
        (["run", "dense", "--policy-parameters", "name=x"], "unknown parameter"),
        (["run", "dense", "--policy", "care-sbf", "--policy-parameters", "k_safe={1}"], "k_safe"),
        (["run", "\ud800"], "no text"),
        (["run", "a\0b"], "no text"),
        (["run", "dense", "--policy", "\udcff\x1b[31m"], r"\udcff\x1b[31m"),
        (["run", "dense", "--video", ""], "an argument is empty"),
        (["sweep", "--out="], "an argument is empty"),
        (["run", "dense", "--export", "a" * 300], "path must be a path"),
        (["protocol", "--scenes", "9" * 5000], "scenes"),
        (["sweep", "--workers", str(10**30)], "workers"),
        (["sweep", "--budgets", "inf"], "budget"),
        (["run", "dense", "--seed", str(2**70)], "seed"),
        (["bench", "--seconds", "3"], "`care-sim bench` is `make bench` now"),
        (["parity"], "`care-sim parity` is `make parity` now"),
    ],
)
def test_absurd_input_is_one_line_and_exit_code_2(arguments, named, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, _, err = run(capsys, *arguments)
    assert code == 2
    assert err.startswith("care-sim: ")
    assert err.rstrip("\n").isprintable()
    assert named in err
    assert len(err) < 2100


@pytest.mark.parametrize("fault", [TypeError, RecursionError, MemoryError, OverflowError])
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

class Lacks(History):
    def demand(self, belief):
        open("no such file")

class RefusesToStart(History):
    def __init__(self, rig):
        raise KeyError("weights")

@dataclass(frozen=True)
class Cracked(Dartout):
    def build(self, rng):
        world = super().build(rng)
        return world.crack

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
class Torn(Generated):
    def seeds(self):
        return 1 / 0
    def street(self, seed):
        pass

@dataclass(frozen=True)
class Single(Torn):
    def seeds(self):
        return 1

@dataclass(frozen=True)
class Seedless(Generated):
    def street(self, seed):
        pass
"""


@pytest.mark.parametrize(
    ("arguments", "code", "place"),
    [
        ("run dartout --policy faulty:Slips", 1, "faulty.py, line 11"),
        ("compare dartout --policies faulty:Slips", 1, "faulty.py, line 11"),
        ("sweep --scenarios dartout --policies faulty:Slips --seeds 1", 1, "faulty.py, line 11"),
        ("run dartout --policy faulty:Lacks", 1, "faulty.py, line 15"),
        ("run dartout --policy faulty:RefusesToStart", 1, "faulty.py, line 19"),
        ("run faulty:Cracked", 1, "faulty.py, line 25"),
        ("run faulty:Peopled", 1, "faulty.py, line 31"),
        ("run faulty:Torn", 1, "faulty.py, line 42"),
        # Ours stumbles over what it gave.
        ("run faulty:Single", 1, "class Single, faulty.py, line 46"),
    ],
)
def test_a_fault_in_code_of_ones_own_is_told_with_its_file_and_line(
    arguments, code, place, capsys, tmp_path, monkeypatch
):
    (tmp_path / "faulty.py").write_text(_FAULTY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    ended, _, err = run(capsys, *arguments.split())
    sys.modules.pop("faulty", None)
    assert ended == code, err
    (told,) = [line for line in err.splitlines() if "faulty.py" in line]
    assert f"({place})" in told
    assert "report it" not in err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        ("run faulty:Refuses", "care-sim: no such gap\n"),
        (
            "run faulty:Seedless",
            "care-sim: source faulty:Seedless cannot be loaded: faulty:Seedless",
        ),
        ("run faulty:Nobody", "care-sim: scenario faulty:Nobody cannot be loaded: AttributeError"),
        ("run faulti:Refuses", "care-sim: scenario faulti:Refuses cannot be loaded: ModuleNot"),
    ],
)
def test_what_code_of_ones_own_refuses_and_what_is_no_code_is_bad_input(
    arguments, told, capsys, tmp_path, monkeypatch
):
    (tmp_path / "faulty.py").write_text(_FAULTY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    ended, _, err = run(capsys, *arguments.split())
    sys.modules.pop("faulty", None)
    assert (ended, err[: len(told)]) == (2, told)


def test_the_trace_of_a_fault_in_code_of_ones_own_is_shown_where_it_is_wanted(
    tmp_path, monkeypatch
):
    (tmp_path / "faulty.py").write_text(_FAULTY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InvalidInput, match="crack"):
        main(["run", "faulty:Cracked", "--debug"])
    sys.modules.pop("faulty", None)


@pytest.mark.parametrize(
    ("shell", "code", "complaint"),
    [
        ("{} list policies | true; exit ${{PIPESTATUS[0]}}", 141, ""),
        ("{} list policies > /dev/full", 2, "care-sim: [Errno 28] No space left on device\n"),
        ("{} view --help >&-", 0, ""),
        ("{} view --help >&- 2>&-", 0, ""),
        ("COLUMNS=1 timeout 60 {} view --help > /dev/null", 0, ""),
        ("PYTHONIOENCODING=ascii {} list policies > /dev/null", 0, ""),
        ("PYTHONIOENCODING=ascii {} view x --x", 2, "care-sim: unrecognized options: --x\n"),
        (
            "PYTHONIOENCODING=ascii {} certify --workers 0",
            2,
            "care-sim: workers must be a whole number >= 1 and <= 1024, got 0\n",
        ),
    ],
)
def test_output_that_goes_nowhere_ends_quietly(shell, code, complaint):
    command = shell.format(f"{sys.executable} -c 'from care_sim.cli import main; main()'")
    ended = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False
    )
    assert (ended.returncode, ended.stderr) == (code, complaint)


@pytest.mark.parametrize(
    ("shell", "code"),
    [
        ("{} | true; exit ${{PIPESTATUS[0]}}", 141),
        ("COLUMNS=0 {} | grep -q 'care minus each policy'", 0),
        ("COLUMNS=² LINES=² {} | grep -q 'care minus each policy'", 0),
    ],
)
def test_tables_are_printed_into_closed_pipes_and_at_odd_widths(shell, code, tmp_path):
    write_rows(STUDY, tmp_path / EPISODES.file)
    program = f"{sys.executable} -c 'from care_sim.cli import main; main()'"
    command = shell.format(f"{program} report {tmp_path} --minus care")
    ended = subprocess.run(
        ["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False
    )
    assert (ended.returncode, ended.stderr) == (code, "")

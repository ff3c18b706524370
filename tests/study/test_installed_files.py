"""What an installed policy or detector ships, or names as a default, counts in the key of a row."""

from pathlib import Path

import numpy as np
import pytest

from care_sim.base.named_files import files_named_in, paths_in
from care_sim.base.package_files import shipped_files
from care_sim.commands.shared.run_study import run_study
from care_sim.policies import POLICIES
from care_sim.sources.named import source_of
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.journal import JOURNAL, Journal
from care_sim.study.play_config import play_grid
from care_sim.study.provenance import code_digest, detector_digest, policy_digest
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows
from care_sim.study.run_config import files_in
from care_sim.study.runner import run_all

HEAD = """
from pathlib import Path
import numpy as np
from care_sim.policies.paper.blind import BeamReduce
HERE = Path(__file__).parent
"""
BODY = """
class Mine(BeamReduce):
    name = "mine"
    {constant}

    def __init__(self, rig, {parameter}):
        super().__init__(rig)
        with np.load({opened}) as file:
            self._stride = int(file["stride"])
"""
FORMS = {
    "a default beside where it is played": ("", 'path="weights.npz"', "path"),
    "an absolute default": ("", "path=HERE / 'weights.npz'", "path"),
    "a default beside its module": ("", 'path="weights.npz"', "HERE / path"),
    "a default among others": ("", 'paths=("none.npz", "weights.npz")', "HERE / paths[1]"),
    "a default folder": ("", 'folder="."', 'HERE / folder / "weights.npz"'),
    "a constant of the class": ('PATH = HERE / "weights.npz"', "n=1", "self.PATH"),
    "nothing but code": ("", "n=1", 'Path(__file__).with_name("weights.npz")'),
}


@pytest.fixture
def site(install, tmp_path, monkeypatch):
    """Installs a policy that opens `weights.npz` in one of the forms; returns the folder of its
    module.
    """

    def put(form):
        constant, parameter, opened = FORMS[form]
        install(
            "mine_policy",
            HEAD + BODY.format(constant=constant, parameter=parameter, opened=opened),
            mine="Mine",
        )
        monkeypatch.chdir(tmp_path / "mine_policy")
        write(tmp_path / "mine_policy", 1)
        return tmp_path / "mine_policy"

    return put


def write(folder, stride):
    np.savez(folder / "weights.npz", stride=np.array(stride))


@pytest.mark.parametrize("form", FORMS)
def test_weights_that_change_give_another_key_and_their_return_the_old_one(site, form):
    folder = site(form)
    config = EpisodeConfig("dartout", "mine")
    before = config.digest()
    assert config.digest() == before
    write(folder, 2)
    assert config.digest() != before
    write(folder, 1)
    assert config.digest() == before


def test_the_same_command_plays_again_with_new_weights(site, tmp_path, capsys):
    folder, out = site("a default beside its module"), tmp_path / "out"
    config = EpisodeConfig("dartout", "mine", scenario_parameters=(("duration_s", 0.2),))
    hashes = []
    for stride in (1, 3, 3):
        write(folder, stride)
        assert run_study([config], out, workers=1) == []
        hashes.append(read_rows(out / EPISODES.file)[0]["digest"])
    assert hashes[0] != hashes[1] == hashes[2]
    assert len((out / JOURNAL).read_text().splitlines()) == 2


def test_a_file_that_changes_while_a_study_runs_fails_what_met_it_late(site, tmp_path):
    folder = site("an absolute default")
    configs = [
        EpisodeConfig("dartout", "mine", seed=n, scenario_parameters=(("duration_s", 0.1),))
        for n in range(2)
    ]
    assert [config.key for config in configs] == [config.digest() for config in configs]
    write(folder, 2)
    with Journal(tmp_path / JOURNAL) as journal:
        failures = run_all(configs, journal, 1)
        assert len(journal) == 0
    assert {failure.reason for failure in failures} == {
        "the worker runs another version of care-sim or of the policy, or their files changed "
        "while the study ran"
    }


ELSEWHERE = {
    "a default in the home folder": ("", 'path="~/weights.npz"', "Path(path).expanduser()"),
    "a default below a variable": ("", 'path="$WEIGHTS/weights.npz"', "os.path.expandvars(path)"),
    "a constant table": ('PATHS = {"a": Path.home() / "weights.npz"}', "n=1", 'self.PATHS["a"]'),
    "a default table": ("", 'paths={"a": Path.home() / "weights.npz"}', 'paths["a"]'),
    "a default configuration": ("", "config=Config()", "config.path"),
    "a configuration made in the body": (
        "",
        "config=None",
        "Path((config or Late()).path).expanduser()",
    ),
    "a text in the body": ("", "path=None", 'path or "weights.npz"'),
}
CONFIGS = """
import os
from dataclasses import dataclass
@dataclass
class Config:
    path: Path = Path.home() / "weights.npz"
@dataclass
class Late:
    path: str = "~/weights.npz"
"""


@pytest.mark.parametrize("form", ELSEWHERE)
def test_weights_that_lie_elsewhere_count_by_whatever_names_them(
    form, install, tmp_path, monkeypatch
):
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("WEIGHTS", str(home))
    monkeypatch.chdir(home)
    write(home, 1)
    constant, parameter, opened = ELSEWHERE[form]
    install(
        "mine_policy",
        HEAD + CONFIGS + BODY.format(constant=constant, parameter=parameter, opened=opened),
        mine="Mine",
    )
    config = EpisodeConfig("dartout", "mine")
    before = config.digest()
    write(home, 2)
    assert config.digest() != before
    write(home, 1)
    assert config.digest() == before


def test_a_text_in_code_names_no_folder_and_nothing_of_the_system(install, tmp_path, monkeypatch):
    install(
        "mine_policy",
        HEAD + BODY.format(constant="", parameter="n=1", opened='"/proc/self/stat.d"'),
        mine="Mine",
    )
    source = tmp_path / "mine_policy" / "mine_policy.py"
    source.write_text(
        source.read_text() + "SEEN = ('/proc/self/status', {'a': ['/dev/null']})\nX = 'runs.d'\n"
    )
    monkeypatch.chdir(tmp_path)
    (tmp_path / "runs.d").mkdir()
    files = shipped_files(POLICIES.entries()["mine"]).values()
    assert files_named_in(files) == {}
    assert [*paths_in(("/proc/self/status", {"a": ["/dev/null"]}))] == []


def test_structures_that_hold_themselves_end():
    cycle = {}
    cycle["a"] = [cycle, "/"]
    assert set(paths_in(cycle)) == {Path("/")}


def test_data_files_of_a_wheel_count_and_scripts_do_not(site, tmp_path):
    folder = site("nothing but code")
    data, script = tmp_path / "share" / "mine" / "table.csv", tmp_path / "bin" / "mine"
    for file in (data, script):
        file.parent.mkdir(parents=True)
        file.write_text("1")
    info = folder / "mine_policy-1.5.dist-info"
    listed = ("mine_policy.py", "weights.npz", "../share/mine/table.csv", "../bin/mine")
    (info / "RECORD").write_text("".join(f"{name},,\n" for name in listed))
    before = policy_digest("mine")
    script.write_text("#!/elsewhere")
    assert policy_digest("mine") == before
    data.write_text("2")
    assert policy_digest("mine") != before


def test_all_files_of_the_distribution_count_wherever_they_lie(site):
    folder = site("nothing but code")
    info = folder / "mine_policy-1.5.dist-info"
    (folder / "tables").mkdir()
    (folder / "tables" / "a.csv").write_text("1")
    (folder / "stranger.txt").touch()
    (info / "RECORD").write_text(
        "mine_policy.py,,\ntables/a.csv,,\nweights.npz,,\nmine_policy-1.5.dist-info/RECORD,,\n"
    )
    before = policy_digest("mine")
    (folder / "stranger.txt").write_text("of another distribution")
    (folder / "__pycache__").mkdir(exist_ok=True)
    (folder / "__pycache__" / "mine.nbi").touch()
    assert policy_digest("mine") == before
    (folder / "tables" / "a.csv").write_text("2")
    assert policy_digest("mine") != before


def test_code_counts_as_this_process_has_it_loaded(site):
    folder = site("nothing but code")
    before = policy_digest("mine")
    (folder / "mine_policy.py").write_text("edited = True\n")
    assert policy_digest("mine") == before


DETECTOR = """
class Near:
    def __init__(self, file="model.bin"):
        self.file = file

    def detect(self, points):
        return []
"""


def test_a_detector_is_known_by_its_files_too(install, tmp_path, monkeypatch):
    install("near_detector", DETECTOR, group="care_sim.detectors", near="Near")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "model.bin").write_text("1")
    source = source_of("streets")
    (config,) = play_grid(source, source.scenes()[:1], ["care"], [0.1], detector="near")
    before, theirs = config.digest(), detector_digest("near")
    (tmp_path / "model.bin").write_text("2")
    assert config.digest() != before
    assert detector_digest("near") != theirs


def test_parameters_name_files_alone_among_others_and_never_the_folder_that_is_nowhere(tmp_path):
    file = tmp_path / "weights.npz"
    file.write_text("1")
    assert files_in((("a", ""), ("b", "care"), ("c", 3), ("d", "x" * 5000), ("e", "a\0b"))) == []
    assert len(files_in((("a", str(file)), ("b", (0.5, str(file)))))) == 2


def test_the_shipped_weights_are_looked_at_again(monkeypatch, tmp_path):
    (tmp_path / "a.npz").write_text("1")
    monkeypatch.setattr("care_sim.study.provenance.SHIPPED", tmp_path)
    before = code_digest()
    (tmp_path / "a.npz").write_text("2")
    assert code_digest() != before


def test_of_a_policy_by_its_place_code_counts_and_what_lies_beside_it_does_not(
    tmp_path, monkeypatch
):
    """A log that the shell writes there must not end the study that it tells of."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("sys.dont_write_bytecode", True)
    source = "import placed_help\nfrom care_sim.policies.paper.tracks import History as Mine\n"
    (tmp_path / "placed.py").write_text(source)
    (tmp_path / "placed_help.py").write_text("margin = 1")
    (tmp_path / "log.txt").write_text("one line")
    (tmp_path / "other.py").write_text("nobody imports this")
    files = shipped_files(POLICIES.entry("placed:Mine"))
    assert {*files} == {"placed.py", "placed_help.py"}
    before = policy_digest("placed:Mine")
    (tmp_path / "log.txt").write_text("two lines")
    assert policy_digest("placed:Mine") == before

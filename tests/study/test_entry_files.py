"""The files that decide what an installed policy or detector does count in the key of a row."""

import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from uuid import uuid4

import numpy as np
import pytest

from care_sim.base.digests import entry_files, files_below, paths_in
from care_sim.base.errors import InvalidInput
from care_sim.commands.shared.run_study import run_study
from care_sim.sources.named import source_of
from care_sim.study import provenance
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.journal import JOURNAL, Journal
from care_sim.study.play_config import play_grid
from care_sim.study.provenance import code_digest, detector_digest, file_digest, policy_digest
from care_sim.study.results_formats import EPISODES
from care_sim.study.rows.parquet import read_rows
from care_sim.study.run_config import files_in
from care_sim.study.runner import run_all

MINE = """
from pathlib import Path
import numpy as np
from care_sim.policies.paper.blind import BeamReduce
class Mine(BeamReduce):
    name = "mine"
    files = {files}
    def __init__(self, rig, path=Path(__file__).with_name("weights.npz")):
        super().__init__(rig)
        with np.load(path) as file:
            self._stride = int(file["stride"])
"""
LAYOUTS = {
    "code of a package": ("declaring/__init__.py", "declaring/deep/net.py"),
    "data of a package": ("declaring/__init__.py", "declaring/weights/dense.pth"),
    "code beside a module": ("declaring.py", "net.py"),
    "a declared file beside a module": ("declaring.py", "table.csv"),
    "a declared file elsewhere": ("declaring.py", "../home/table.csv"),
    "a file in a declared folder": ("declaring.py", "../home/tables/a/b.csv"),
}
FILES = ("table.csv", "~/table.csv", "../home/tables")


@pytest.fixture
def lay(tmp_path, monkeypatch):
    """Lays the two files of a layout in a folder on the path; returns the second."""
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.syspath_prepend(tmp_path / "code")

    def put(layout):
        module, other = (tmp_path / "code" / name for name in layout)
        for file in (module, other):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text("1")
        for name in ("code/table.csv", "home/table.csv", "home/tables/a/b.csv"):
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).touch()
        module.write_text(MINE.format(files=FILES if module.name == "declaring.py" else ()))
        return other

    yield put
    for name in [name for name in sys.modules if name.partition(".")[0] == "declaring"]:
        del sys.modules[name]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_decides_a_policy_counts(layout, lay):
    file = lay(LAYOUTS[layout])
    keys = []
    for text in ("1", "2", "1"):
        file.write_text(text)
        provenance._loaded.cache_clear()
        keys.append(policy_digest("declaring:Mine"))
    assert keys[0] == keys[2] != keys[1]


@pytest.mark.parametrize(
    "layout",
    [
        ("declaring.py", "log.txt"),
        ("declaring.py", "data/w.npz"),
        ("declaring.py", "__pycache__/a.nbi"),
        ("declaring/__init__.py", "declaring/__pycache__/a.nbi"),
        ("declaring.py", "../home/tables/__pycache__/a.pyc"),
    ],
    ids=lambda layout: layout[1],
)
def test_what_is_no_code_beside_a_module_and_what_python_writes_do_not_count(layout, lay):
    """A log that the shell writes there must not end the study that it tells of."""
    file = lay(layout)
    before = policy_digest("declaring:Mine")
    file.write_text("2")
    assert policy_digest("declaring:Mine") == before


def test_a_lock_of_an_editor_and_a_folder_called_as_code_are_passed_over(lay, tmp_path):
    lay(("declaring.py", "net.py"))
    (tmp_path / "code" / ".#declaring.py").symlink_to("user@host.1")
    (tmp_path / "code" / "folder.py").mkdir()
    assert policy_digest("declaring:Mine")


def test_of_an_installed_module_its_neighbours_do_not_count_and_its_version_does(install, tmp_path):
    install("site-packages", "", mine="Mine")
    place = tmp_path / "site-packages"
    for name in ("site-packages.py", "declaring.py", "stranger.py"):
        (place / name).write_text(MINE.format(files=()))
    (info,) = place.glob("*.dist-info")
    (info / "entry_points.txt").write_text("[care_sim.policies]\nmine = declaring:Mine\n")
    before = policy_digest("mine")
    (place / "stranger.py").write_text("of another distribution")
    provenance._loaded.cache_clear()
    assert policy_digest("mine") == before
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.6\n")
    assert policy_digest("mine") != before
    del sys.modules["declaring"]


def test_code_in_the_root_of_the_clone_does_not_come_with_this_package():
    """Where a newcomer writes a policy: beside `care_sim`, which every policy imports."""
    entry = EntryPoint("mine", "tests.helpers.misbehaving:Thing", "care_sim.policies")
    names = {*entry_files(entry)}
    assert "tests/helpers/misbehaving.py" in names
    assert not {name for name in names if name.startswith("care_sim/")}


@pytest.mark.parametrize(
    ("files", "line"),
    [
        ("'table.csv'", "files must be a tuple of names, got 'table.csv'"),
        ("(1,)", r"files must be a tuple of names, got \(1,\)"),
        ("('tabel.py',)", "files names .*tabel.py, which does not exist"),
    ],
)
def test_declared_files_must_be_names_of_files(files, line, lay):
    lay(("declaring.py", "table.csv")).with_name("declaring.py").write_text(
        MINE.format(files=files)
    )
    with pytest.raises(InvalidInput, match=f"declaring:Mine: {line}"):
        policy_digest("declaring:Mine")


def test_code_counts_as_this_process_has_it_loaded(lay):
    module = lay(("declaring.py", "table.csv")).with_name("declaring.py")
    before = policy_digest("declaring:Mine")
    module.write_text("edited = True\n")
    assert policy_digest("declaring:Mine") == before


def test_what_lies_behind_links_counts_and_links_that_lead_back_end(lay, tmp_path):
    inner = lay(LAYOUTS["code of a package"]).parent
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "w").write_text("1")
    (tmp_path / "data" / "back").symlink_to(inner.parent)
    (inner / "data").symlink_to(tmp_path / "data")
    before = policy_digest("declaring:Mine")
    (tmp_path / "data" / "w").write_text("2")
    assert policy_digest("declaring:Mine") != before


@pytest.fixture
def weights(install, tmp_path, monkeypatch):
    """Installs a policy with weights; returns what writes them anew."""
    install("mine_policy", MINE.format(files=("weights.npz",)), mine="Mine")

    def write(stride):
        np.savez(tmp_path / "mine_policy" / "weights.npz", stride=np.array(stride))

    write(1)
    return write


def test_the_same_command_plays_again_with_new_weights(weights, tmp_path):
    out = tmp_path / "out"
    config = EpisodeConfig("dartout", "mine", scenario_parameters=(("duration_s", 0.2),))
    hashes = []
    for stride in (1, 3, 3):
        weights(stride)
        assert run_study([config], out, workers=1) == []
        hashes.append(read_rows(out / EPISODES.file)[0]["digest"])
    assert hashes[0] != hashes[1] == hashes[2]
    assert len((out / JOURNAL).read_text().splitlines()) == 2


def test_a_file_that_changes_while_a_study_runs_fails_what_met_it_late(weights, tmp_path):
    configs = [
        EpisodeConfig("dartout", "mine", seed=n, scenario_parameters=(("duration_s", 0.1),))
        for n in range(2)
    ]
    assert [config.key for config in configs] == [config.digest() for config in configs]
    weights(2)
    with Journal(tmp_path / JOURNAL) as journal:
        failures = run_all(configs, journal, 1)
        assert len(journal) == 0
    assert {failure.reason for failure in failures} == {
        "the worker runs another version of care-sim or of the policy, or their files changed "
        "while the study ran"
    }


def test_a_detector_is_known_by_its_files_too(install, tmp_path):
    source = "class Near:\n    files = ('model.bin',)\n    def detect(self, points): return []\n"
    install("near_detector", source, group="care_sim.detectors", near="Near")
    (tmp_path / "near_detector" / "model.bin").write_text("1")
    streets = source_of("streets")
    (config,) = play_grid(streets, streets.scenes()[:1], ["care"], [0.1], detector="near")
    before, theirs = config.digest(), detector_digest("near")
    (tmp_path / "near_detector" / "model.bin").write_text("2")
    assert config.digest() != before
    assert detector_digest("near") != theirs


def test_files_that_parameters_name_count(tmp_path, monkeypatch):
    monkeypatch.setenv("DATA", str(tmp_path))
    file = tmp_path / "weights.npz"
    file.write_text("1")
    assert files_in((("a", ""), ("b", "care"), ("c", 3), ("d", "x" * 5000), ("e", "a\0b"))) == []
    assert len(files_in((("a", str(file)), ("b", (0.5, "$DATA/weights.npz"))))) == 2


def test_a_file_in_shared_memory_counts():
    """It lies below /dev."""
    if not Path("/dev/shm").is_dir():
        pytest.skip("no shared memory here")
    file = Path("/dev/shm") / uuid4().hex
    try:
        keys = [files_in((("path", str(file)),)) for text in "12" if file.write_text(text)]
    finally:
        file.unlink()
    assert keys[0] != keys[1]


def test_what_is_no_file_of_anybody_does_not_count(tmp_path):
    (tmp_path / "status").symlink_to("/proc/self/status")
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    given = ["/dev/null", "/dev/stdout", "/proc/self", "/sys", "/dev/fd", str(tmp_path / "status")]
    assert [*paths_in(given)] == []
    assert [*files_below(tmp_path)] == []
    assert file_digest(tmp_path / "loop") == ""


def test_the_shipped_weights_are_looked_at_again(monkeypatch, tmp_path):
    (tmp_path / "a.npz").write_text("1")
    monkeypatch.setattr("care_sim.study.provenance.SHIPPED", tmp_path)
    before = code_digest()
    (tmp_path / "a.npz").write_text("2")
    assert code_digest() != before

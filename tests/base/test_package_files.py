"""Whatever a policy's distribution ships, or its code names, counts in the key of a row, in all
forms of either.
"""

import json
import sys
from importlib.metadata import EntryPoint
from pathlib import Path
from uuid import uuid4

import pytest

from care_sim.base import named_files
from care_sim.base.digests import files_below
from care_sim.base.package_files import shipped_files
from care_sim.study import provenance
from care_sim.study.episode_config import EpisodeConfig
from care_sim.study.episode_play import run_episode
from care_sim.study.provenance import file_digest, policy_digest
from care_sim.study.run_config import files_in

HEAD = """
import os
from functools import cache, partial
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from care_sim.policies.paper.tracks import History
"""
MINE = HEAD + "class Mine(History):\n    pass\n"
MAKE = "def make(rig):\n    return Mine(rig)\n"
NET = "import my_net\n" + MINE
LAZY = MINE + "def net():\n    from my_net.deep import net\n"


@pytest.fixture
def lay(tmp_path, monkeypatch):
    """Lays the files of a distribution below `code`, which is on the path: listed, or installed for
    editing.
    """
    code = tmp_path / "code"
    info = code / "mine-1.0.dist-info"
    monkeypatch.setenv("DATA", str(tmp_path / "data"))

    def put(files, listed=None, value="my_policy:Mine"):
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text)
        info.mkdir(parents=True)
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mine\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text(f"[care_sim.policies]\nmine = {value}\n")
        (info / "RECORD").write_text(
            "".join(f"{name},,\n" for name in listed or ["mine.pth", "__editable__.mine.pth"])
        )
        if listed is None:
            told = {"url": tmp_path.as_uri(), "dir_info": {"editable": True}}
            (info / "direct_url.json").write_text(json.dumps(told))
        monkeypatch.syspath_prepend(code)
        return tmp_path

    yield put
    for name in [
        name
        for name in sys.modules
        if name.partition(".")[0] in ("my_policy", "my_net", "my_space")
    ]:
        del sys.modules[name]


def changes(file):
    """Whether another content of a file gives another key, and the old one the old key."""
    before, old = policy_digest("mine"), file.read_text()
    assert before == policy_digest("mine")
    keys = []
    for text in (old + "2", old):
        file.write_text(text)
        provenance._loaded.cache_clear()
        keys.append(policy_digest("mine"))
    assert keys[1] == before
    return keys[0] != before


INIT, INNER = "code/my_policy/__init__.py", "my_policy/weights/dense.pth"
SHIPPED = {
    "weights that end as path files": ({INIT: MINE, f"code/{INNER}": "1"}, None),
    "the same of a wheel": ({INIT: MINE, f"code/{INNER}": "1"}, ["my_policy/__init__.py", INNER]),
    "weights named as path files": ({INIT: MINE, "code/my_policy/__editable__1": "1"}, None),
    "data of another package": (
        {INIT: NET, "code/my_net/__init__.py": "", "code/my_net/data/w": "1"},
        None,
    ),
    "code of another package": (
        {INIT: NET, "code/my_net/__init__.py": "", "code/my_net/b.py": "B = 1"},
        None,
    ),
    "code of another module": ({INIT: NET, "code/my_net.py": "B = 1"}, None),
    "a package imported while it plays": (
        {INIT: LAZY, "code/my_net/deep.py": "", "code/my_net/w": "1"},
        None,
    ),
}


@pytest.mark.parametrize("form", SHIPPED)
def test_every_file_of_the_distribution_counts(form, lay):
    """The file that changes is the last one."""
    files, listed = SHIPPED[form]
    assert changes(lay(files, listed) / [*files][-1])


def test_code_in_the_root_of_the_clone_does_not_come_with_this_package():
    """Where a newcomer writes a policy: beside `care_sim`, which every policy imports."""
    entry = EntryPoint("mine", "tests.helpers.misbehaving:Thing", "care_sim.policies")
    names = {*shipped_files(entry)}
    assert "tests/helpers/misbehaving.py" in names
    assert not {name for name in names if name.startswith("care_sim/")}


def test_path_files_and_other_distributions_do_not_count(lay):
    others = {
        "code/mine.pth": "1",
        "code/__editable__.mine.pth": "1",
        "venv/site-packages/my_net/w": "1",
    }
    place = lay({INIT: NET, "venv/site-packages/my_net/__init__.py": "", **others})
    sys.path.insert(1, str(place / "venv" / "site-packages"))
    try:
        assert not any(changes(place / file) for file in others)
    finally:
        sys.path.remove(str(place / "venv" / "site-packages"))


def test_what_lies_behind_links_counts_and_links_that_lead_back_end(lay):
    place = lay({INIT: MINE, "data/w": "1", "others/w": "2"})
    (place / "code/my_policy/data").symlink_to("../../data")
    (place / "data/back").symlink_to("../code/my_policy")
    assert changes(place / "data/w")
    before, folder = policy_digest("mine"), file_digest(place / "code")
    (place / "code/my_policy/data").unlink()
    (place / "code/my_policy/data").symlink_to("../../others")
    assert policy_digest("mine") != before
    assert file_digest(place / "code") != folder


PATH = 'Path(os.environ["DATA"]) / "w.npz"'
NAMED = {
    "a constant of the class, made by a function": f"class Mine(History):\n    W = {PATH}\n{MAKE}",
    "a default of the class, made by a function": (
        f"class Mine(History):\n    def __init__(s, w={PATH}): pass\n{MAKE}"
    ),
    "a constant of another class": f"class Net:\n    W = {PATH}\n",
    "a default of a static method": (
        f"class Net:\n    @staticmethod\n    def load(w={PATH}): pass\n"
    ),
    "a default of a helper": f"def load(w={PATH}): pass\n",
    "a default by name of a helper": f"def load(*, w={PATH}): pass\n",
    "a default of a helper that caches": f"@cache\ndef load(w={PATH}): pass\n",
    "a partial": f"load = partial(print, w={PATH})\n",
    "a namespace": f"CONFIG = SimpleNamespace(w={PATH})\n",
    "an instance": f"class C:\n    def __init__(s): s.w = {PATH}\nCONFIG = C()\n",
    "a folder": 'FOLDER = Path(os.environ["DATA"])\n',
    "a folder that is the default of a helper": 'def load(folder=Path(os.environ["DATA"])): pass\n',
}


@pytest.mark.parametrize("form", NAMED)
def test_every_file_that_a_value_of_the_code_names_counts(form, lay):
    own = NAMED[form] if MAKE in NAMED[form] else NAMED[form] + MINE.removeprefix(HEAD) + MAKE
    files = {
        INIT: "from my_policy.deep import make\n",
        "code/my_policy/deep.py": HEAD + own,
        "data/w.npz": "1",
    }
    place = lay(files, value="my_policy:make")
    assert changes(place / "data/w.npz")


def test_a_package_without_a_file_of_its_own_hides_no_module(lay):
    deep = "code/my_space/mine/paths.py"
    code = "import my_space.mine.paths\n" + MINE
    place = lay(
        {"code/my_space/mine/policy.py": code, deep: f"{HEAD}W = {PATH}", "data/w.npz": "1"},
        None,
        "my_space.mine.policy:Mine",
    )
    assert changes(place / "data/w.npz")


def test_a_text_in_code_names_a_file_without_an_ending_too(lay):
    place = lay({INIT: MINE + 'def load():\n    return open("$DATA/best")\n', "data/best": "1"})
    assert changes(place / "data/best")


@pytest.fixture
def shared():
    """A file in shared memory, which lies below /dev."""
    if not Path("/dev/shm").is_dir():
        pytest.skip("no shared memory here")
    file = Path("/dev/shm") / uuid4().hex
    file.write_text("1")
    yield file
    file.unlink()


def test_a_file_in_shared_memory_counts(lay, shared):
    lay({INIT: MINE + f'W = "{shared}"\n'})
    assert changes(shared)
    before = files_in((("path", str(shared)),))
    shared.write_text("2")
    assert files_in((("path", str(shared)),)) != before


def test_what_is_no_file_of_anybody_does_not_count(tmp_path):
    (tmp_path / "status").symlink_to("/proc/self/status")
    given = ["/dev/null", "/dev/stdout", "/proc/self", "/sys", "/dev/fd", str(tmp_path / "status")]
    assert [*named_files.paths_in(given)] == []
    assert [*files_below(tmp_path)] == []


def test_a_relative_folder_that_a_helper_writes_to_is_none_of_the_policys(lay, monkeypatch):
    place = lay({INIT: MINE + 'def train(out="runs", log=("runs",)): pass\n', "runs/a": "1"})
    monkeypatch.chdir(place)
    assert not changes(place / "runs" / "a")


def test_what_a_policy_holds_only_once_it_has_played_leaves_its_key(lay):
    """A worker asks for the key after it has played."""
    code = (
        MINE
        + f"    def reset(self):\n        super().reset()\n        SEEN.append({PATH})\nSEEN = []\n"
    )
    lay({INIT: code, "data/w.npz": "1"})
    config = EpisodeConfig("dartout", "mine", scenario_parameters=(("duration_s", 0.1),))
    before = config.digest()
    named_files._reached.cache_clear()
    assert run_episode(config)["digest"] == before


def test_a_link_that_leads_back_to_itself_is_no_file(tmp_path):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "file").write_text("content")
    assert [path.name for path in files_below(tmp_path)] == ["file"]
    assert file_digest(tmp_path / "loop") == ""

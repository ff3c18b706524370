"""Libraries of extras are imported where they are used, and a missing one is told in a line that
names an extra which brings it.
"""

import ast
import json
import re
import subprocess
import sys
import tomllib

import pytest

from care_sim.base.extras import install_command
from tests.extras_alone import USES
from tests.helpers.places import ROOT
from tests.repository.test_house import MODULES

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]
FOR_DEVELOPERS = {"all", "dev", "docs", "test"}
MODULE_OF = {
    "mujoco_core": "mujoco",
    "open3d_cpu": "open3d",
    "pillow": "PIL",
    "rerun_sdk": "rerun",
    "markdown_it_py": "markdown_it",
}
"""Where a distribution's module has another name."""
BESIDE = {"dask": {"distributed"}, "jinja2": {"markupsafe"}, "torchrl": {"tensordict"}}
"""Modules that come with another."""
NEED_LIBRARIES = (
    "care_sim.training.supervised.detector_network",
    "care_sim.training.networks",
    "care_sim.training.vec_env",
    "care_sim.viewer.recording.",
)
"""Modules that need a library as they are loaded: who uses them imports them in a function."""


def distributions(extra):
    """Libraries that an extra needs, with those of the extras that it names."""
    for wanted in EXTRAS[extra]:
        named = re.fullmatch(r"care-sim\[(.*)\]", wanted)
        if named:
            for other in named[1].split(","):
                yield from distributions(other)
        else:
            yield re.split(r"[\[>=<]", wanted)[0].replace("-", "_")


def brought(extra):
    """The modules that an extra brings."""
    names = {MODULE_OF.get(name, name) for name in distributions(extra)}
    return names.union(*(BESIDE.get(name, ()) for name in names))


OPTIONAL = set().union(*map(brought, EXTRAS))


def test_all_is_all_but_what_developers_need():
    users = set(EXTRAS) - FOR_DEVELOPERS
    assert brought("all") == set().union(*map(brought, users))
    assert brought("all") < brought("dev")


def test_every_library_is_one_that_the_project_asks_for():
    base = {re.split(r"[\[>=<]", wanted)[0].replace("-", "_") for wanted in PROJECT["dependencies"]}
    named = {MODULE_OF.get(name, name) for name in base}
    known = named.union(OPTIONAL, sys.stdlib_module_names, *(BESIDE.get(name, ()) for name in base))
    asked = set()
    for path in MODULES.values():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom):
                asked.add((node.module or "").partition(".")[0])
            elif isinstance(node, ast.Import):
                asked |= {alias.name.partition(".")[0] for alias in node.names}
    assert asked - known - {"care_sim"} == set()


def test_how_an_extra_is_installed_is_said_in_one_place_as_the_pages_say_it():
    told = re.compile(r"care-sim\[|constraints\.txt")
    telling = {module for module, path in MODULES.items() if told.search(path.read_text())}
    assert telling == {"care_sim.base.extras"}
    pages = "".join(page.read_text() for page in (ROOT / "docs").glob("*.md"))
    assert install_command("video").removesuffix(" in the clone") in pages


WITHOUT = """
import importlib, json, sys
class Nothing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in OPTIONAL:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)
OPTIONAL, MODULES, LINES = map(json.loads, sys.argv[1:])
sys.meta_path.insert(0, Nothing())
for module in MODULES:
    importlib.import_module(module)
from care_sim.cli import main
for line in LINES:
    print("$", line, file=sys.stderr)
    try:
        main(line.split())
    except SystemExit as end:
        print("exit", end.code, file=sys.stderr)
"""
MISSED = {
    "run dartout --policy farthest-points": "open3d",
    "run dartout --detector pillars": "rl",
    "run dartout --record film.rrd": "viewer",
    "run dartout --video film.mp4": "video",
    "run ppo-dartout --view": "viewer",
    "view film.rrd": "viewer",
    "reproduce --cluster tcp://127.0.0.1:1": "cluster",
    "export minari dense --dataset care-sim/dense/care-v0": "minari",
    "run sweeps:drive.mcap": "rosbags",
    "run dartout --detector onnx --detector-parameters file=net.onnx": "onnx",
    "train ppo": "rl",
    "train recurrent-ppo": "rl",
    "train detector --out weights.npz": "rl",
    "train learned-sets --out weights.npz": "rl",
}


def without_extras(folder, modules, lines):
    """The messages of a process that lacks all optional libraries as it loads modules and runs
    lines.
    """
    given = map(json.dumps, (sorted(OPTIONAL), modules, lines))
    command = [sys.executable, "-c", WITHOUT, *given]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True).stderr


def test_only_modules_that_others_load_when_they_need_them_load_libraries_of_extras(tmp_path):
    modules = [name for name in sorted(MODULES) if not name.startswith(NEED_LIBRARIES)]
    assert without_extras(tmp_path, modules, []) == ""


@pytest.mark.slow
def test_a_command_without_its_extra_says_so_in_a_line(tmp_path):
    (tmp_path / "drive.mcap").touch()
    told = without_extras(tmp_path, [], [*MISSED]).split("$ ")[1:]
    assert len(told) == len(MISSED)
    for lines, extra in zip(told, MISSED.values(), strict=True):
        command, *hints, line, end = lines.splitlines()
        assert [hint for hint in hints if not hint.startswith("hyperparameters of ")] == [], command
        assert f"pip install -c constraints.txt -e '.[{extra}]'" in line, command
        assert end == "exit 2", command


def test_every_extra_is_tried_alone():
    assert {*USES} == {*EXTRAS} - FOR_DEVELOPERS

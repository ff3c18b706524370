"""The house: imports run one way between the rooms, and no two modules need each other."""

import ast
import re
import subprocess
import sys
from graphlib import TopologicalSorter

import pytest

from tests.helpers.places import ROOT

PACKAGE = ROOT / "care_sim"
ROOMS = tuple(re.findall(r"^- `(\w+)/`:", (ROOT / "CONTRIBUTING.md").read_text(), re.M))
"""In the order in which they may import each other."""
MODULES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in PACKAGE.rglob("*.py")
}


def imported(tree):
    """The package's modules that a module imports, wherever in its text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("care_sim"):
            inner = {f"{node.module}.{alias.name}" for alias in node.names} & set(MODULES)
            yield from inner or {node.module} - {"care_sim"}
        elif isinstance(node, ast.Import):
            yield from {alias.name for alias in node.names} & set(MODULES) - {"care_sim"}


def room(module):
    return module.split(".")[1]


def test_the_map_names_every_room_and_the_root_holds_nothing_else():
    folders = {
        path.name for path in PACKAGE.iterdir() if path.is_dir() and path.name != "__pycache__"
    }
    assert folders == set(ROOMS)
    root = {"__init__.py", "__main__.py", "cli.py", "wrappers.py"}
    assert {path.name for path in PACKAGE.glob("*.py")} == root


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_imports_none_that_comes_after_it(name):
    allowed = ROOMS[: ROOMS.index(name) + 1]
    inside = {
        module: path for module, path in MODULES.items() if module.startswith(f"care_sim.{name}.")
    }
    outside = {
        (module, other)
        for module, path in inside.items()
        for other in imported(ast.parse(path.read_text()))
        if room(other) not in allowed
    }
    assert outside == set()


def test_no_module_needs_itself_by_way_of_others():
    packages = {module for module, path in MODULES.items() if path.name == "__init__.py"}
    needs = {
        module: set(imported(ast.parse(path.read_text()))) - packages
        for module, path in MODULES.items()
        if module not in packages
    }
    TopologicalSorter(needs).prepare()


def test_a_link_is_no_package_and_names_the_package():
    """The links at the top of a clone are for people."""
    done = subprocess.run(
        [sys.executable, "-c", "import envs.closed_loop"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == (
        "ImportError: envs is a link and no package: import care_sim.envs instead"
    )

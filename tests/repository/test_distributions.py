"""An sdist holds what its tests need, and the wheel that is made from it what the package reads:
all that git knows of them, and nothing besides.
"""

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile

import pytest

from tests.helpers.places import ROOT

pytestmark = pytest.mark.slow
BUILD = "import sys; from setuptools import build_meta; build_meta.build_{}(sys.argv[1])"
IN_A_CLONE_ALONE = re.compile(r"results/|\.ci/|\.gitignore$|\.pre-commit|MANIFEST\.in$")
MADE = re.compile(r"PKG-INFO$|setup\.cfg$|MANIFEST\.in$|care_sim\.egg-info/")
LEFT_BEHIND = (
    "care_sim/__pycache__/cli.cpython-311.pyc",
    "care_sim/core/__pycache__/grid_kernels.py311.1.nbc",
    "care_sim/policies/learned/mine.npz",
    "docs/__pycache__/agents_table.cpython-311.pyc",
    "runs/mine/rows.parquet",
    "tests/helpers/__pycache__/numba.py311.nbi",
)
"""Files that work leaves in a clone, and no distribution may hold."""


@pytest.fixture(scope="module")
def known():
    """The files that git knows, as it names them: those to be committed, too."""
    command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    try:
        told = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"no clone: {error}")
    return {name for name in told.stdout.split("\0") if name and (ROOT / name).exists()}


@pytest.fixture(scope="module")
def built(known, tmp_path_factory):
    """The sdist of these files, and the wheel of the sdist."""
    pytest.importorskip("setuptools", minversion=needed_setuptools())
    place = tmp_path_factory.mktemp("distributions")
    for name in known:
        (place / "clone" / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, place / "clone" / name, follow_symlinks=False)
    for name in LEFT_BEHIND:
        (place / "clone" / name).parent.mkdir(parents=True, exist_ok=True)
        (place / "clone" / name).touch()
    sdist = build("sdist", place / "clone", place)
    with tarfile.open(sdist) as archive:
        archive.extractall(place, filter="data")
    return sdist, build("wheel", place / sdist.name.removesuffix(".tar.gz"), place)


def needed_setuptools():
    """The version that the project asks for."""
    wanted = tomllib.loads((ROOT / "pyproject.toml").read_text())["build-system"]["requires"]
    (version,) = re.findall(r"setuptools>=([\d.]+)", " ".join(wanted))
    return version


def build(kind, source, out):
    """The distribution of a folder, made with the libraries that are installed."""
    before = {*out.iterdir()}
    command = [sys.executable, "-c", BUILD.format(kind), str(out)]
    done = subprocess.run(command, cwd=source, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    (made,) = {*out.iterdir()} - before
    return made


def test_the_sdist_holds_all_but_the_results(built, known):
    with tarfile.open(built[0]) as archive:
        held = {entry.name.partition("/")[2] for entry in archive if not entry.isdir()}
    folders = {name for name in known if (ROOT / name).is_dir()}
    assert {name for name in held if not MADE.match(name)} == {
        name for name in known - folders if not IN_A_CLONE_ALONE.match(name)
    }


def test_the_wheel_holds_the_package_and_nothing_else(built, known):
    with zipfile.ZipFile(built[1]) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert held == {name for name in known if name.startswith("care_sim/")}

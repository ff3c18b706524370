"""`make` says in one line what stops a set-up, or what it lacks, before it installs anything."""

import os
import shutil
import subprocess
import sys

import pytest

from tests.helpers.places import ROOT


def made(*arguments, **variables):
    # A make that runs the tests hands down its flags, and the variables of its command line.
    own = ("MAKE", "MFLAGS", "PYTHON", "VENV")
    surroundings = {name: value for name, value in os.environ.items() if not name.startswith(own)}
    return subprocess.run(
        [shutil.which("make"), *arguments],
        cwd=ROOT,
        env=surroundings | variables,
        capture_output=True,
        text=True,
        check=False,
    )


def official(folder, *arguments):
    """Without a Python to install with, and with no environment installed."""
    return made("official", f"OFFICIAL={folder / 'environment'}", "PYTHON=false", *arguments)


def setup(folder, *arguments, **variables):
    """Say how make would set up a missing environment."""
    return made("--dry-run", "setup", f"VENV={folder / 'environment'}", *arguments, **variables)


def says_it_is(version, folder):
    """A command that runs Python and says that it is of this version."""
    # A folder each: bytecode kept of a file is taken for that of one as long, a moment later.
    says = folder / f"says-{version}"
    says.mkdir(parents=True)
    (says / "sitecustomize.py").write_text(f"import sys; sys.version_info = {version}\n")
    command = folder / f"python{'.'.join(map(str, version))}"
    command.write_text(f'#!/bin/sh\nPYTHONPATH="{says}" exec "{sys.executable}" "$@"\n')
    command.chmod(0o755)
    return command


def complaint(done):
    """The one line that make ends with."""
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    return line


def test_a_python_without_wheels_is_refused(tmp_path):
    python = says_it_is((3, 14), tmp_path)
    told = complaint(setup(tmp_path, f"PYTHON={python}"))
    assert " *** CARE-Sim needs Python 3.11, 3.12 or 3.13 with venv " in told
    assert f"which PYTHON={python} is not; choose one by make setup PYTHON=PATH." in told


def test_the_newest_python_that_runs_is_taken(tmp_path):
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "sh").symlink_to(shutil.which("sh"))
    path = {"PATH": str(programs)}
    assert (
        "needs Python 3.11, 3.12 or 3.13 with venv (on Debian: apt-get install python3-venv);"
        in (complaint(setup(tmp_path, **path)))
    )
    for minor in (11, 12):
        python = says_it_is((3, minor), programs)
        assert setup(tmp_path, **path).stdout.startswith(f"python3.{minor} -m venv ")
    assert setup(tmp_path, f"PYTHON={python}").stdout.startswith(f"{python} -m venv --clear ")
    # pyenv has commands for versions that are not selected: they fail.
    broken = programs / "python3.13"
    broken.write_text("#!/bin/sh\nexit 127\n")
    broken.chmod(0o755)
    assert setup(tmp_path, **path).stdout.startswith("python3.12 -m venv ")


@pytest.fixture
def given(tmp_path):
    """A file of results and a root of nuScenes, the names of both with a space."""
    results, root = tmp_path / "my results.json", tmp_path / "my data"
    results.touch()
    (root / "v1.0-mini").mkdir(parents=True)
    return f"RESULTS={results}", f"DATA={root}"


def test_what_is_missing_is_said_in_one_line_before_anything_is_installed(tmp_path, given):
    results, data = given
    needs = "make official needs RESULTS=FILE and DATA=FOLDER"
    for arguments, message in (
        ((), needs),
        ((results,), needs),
        ((f"RESULTS={tmp_path}", data), f"RESULTS={tmp_path} is no file; it must be one of "),
        ((results, data), f"{data} has no folder v1.0-trainval; it must be the root of nuScenes"),
    ):
        assert f"*** {message}" in complaint(official(tmp_path, *arguments))


def test_with_everything_there_the_environment_is_installed(tmp_path, given):
    done = official(tmp_path, *given, "VERSION=v1.0-mini")
    assert done.stdout.startswith(f"false -m venv --clear {tmp_path / 'environment'}")


def test_the_slow_tests_are_tests():
    """A test of another name would be run by `make test` without a word."""
    for line in (ROOT / "tests" / "slow.txt").read_text().split():
        file, *_, name = line.split("::")
        assert f"def {name}(" in (ROOT / file).read_text(), line

"""`make` says in one line what stops a set-up, or what it lacks, before it installs anything."""

import os
import subprocess
import sys

import pytest

from tests.helpers.places import ROOT


def made(*arguments, **variables):
    surroundings = {
        name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))
    }
    return subprocess.run(
        ["make", *arguments],
        cwd=ROOT,
        env=surroundings | variables,
        capture_output=True,
        text=True,
        check=False,
    )


def official(folder, *arguments):
    """Without a Python to install with, and with no environment installed."""
    return made("official", f"OFFICIAL={folder / 'environment'}", "PYTHON=false", *arguments)


def setup(folder, python, *arguments, version=(3, 11)):
    """What would be done with a Python that says it is of this version."""
    # A folder each: bytecode kept of a file is taken for that of one as long, a moment later.
    says = folder / f"says-{version}"
    says.mkdir(exist_ok=True)
    (says / "sitecustomize.py").write_text(f"import sys; sys.version_info = {version}\n")
    given = ("--dry-run", "setup", f"VENV={folder / 'environment'}", f"PYTHON={python}")
    return made(*given, *arguments, PYTHONPATH=str(says))


def complaint(done):
    """The one line that make ends with."""
    assert (done.returncode, done.stdout) == (2, "")
    (line,) = done.stderr.splitlines()
    return line


def test_a_python_that_does_not_fit_is_told(tmp_path):
    missing = complaint(setup(tmp_path, "python3.11-of-nobody"))
    assert "*** PYTHON=python3.11-of-nobody must be a Python of at least 3.11" in missing
    assert missing.endswith("another one: make setup PYTHON=NAME.  Stop.")
    assert " must be a Python of at least 3.11" in complaint(
        setup(tmp_path, sys.executable, version=(3, 10))
    )


def test_a_later_python_needs_a_compiler_and_3_11_none(tmp_path):
    none = "CXX=compiler-of-nobody"
    assert "pip has to build PyBullet for it: that needs a C++ compiler" in complaint(
        setup(tmp_path, sys.executable, none, version=(3, 12))
    )
    for version, compiler in {(3, 12): "CXX=sh", (3, 11): none}.items():
        done = setup(tmp_path, sys.executable, compiler, version=version)
        assert done.stdout.startswith(f"{sys.executable} -m venv --clear {tmp_path}")


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
    wrong = {
        (): needs,
        (results,): needs,
        (data,): needs,
        (
            f"RESULTS={tmp_path}",
            data,
        ): f"RESULTS={tmp_path} is no file; it must be one of care-sim export",
        (
            results,
            data,
        ): f"{data} has no folder v1.0-trainval; it must be the root of nuScenes, "
        "VERSION the folder of "
        "its tables",
    }
    for arguments, message in wrong.items():
        done = official(tmp_path, *arguments)
        assert complaint(done).endswith(f"*** {message}.  Stop.")


def test_with_everything_there_the_environment_is_installed(tmp_path, given):
    done = official(tmp_path, *given, "VERSION=v1.0-mini")
    assert done.stdout.startswith(f"false -m venv --clear {tmp_path / 'environment'}")

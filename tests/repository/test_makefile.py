"""`make official` checks what it is given before it installs anything."""

import os
import subprocess

import pytest

from tests.helpers.places import ROOT


def official(folder, *arguments):
    """Without a Python to install with, and with no environment installed."""
    command = ["make", "official", f"OFFICIAL={folder / 'environment'}", "PYTHON=false", *arguments]
    surroundings = {
        name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))
    }
    return subprocess.run(
        command, cwd=ROOT, env=surroundings, capture_output=True, text=True, check=False
    )


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
        assert (done.returncode, done.stdout) == (2, "")
        (line,) = done.stderr.splitlines()
        assert line.endswith(f"*** {message}.  Stop.")


def test_with_everything_there_the_environment_is_installed(tmp_path, given):
    done = official(tmp_path, *given, "VERSION=v1.0-mini")
    assert done.stdout.startswith(f"false -m venv --clear {tmp_path / 'environment'}")

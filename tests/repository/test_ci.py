"""The steps of CI: a browser where none is, all tests with Python 3.11, some with later ones."""

import shutil
import subprocess

import pytest

from tests.helpers.places import ROOT


@pytest.fixture
def clone(tmp_path):
    """A folder with CI's script, and programs that write down how they are called."""
    (tmp_path / ".ci").mkdir()
    shutil.copy(ROOT / ".ci" / "run", tmp_path / ".ci" / "run")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "dirname").symlink_to(shutil.which("dirname"))
    for name in ("apt-get", "make"):
        program(tmp_path / "bin" / name, f'echo "{name} $* $DEBIAN_FRONTEND" >>"{tmp_path}/told"')
    for folder in (".venv", "build/python3.12", "build/python3.13"):
        command = f'echo "{folder} $*" >>"{tmp_path}/told"'
        program(tmp_path / folder / "bin" / "care-sim", command)
    return tmp_path


def program(path, line):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{line}\n")
    path.chmod(0o755)


def ran(clone):
    """The output of CI's script, and the programs that it called."""
    done = subprocess.run(
        [shutil.which("bash"), str(clone / ".ci" / "run")],
        env={"PATH": str(clone / "bin"), "HOME": str(clone)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, (clone / "told").read_text().splitlines()


def test_the_browser_is_installed_without_a_question_before_the_tests(clone):
    _, (update, install, *made, certified) = ran(clone)
    assert update == "apt-get update -qq noninteractive"
    assert install.startswith("apt-get install")
    assert install.endswith("chromium noninteractive")
    assert [line.split()[1] for line in made] == [
        "test",
        "test-long",
        "test-speed",
        "test-official",
        "lint",
    ]
    assert all(" PYTHON=python3.11 " in line for line in made)
    assert certified == ".venv certify"


def test_later_pythons_that_run_are_tested_and_the_others_named(clone):
    # A command of pyenv for a version that is not selected.
    program(clone / "bin" / "python3.13", "exit 127")
    python = clone / ".pyenv" / "versions" / "3.13.0" / "bin" / "python"
    program(python, "exit 0")
    out, told = ran(clone)
    assert out == "Python 3.12 is not here: nothing was tested with it\n"
    smoke = f"make smoke PYTHON={python} VENV=build/python3.13 noninteractive"
    assert told[-2:] == [smoke, "build/python3.13 certify"]


def test_the_last_python_alone_plays_the_published_episodes(clone):
    for version in ("3.12", "3.13"):
        program(clone / "bin" / f"python{version}", "exit 0")
    _, told = ran(clone)
    certified = [line for line in told if line.endswith(" certify")]
    assert certified == ["build/python3.13 certify"]

"""The steps of the Dockerfile, in a virtual environment instead of a container: root installs, and
another user plays.
"""

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from tests.helpers.places import ROOT

pytestmark = pytest.mark.slow
USER = 54321
STEPS = (ROOT / "Dockerfile").read_text().splitlines()


def words(instruction):
    """The words of each line with this instruction."""
    return [shlex.split(line)[1:] for line in STEPS if line.startswith(instruction + " ")]


@pytest.fixture(scope="module")
def place():
    """A folder with what the image holds, below `build` and `venv`."""
    if os.geteuid():
        pytest.skip("only root may take another user's number")
    # A Python of pyenv lies in a home folder, which is closed to others.
    python = f"/usr/bin/python{sys.version_info.major}.{sys.version_info.minor}"
    if not Path(python).exists():
        pytest.skip(f"no {python}")
    # pytest keeps its own folders to their owner.
    with tempfile.TemporaryDirectory() as name:
        place = Path(name)
        place.chmod(0o755)
        install(place, python)
        yield place


def install(place, python):
    """Do as the Dockerfile says."""
    (place / "build").mkdir()
    for *names, target in words("COPY"):
        for name in names:
            copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
            copy(ROOT / name, place / "build" / target / (name if target == "./" else ""))
    subprocess.run([python, "-m", "venv", place / "venv"], check=True)
    for program, *arguments in words("RUN"):
        if program == "pip":
            command = [place / "venv" / "bin" / program, *arguments]
            # Without bytecode of the libraries it takes half as long.
            quick = os.environ | {"PIP_NO_COMPILE": "1"}
            subprocess.run(command, cwd=place / "build", env=quick, check=True)


def play(place, home):
    """Play an episode as the user, whose own folder is the working directory."""
    work = place / f"work-{'home' if home is None else 'homeless'}"
    for folder in (work, work / "tmp"):
        folder.mkdir()
        os.chown(folder, USER, USER)
    ((entry_point,),) = words("ENTRYPOINT")
    done = subprocess.run(
        [
            place / "venv" / "bin" / entry_point.strip("[]"),
            *("run", "dartout", "--picture", "first.png"),
        ],
        cwd=work,
        env={"PATH": os.defpath, "HOME": str(home or work), "TMPDIR": str(work / "tmp")},
        user=USER,
        group=USER,
        extra_groups=[],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (work / "first.png").stat().st_size > 10_000
    return work


def kernels(folder: Path):
    """The compiled functions that are kept below a folder."""
    return [*folder.rglob("*.nbi")]


def test_another_user_plays_and_keeps_compiled_code_at_home_or_among_temporary_files(place):
    at_home = play(place, None)
    assert kernels(at_home / ".cache")
    homeless = play(place, "/")
    assert kernels(homeless / "tmp" / f"care-sim-{USER}")
    assert not kernels(place / "venv")

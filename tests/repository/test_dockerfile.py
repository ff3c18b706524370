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


def test_another_user_plays_without_a_home_folder_and_without_writing_where_root_installed(place):
    work = place / "work"
    for folder in (work, work / "tmp"):
        folder.mkdir()
        os.chown(folder, USER, USER)
    ((entry_point,),) = words("ENTRYPOINT")
    program = place / "venv" / "bin" / entry_point.strip("[]")
    done = subprocess.run(
        [program, "run", "dartout", "--picture", "first.png"],
        cwd=work,
        env={"PATH": os.defpath, "HOME": "/", "TMPDIR": str(work / "tmp")},
        user=USER,
        group=USER,
        extra_groups=[],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (work / "first.png").stat().st_size > 10_000
    # Compiled code is kept among the temporary files.
    assert [*(work / "tmp" / f"care-sim-{USER}").rglob("*.nbi")]
    assert not [*(place / "venv").rglob("*.nbi")]

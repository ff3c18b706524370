"""Users without a home folder, or with one that cannot be written, whose number may be nobody's."""

import os
import subprocess
import sys

import pytest

NOBODYS = 54321
SETTLED = """
import care_sim, matplotlib, os
print(os.environ["HOME"], os.environ["XDG_CACHE_HOME"], matplotlib.get_cachedir(), sep="\\n")
"""


def as_nobody(program, folder, **environment):
    """What a program prints under a user number without a name, in a folder of its own."""
    if os.geteuid():
        pytest.skip("only root may take another user's number")
    folder.chmod(0o777)
    for parent in folder.parents:
        if "pytest-of-" in str(parent):  # pytest keeps them to their owner
            parent.chmod(0o755)
    # The interpreter of a virtual environment may lie in a home folder that is closed to others.
    version = f"python{sys.version_info.major}.{sys.version_info.minor}"
    for interpreter in (sys.executable, f"/usr/bin/{version}"):
        try:
            return subprocess.run(
                [interpreter, "-c", program],
                cwd=folder,
                env={"PATH": os.defpath, "TMPDIR": str(folder / "tmp")}
                | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
                | environment,
                user=NOBODYS,
                group=NOBODYS,
                extra_groups=[],
                capture_output=True,
                text=True,
                check=False,
            )
        except (PermissionError, FileNotFoundError):
            continue
    pytest.skip("no interpreter that another user may run")


@pytest.mark.parametrize("environment", [{}, {"HOME": "/"}, {"HOME": "/nowhere"}])
def test_caches_go_to_a_private_folder(environment, tmp_path):
    work = tmp_path / "work"
    (work / "tmp").mkdir(parents=True)
    (work / "tmp").chmod(0o777)
    ended = as_nobody(SETTLED, work, **environment)
    private = work / "tmp" / f"care-sim-{NOBODYS}"
    assert (ended.returncode, ended.stderr) == (0, "")
    home = environment.get("HOME", str(private))
    assert ended.stdout.split() == [home, str(private), str(private / "matplotlib")]
    assert [path.name for path in work.iterdir()] == ["tmp"]
    assert private.stat().st_mode & 0o777 == 0o700


def test_the_command_says_where_caches_go_and_a_library_is_silent(tmp_path):
    (tmp_path / "tmp").mkdir()
    (tmp_path / "tmp").chmod(0o777)
    ended = as_nobody("import sys; sys.argv[0] = 'care-sim'; import care_sim.base.limits", tmp_path)
    private = tmp_path / "tmp" / f"care-sim-{NOBODYS}"
    line = f"care-sim: no home folder to write to: caches go to {private}\n"
    assert (ended.returncode, ended.stderr) == (0, line)


def test_a_folder_that_somebody_else_has_made_is_not_trusted(tmp_path):
    work = tmp_path / "work"
    (work / "tmp" / f"care-sim-{NOBODYS}").mkdir(parents=True, mode=0o777)
    (work / "tmp").chmod(0o777)
    ended = as_nobody(SETTLED, work)
    assert ended.returncode == 0
    assert not [*(work / "tmp" / f"care-sim-{NOBODYS}").iterdir()]


def test_a_home_folder_is_left_as_it_is():
    ended = subprocess.run(
        [sys.executable, "-c", "import care_sim.base.limits, os; print(os.environ.get('HOME'))"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert (ended.stdout, ended.stderr) == (f"{os.environ.get('HOME')}\n", "")

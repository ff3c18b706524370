"""Limits of memory, processes and cores, and users without a home folder."""

import errno
import os
import re
import resource
import shutil
import subprocess
import sys

import pytest

from care_sim.base import limits
from care_sim.base.limits import LimitReached, causes, limit_in, usable_cores
from care_sim.study.executors import processes
from tests.torture.processes import ANOTHER_USER, entry_point


def ended(arguments, prefix=(), limited=None):
    """Exit code and stderr of the command."""
    done = subprocess.run(
        [*prefix, sys.executable, "-c", entry_point(), *arguments],
        capture_output=True,
        text=True,
        preexec_fn=limited,
    )
    return done.returncode, done.stderr


@pytest.mark.parametrize("name", ["AS", "DATA"])
@pytest.mark.parametrize("size", [200_000_000, 500_000_000, 1_500_000_000])
def test_too_little_memory(name, size):
    number = getattr(resource, f"RLIMIT_{name}")
    code, err = ended(
        ["list", "policies"], limited=lambda: resource.setrlimit(number, (size, size))
    )
    assert code == limits.FAILED
    command = {"AS": "ulimit -v", "DATA": "ulimit -d"}[name]
    (line,) = err.splitlines()
    assert line.startswith("care-sim: ")
    assert f"raise the limit ({command})" in line


def test_many_cores_need_less_with_one_thread_each(monkeypatch):
    monkeypatch.setattr(limits, "CORES", 64)
    monkeypatch.setattr(limits.resource, "getrlimit", lambda _: (8_000_000_000, -1))
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    with pytest.raises(LimitReached, match=r"needs 9.40 GB: raise .*, or set OMP_NUM_THREADS=1$"):
        limits.check_memory()
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    limits.check_memory()


def test_too_few_files():
    code, err = ended(
        ["list", "policies"], limited=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (9, 9))
    )
    assert code == limits.FAILED
    assert re.fullmatch(
        r"care-sim: \d files can be opened, and care-sim needs 16: raise the limit \(ulimit -n\)\n",
        err,
    )


@pytest.mark.skipif(os.geteuid() != 0 or not shutil.which("setpriv"), reason="needs another user")
def test_too_few_processes():
    code, err = ended(
        ["list", "policies"],
        ANOTHER_USER,
        lambda: resource.setrlimit(resource.RLIMIT_NPROC, (1, 1)),
    )
    assert code == limits.FAILED
    (line,) = err.splitlines()
    assert line.startswith("care-sim: 0 processes or threads can be added, and care-sim needs ")
    assert line.endswith("raise the limit (ulimit -u)")


def test_workers_that_cannot_be_started(monkeypatch):
    starts, usual = [], limits.threading.Thread.start

    def start(thread):
        if len(starts) == 9:
            raise RuntimeError("can't start new thread")
        starts.append(thread)
        usual(thread)

    monkeypatch.setattr(limits.threading.Thread, "start", start)
    with pytest.raises(LimitReached, match=r"^9 processes .* needs 24: .* or lower --workers$"):
        processes(2)
    assert not any(thread.is_alive() for thread in starts)


@pytest.mark.parametrize(
    ("error", "named"),
    [
        (MemoryError(), "ulimit -v"),
        (OSError(errno.ENOMEM, "Cannot allocate memory"), "ulimit -v"),
        (ImportError("x.so: failed to map segment from shared object"), "ulimit -v"),
        (BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable"), "ulimit -u"),
        (RuntimeError("can't start new thread"), "ulimit -u"),
        (OSError(errno.EMFILE, "Too many open files"), "ulimit -n"),
        (OSError(errno.ENOSPC, "No space left on device"), ""),
        (ImportError("No module named x"), ""),
        (ValueError("memory"), ""),
    ],
)
def test_an_error_names_its_limit(error, named):
    other = ValueError("behind")
    other.__cause__ = error
    for told in (limit_in(error), limit_in(other)):
        assert named in told
        assert bool(told) == bool(named)


def test_a_circle_of_errors_has_an_end():
    first, second = ValueError("first"), OSError(errno.ENOSPC, "No space left on device")
    first.__cause__, second.__cause__ = second, first
    assert limit_in(first) == ""
    assert [*causes(first)] == [first, second]


def test_an_error_raised_from_none_hides_what_was_handled():
    error = ValueError("behind")
    error.__context__ = MemoryError()
    assert "ulimit -v" in limit_in(error)
    error.__suppress_context__ = True
    assert limit_in(error) == ""


ALL = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()


def make_groups(folder, lines, files):
    """Control groups as the kernel shows them: the lines of a process, and files by path."""
    for path, text in files.items():
        place = folder / "mount" / path
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(f"{text}\n")
    (folder / "own").write_text("".join(f"{line}\n" for line in lines))
    return folder / "mount", folder / "own"


@pytest.mark.parametrize(
    ("lines", "files", "cores"),
    [
        (["0::/"], {"cpu.max": "100000 100000"}, 1),
        (["0::/"], {"cpu.max": "20000 100000"}, 1),
        (["0::/"], {"cpu.max": "1500000 1000000"}, 2),
        (["0::/"], {"cpu.max": "max 100000"}, 4),
        (["0::/job/step"], {"job/cpu.max": "300000 100000", "job/step/cpu.max": "max 100000"}, 3),
        (["0::/job/step"], {"job/cpu.max": "max 100000", "job/step/cpu.max": "300000 100000"}, 3),
        (["0::/of/the/host"], {"cpu.max": "200000 100000"}, 2),
        (["0::/"], {"cpu.max": "nonsense"}, 4),
        (["0::/"], {}, 4),
        ([], {}, 4),
    ],
)
def test_a_quota_limits_the_cores(tmp_path, monkeypatch, lines, files, cores):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _process: {0, 1, 2, 3}, raising=False)
    assert usable_cores(*make_groups(tmp_path, lines, files)) == cores


def test_without_control_groups_the_affinity_counts(tmp_path):
    assert usable_cores(tmp_path / "none", tmp_path / "neither") == ALL


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="needs Linux")
def test_workers_and_threads_keep_to_the_affinity():
    code = (
        "import os; os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
        "import gymnasium, care_sim\n"
        "from care_sim.commands.options.studies import Sweep\n"
        "import care_sim.envs.vector.env as vector\n"
        "from care_sim.commands.options.results import Certify\n"
        "from care_sim.study.provenance import machine\n"
        "print(Sweep().workers, Certify().workers, vector.CORES, machine()['cores'])\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["1"] * 4


NOBODYS = 54321
SETTLED = """
import care_sim, matplotlib, os
print(os.environ["HOME"], os.environ["XDG_CACHE_HOME"], matplotlib.get_cachedir(), sep="\\n")
"""


def as_nobody(program, folder, **environment):
    """The output of a program under a user number without a name, in a folder of its own."""
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


@pytest.mark.parametrize("folder", ["x" * 5000, "/dev/null/x", "", "new", "."])
def test_a_folder_for_matplotlib_that_cannot_be_written_is_ignored(folder, tmp_path):
    program = (
        "import sys; sys.argv[0] = 'care-sim'; import care_sim.base.limits, matplotlib.font_manager"
    )
    ended = subprocess.run(
        [sys.executable, "-c", program],
        cwd=tmp_path,
        env=os.environ | {"MPLCONFIGDIR": folder},
        capture_output=True,
        text=True,
        check=True,
    )
    is_told = folder not in ("", "new", ".")
    assert ended.stderr == is_told * "care-sim: MPLCONFIGDIR cannot be written, and is ignored\n"


def test_a_home_folder_is_left_as_it_is():
    ended = subprocess.run(
        [sys.executable, "-c", "import care_sim.base.limits, os; print(os.environ.get('HOME'))"],
        capture_output=True,
        text=True,
        check=True,
    )
    assert (ended.stdout, ended.stderr) == (f"{os.environ.get('HOME')}\n", "")

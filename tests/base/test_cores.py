import os
import subprocess
import sys

import pytest

from care_sim.base.limits import usable_cores

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
        (
            ["2:cpuacct,cpu:/job", "1:memory:/", "0::/"],
            {"cpu/job/cpu.cfs_quota_us": "200000", "cpu/job/cpu.cfs_period_us": "100000"},
            2,
        ),
        (
            ["1:cpu:/job"],
            {"cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"},
            4,
        ),
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

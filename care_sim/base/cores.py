"""The processor cores that this process may use: a batch system or a container may allow fewer than
the machine has.
"""

import os
from collections.abc import Iterator
from contextlib import suppress
from math import ceil
from pathlib import Path


def usable_cores(
    groups: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")
) -> int:
    """Count the cores that the affinity and the control groups of Linux leave to this process.

    `groups` is where control groups of version 1 or 2 are mounted. `own` lists those of the
    process.
    """
    affinity = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return max(1, min([affinity or 1, *(ceil(quota) for quota in _quotas(groups, own))]))


def _quotas(groups: Path, own: Path) -> Iterator[float]:
    """Yield the cores that each control group of the process allows, and each group above."""
    lines = own.read_text().splitlines() if own.exists() else []
    for line in lines:
        _, controllers, path = line.split(":", 2)
        if controllers and "cpu" not in controllers.split(","):
            continue
        mount = groups / "cpu" if controllers else groups
        # In a container the path may be the host's, of which only the mount's root is there.
        for folder in (mount, *(mount / part for part in _ancestry(path.strip("/")))):
            with suppress(OSError, ValueError, ZeroDivisionError):
                quota, period = _quota(folder, version=1 if controllers else 2)
                if quota > 0:
                    yield quota / period


def _ancestry(path: str) -> Iterator[str]:
    parts = path.split("/")
    return ("/".join(parts[:count]) for count in range(1, len(parts) + 1))


def _quota(folder: Path, version: int) -> tuple[int, int]:
    """Microseconds of processor time and the period in which they are allowed.

    Raises ValueError for version 2's "max", which allows all. Version 1 says -1.
    """
    if version == 2:
        quota, period = (folder / "cpu.max").read_text().split()
    else:
        quota = (folder / "cpu.cfs_quota_us").read_text()
        period = (folder / "cpu.cfs_period_us").read_text()
    return int(quota), int(period)


CORES = usable_cores()
"""Cores that this process may use, as counted when the package was imported."""
MOST_WORKERS = 1024
"""Most worker processes; each takes about 100 MB."""
WORKERS = min(CORES, MOST_WORKERS)
"""Workers unless another number is asked for."""

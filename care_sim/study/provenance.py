"""Where results come from: the code, the libraries and the machine that made them."""

import hashlib
import os
import platform
from collections.abc import Iterable
from functools import cache, lru_cache
from importlib import metadata
from importlib.metadata import EntryPoint
from importlib.util import find_spec
from pathlib import Path
from uuid import uuid4

import care_sim
from care_sim.perception.registry import BUILT_IN as BUILT_IN_DETECTORS
from care_sim.perception.registry import entries as detector_entries
from care_sim.policies import BUILT_IN
from care_sim.policies.installed import entries

LIBRARIES = ("gymnasium", "highway-env", "matplotlib", "numba", "numpy", "pyarrow", "pybullet", "scipy")
EXTRAS = ("mujoco-core", "open3d", "open3d-cpu", "panda-gym", "torch")
"""Libraries of detectors, policies and measurements that may be there."""


SESSION = uuid4().hex
"""Names this run of the program; no other run has it."""


def code_digest() -> str:
    """Hash of the package's sources and weights, so that no row of an edited program passes for a new one."""
    root = Path(care_sim.__file__).parent
    return _combined(_content_digest(root, pattern) for pattern in ("*.py", "*.npz"))


def policy_digest(policy: str) -> str | None:
    """Hash of the files of the package that an installed policy comes from, or of its module when it lies in
    no package; empty for a built-in policy, None where there are no files to read.
    """
    return "" if policy in BUILT_IN else _package_digest(entries()[policy])


def detector_digest(detector: str) -> str | None:
    """The same of a detector."""
    return "" if detector in BUILT_IN_DETECTORS else _package_digest(detector_entries()[detector])


def file_digest(path: Path, pattern: str = "*") -> str:
    """Hash of the content of a file, or of the files below a folder and their names; empty where there is neither."""
    found = [path] if path.is_file() else [f for f in path.rglob(pattern) if f.is_file() and f.suffix != ".pyc"]
    named = ((file.relative_to(path), file, file.stat()) for file in sorted(found))
    hashes = [f"{name} {_hashed(file, stat.st_size, stat.st_mtime_ns)}" for name, file, stat in named]
    return _combined(hashes) if hashes else ""


@lru_cache(maxsize=10_000)
def _hashed(path: Path, _size: int, _changed: int) -> str:
    """Hash of a file that has not changed since it was last hashed."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def _combined(digests: Iterable[str]) -> str:
    return hashlib.sha256(" ".join(digests).encode()).hexdigest()[:16]


def data_digest(paths: Iterable[Path]) -> str:
    """Hash of the content of several files."""
    return _combined(map(file_digest, paths))


def _package_digest(entry: EntryPoint) -> str | None:
    spec = find_spec(entry.module.partition(".")[0])
    if spec is None:
        return None
    roots = [Path(place) for place in spec.submodule_search_locations or [spec.origin or ""]]
    return "".join(map(_content_digest, roots)) if all(root.name and root.exists() for root in roots) else None


@cache
def _content_digest(root: Path, pattern: str = "*") -> str:
    """The hash of code, once a process, which has it loaded."""
    return file_digest(root, pattern)


def versions() -> dict[str, str]:
    """Versions of Python, the package, its code and the libraries that decide an episode."""
    libraries = {name: metadata.version(name) for name in (*LIBRARIES, *filter(_is_installed, EXTRAS))}
    return {
        "python": platform.python_version(),
        "care-sim": care_sim.__version__,
        "code": code_digest(),
        **libraries,
    }


def _is_installed(library: str) -> bool:
    return any(metadata.distributions(name=library))


def machine() -> dict[str, str | int]:
    """What ran it: system, processor and cores; no host name."""
    return {
        "system": f"{platform.system()} {platform.release()}",
        "processor": _processor(),
        "cores": os.cpu_count() or 1,
    }


def _processor() -> str:
    table = Path("/proc/cpuinfo")
    lines = table.read_text().splitlines() if table.exists() else []
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())

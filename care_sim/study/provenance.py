"""Where results come from: the code, the libraries and the machine that made them."""

import hashlib
import os
import platform
from collections.abc import Iterable
from functools import cache, lru_cache
from importlib import metadata
from importlib.metadata import EntryPoint
from itertools import islice
from pathlib import Path
from uuid import uuid4

import care_sim
from care_sim.perception.registry import BUILT_IN as BUILT_IN_DETECTORS
from care_sim.perception.registry import entries as detector_entries
from care_sim.policies import BUILT_IN
from care_sim.policies.installed import entries
from care_sim.study import belongings

LIBRARIES = ("gymnasium", "highway-env", "matplotlib", "numba", "numpy", "pyarrow", "pybullet", "scipy")
EXTRAS = ("mujoco-core", "open3d", "open3d-cpu", "panda-gym", "torch")
"""Libraries of detectors, policies and measurements that may be there."""

SHIPPED = Path(care_sim.__file__).parent / "policies" / "shipped"
"""Where the weights lie that come with the package."""
CODE = (".py", ".so", ".pyd")
"""Endings of what a process loads once."""
MOST_FILES = 10_000
"""Files of a folder whose content is hashed: a second of work."""

SESSION = uuid4().hex
"""Names this run of the program; no other run has it."""


def code_digest() -> str:
    """Hash of the package's sources and weights, so that no row of an edited program passes for a new one."""
    return _combined([_sources_digest(Path(care_sim.__file__).parent), str(file_digest(SHIPPED))])


def policy_digest(policy: str) -> str | None:
    """Hash of the files that decide what an installed policy does: those of its distribution and package, and those
    that its defaults, constants and code name (`care_sim.study.belongings`). Empty for a built-in policy, None where
    there are no files to read.
    """
    return "" if policy in BUILT_IN else _entry_digest(entries()[policy])


def detector_digest(detector: str) -> str | None:
    """The same of a detector."""
    return "" if detector in BUILT_IN_DETECTORS else _entry_digest(detector_entries()[detector])


def file_digest(path: Path) -> str | None:
    """Hash of the content of a file, or of the files below a folder and their names; empty where there is neither,
    None of a folder with more than `MOST_FILES`.
    """
    found = [path] if path.is_file() else [*islice(belongings.files_below(path), MOST_FILES + 1)]
    if len(found) > MOST_FILES:
        return None
    hashes = [f"{file.relative_to(path)} {_content(file)}" for file in sorted(found) if file.suffix != ".pyc"]
    return _combined(hashes) if hashes else ""


def _content(path: Path) -> str:
    """Hash of a file as it is now."""
    stat = path.stat()
    return _hashed(path, stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)


@lru_cache(maxsize=10_000)
def _hashed(path: Path, *_identity: int) -> str:
    """Hash of a file that has not changed since it was last hashed."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def _combined(digests: Iterable[str]) -> str:
    return hashlib.sha256(" ".join(digests).encode()).hexdigest()[:16]


def data_digest(paths: Iterable[Path]) -> str:
    """Hash of the content of several files."""
    return _combined(str(file_digest(path)) for path in paths)


def _entry_digest(entry: EntryPoint) -> str | None:
    files = belongings.shipped(entry)
    if files is None:
        return None
    shipped = [f"{name} {_loaded(file) if file.suffix in CODE else _content(file)}" for name, file in files.items()]
    further = belongings.named(entry) | belongings.written(files.values())
    named = [(name, file_digest(path)) for name, path in further.items()]
    if any(digest is None for _, digest in named):
        return None
    return _combined([*sorted(shipped), *(f"{name} {digest}" for name, digest in named)])


@cache
def _loaded(path: Path) -> str:
    """The hash of a file of code, once a process, which has it loaded."""
    return _content(path)


@cache
def _sources_digest(root: Path) -> str:
    """The hash of all code below a folder, once a process, which has it loaded."""
    return _combined(f"{file.relative_to(root)} {_content(file)}" for file in sorted(root.rglob("*.py")))


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

"""Provenance of results: code, libraries and machine."""

import json
import platform
from functools import cache, lru_cache
from importlib import metadata
from importlib.metadata import EntryPoint
from pathlib import Path
from uuid import uuid4

import care_sim
from care_sim.base.digests import (
    CODE,
    combined_digest,
    content_digest,
    entry_files,
    file_digest,
    paths_in,
)
from care_sim.base.errors import InvalidInput, MissingExtra
from care_sim.base.limits import CORES
from care_sim.perception.detectors import DETECTORS, files_read
from care_sim.policies import POLICIES
from care_sim.policies.isolation import are_isolated, policy_process
from care_sim.scenarios import PLUGINS as SCENARIO_PLUGINS
from care_sim.sources.scenes import Source
from care_sim.study.rows.parameters import Parameters

_LIBRARIES = (
    "gymnasium",
    "highway-env",
    "matplotlib",
    "numba",
    "numpy",
    "pyarrow",
    "pybullet",
    "scipy",
)
_FORKS = {"pybullet": "pybullet-arm64"}
"""The fork has the same module, in wheels for Python 3.12 and later. Rows keep the first name."""
_EXTRAS = ("mujoco-core", "open3d", "open3d-cpu", "panda-gym", "torch")
"""Libraries of detectors, policies and measurements, recorded where they are installed."""

SHIPPED = Path(care_sim.__file__).parent / "policies" / "learned" / "shipped"
"""Folders of the shipped weights."""
SESSION = uuid4().hex
"""Unique name of this run of the program."""


def code_digest() -> str:
    """Hash of the package's sources and weights, so that no row of an edited program passes for a
    new one.
    """
    return combined_digest(
        [_sources_digest(Path(care_sim.__file__).parent), str(file_digest(SHIPPED))]
    )


def policy_digest(policy: str) -> str | None:
    """Hash of the version and the files that decide what an installed policy does
    (`care_sim.base.digests`). Empty for a built-in policy, None where there are no files to
    read.
    """
    if policy in POLICIES.built_in:
        return ""
    if not are_isolated():
        return _entry_digest(POLICIES.entry(policy))
    # The hash covers loaded code, and isolated code is loaded only in its process.
    process = policy_process(policy)
    digest: str | None = process.read(json.loads, process.ask(policy_digest, policy))
    return digest


def detector_digest(detector: str) -> str | None:
    """The same as `policy_digest`, of a detector."""
    return "" if detector in DETECTORS.built_in else _entry_digest(DETECTORS.entry(detector))


def detector_files(detector: str, parameters: Parameters) -> list[str | None]:
    """Hash the files that a detector declares, besides those in its parameters."""
    named = [file_digest(path) for _, value in parameters for path in paths_in(value)]
    return [*map(file_digest, _files_read(detector, parameters, tuple(named)))]


# The detector is made to list its files: once, not per play.
@lru_cache
def _files_read(
    detector: str, parameters: Parameters, _named: tuple[str | None, ...]
) -> tuple[Path, ...]:
    try:
        return files_read(detector, dict(parameters))
    # A detector that cannot be made here plays nothing.
    except (InvalidInput, MissingExtra):
        return ()


def scenario_digest(scenario: str) -> str | None:
    """The same as `policy_digest`, of a scenario."""
    plugins = SCENARIO_PLUGINS
    return "" if scenario in plugins.built_in else _entry_digest(plugins.entry(scenario))


def source_digests(source: Source) -> list[str | None]:
    """Return the hash of a source, its options, and the files in its options. Nothing for a
    built-in source, whose rows hold everything.
    """
    # Imported here because the kinds of recordings load SciPy and PyArrow.
    from care_sim.sources.installed import SOURCES, Installed

    if not isinstance(source, Installed):
        return []
    named = [file_digest(path) for _, value in source.options for path in paths_in(value)]
    # The place of a file does not matter.
    plain = [pair for pair in source.options if not isinstance(pair[1], Path)]
    return [_entry_digest(SOURCES.entry(source.name)), repr(plain), *named]


def _entry_digest(entry: EntryPoint) -> str | None:
    files = entry_files(entry)
    if files is None:
        return None
    digests = [entry.dist.version if entry.dist else ""]
    for name, path in sorted(files.items()):
        # Edits of loaded code have no effect in this process. Weights and tables are read again for
        # every episode, and hashed again.
        digest = _loaded(path) if path.suffix in CODE else file_digest(path)
        # A folder with too many files to read has no reliable hash.
        if digest is None:
            return None
        digests.append(f"{name} {digest}")
    return combined_digest(digests)


@cache
def _loaded(path: Path) -> str:
    """The hash of a file of code, computed once per process, which has the file loaded."""
    return content_digest(path)


@cache
def _sources_digest(root: Path) -> str:
    """The hash of all code below a folder, computed once per process, which has it loaded."""
    return combined_digest(
        f"{file.relative_to(root)} {content_digest(file)}" for file in sorted(root.rglob("*.py"))
    )


def versions() -> dict[str, str]:
    """Versions of Python, the package, its code and the libraries that decide an episode."""
    return {
        "python": platform.python_version(),
        "care-sim": care_sim.__version__,
        "code": code_digest(),
        **package_versions(*_LIBRARIES, *filter(_is_installed, _EXTRAS)),
    }


def package_versions(*packages: str) -> dict[str, str]:
    """The versions of installed packages, or of the forks in their place."""
    return {
        package: metadata.version(
            package if _is_installed(package) else _FORKS.get(package, package)
        )
        for package in packages
    }


def _is_installed(library: str) -> bool:
    return any(metadata.distributions(name=library))


def machine() -> dict[str, str | int]:
    """Return the machine that ran it: system, processor and cores; no host name."""
    return {
        "system": f"{platform.system()} {platform.release()}",
        "processor": _processor(),
        "cores": CORES,
    }


def machine_line() -> str:
    """Return the machine in a few words, for the cards of weights."""
    here = machine()
    return f"{here['processor']}, {here['cores']} cores, {here['system']}"


def _processor() -> str:
    table = Path("/proc/cpuinfo")
    lines = table.read_text().splitlines() if table.exists() else []
    # Each core has its lines in /proc/cpuinfo; the first one names the processor.
    models = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(models, platform.processor() or platform.machine())

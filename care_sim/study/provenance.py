"""Where results come from: the code, the libraries and the machine that made them."""

import hashlib
import os
import platform
from functools import cache
from importlib import metadata
from pathlib import Path

import care_sim

LIBRARIES = ("gymnasium", "highway-env", "matplotlib", "numpy", "pyarrow", "pybullet", "scipy")


@cache
def code_digest() -> str:
    """Hash of the package's sources, so that no row of an edited program passes for a new one."""
    root = Path(care_sim.__file__).parent
    content = hashlib.sha256()
    for source in sorted(root.rglob("*.py")):
        content.update(str(source.relative_to(root)).encode() + source.read_bytes())
    return content.hexdigest()[:16]


def versions() -> dict[str, str]:
    """Versions of Python, the package, its code and the libraries that decide an episode."""
    libraries = {name: metadata.version(name) for name in LIBRARIES}
    return {
        "python": platform.python_version(),
        "care-sim": care_sim.__version__,
        "code": code_digest(),
        **libraries,
    }


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

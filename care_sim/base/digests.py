"""Hashes of files and folders."""

import hashlib
from collections.abc import Iterable
from functools import lru_cache
from itertools import islice
from pathlib import Path

from care_sim.base.package_files import files_below

MOST_FILES = 10_000
"""A folder with more files is not read: hashing so many takes a second."""


def file_digest(path: Path) -> str | None:
    """Hash of the content of a file, or of the files below a folder and their names; empty where
    there is neither, None of a folder with more than `MOST_FILES`.
    """
    found = [path] if path.is_file() else [*islice(files_below(path), MOST_FILES + 1)]
    if len(found) > MOST_FILES:
        return None
    hashes = [
        f"{file.relative_to(path)} {content_digest(file)}"
        for file in sorted(found)
        if file.suffix != ".pyc"
    ]
    return combined_digest(hashes) if hashes else ""


def content_digest(path: Path) -> str:
    """Hash of a file as it is now."""
    stat = path.stat()
    return _hashed(path, stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)


@lru_cache(maxsize=10_000)
def _hashed(path: Path, *_identity: int) -> str:
    """Hash of a file that has not changed since it was last hashed."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:16]


def combined_digest(digests: Iterable[str]) -> str:
    """One hash of several, in their order."""
    return hashlib.sha256(" ".join(digests).encode()).hexdigest()[:16]


def data_digest(paths: Iterable[Path]) -> str:
    """Hash of the content of several files."""
    return combined_digest(str(file_digest(path)) for path in paths)

"""The published trails, a file of the package."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from care_sim.base.errors import InvalidInput
from care_sim.certify.trail import DIGEST_BYTES
from care_sim.study.rows.parquet import read_rows, write_columns

FILE = Path(__file__).with_name("published.parquet")


def read(path: Path = FILE) -> list[bytes]:
    """The trails by number. Raises InvalidInput for a file that is missing or damaged."""
    if not path.exists():
        raise InvalidInput("the list of certify is missing: install the package again")
    rows = read_rows(path)
    trails = [
        trail
        for row in rows
        if isinstance(trail := row.get("trail"), bytes) and len(trail) > DIGEST_BYTES
    ]
    if len(trails) < len(rows):
        raise InvalidInput(f"{path} holds no trails: install the package again")
    return trails


def write(trails: Sequence[bytes], path: Path = FILE) -> None:
    """Publish the trails of the episodes from 0 on."""
    write_columns({"trail": list(trails)}, path)


def combined(trails: Sequence[bytes]) -> str:
    """One hash over episodes in order."""
    return hashlib.sha256(b"".join(trail[:DIGEST_BYTES] for trail in trails)).hexdigest()[:16]

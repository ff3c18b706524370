"""The published trails, a file of the package with a row per episode: `trail`, and `narrow` where
the episode goes another way on x86 processors without AVX-512, else null.
"""

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path

from care_sim.base.errors import InvalidInput
from care_sim.certify.trail import DIGEST_BYTES
from care_sim.study.rows.parquet import read_rows, write_columns

FILE = Path(__file__).with_name("published.parquet")


def read(path: Path = FILE) -> list[bytes]:
    """The trails by number. Raises InvalidInput for a file that is missing or damaged."""
    trails = _column("trail", path)
    found = [trail for trail in trails if trail is not None]
    if len(found) < len(trails):
        raise InvalidInput(f"{path} holds no trails: install the package again")
    return found


def read_narrow(path: Path = FILE) -> dict[int, bytes]:
    """The trails by number of the episodes that differ without AVX-512: NumPy rounds some sines and
    arctangents differently there. Raises InvalidInput for a missing file.
    """
    trails = _column("narrow", path)
    return {number: trail for number, trail in enumerate(trails) if trail is not None}


def _column(name: str, path: Path) -> list[bytes | None]:
    if not path.exists():
        raise InvalidInput("the list of certify is missing: install the package again")
    column = [row.get(name) for row in read_rows(path)]
    return [one if isinstance(one, bytes) and len(one) > DIGEST_BYTES else None for one in column]


def write(trails: Sequence[bytes], narrow: Mapping[int, bytes], path: Path = FILE) -> None:
    """Publish the `trails` of the episodes from 0 on, and the `narrow` ones of `read_narrow`."""
    others = [narrow.get(number) for number in range(len(trails))]
    write_columns({"trail": [*trails], "narrow": others}, path)


def combined(trails: Sequence[bytes]) -> str:
    """One hash over episodes in order."""
    return hashlib.sha256(b"".join(trail[:DIGEST_BYTES] for trail in trails)).hexdigest()[:16]

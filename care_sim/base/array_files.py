"""Learned numbers in a file that executes no code: float32 arrays and a card that says whose they
are.

The file is an .npz of NumPy, read with `allow_pickle=False`; the card is text in one of its
entries.
"""

from collections.abc import Callable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar
from zipfile import is_zipfile

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_path
from care_sim.base.errors import InvalidInput
from care_sim.base.files import ZIP, replacing

MOST_UNPACKED_BYTES = 2**26
"""Bytes that a file may hold when it is unpacked; the shipped ones hold some millions at most."""
LARGEST_WEIGHT = 1e6
"""Largest magnitude of a weight; shipped weights stay below 100. A file holds at most 2^24 numbers.
Three layers of any shape with inputs up to 1 then stay below 1e29, and float32 ends at 3e38. With
more layers, check the outputs.
"""
_CARD = "card"

Arrays = dict[str, NDArray[np.float32]]
_C = TypeVar("_C")


def write_arrays(
    path: str | PathLike[str], arrays: Mapping[str, NDArray[np.floating]], card: str
) -> None:
    """Write arrays, whole or not at all; the same arrays and card give the same bytes.

    Raises InvalidInput for numbers that `read_arrays` would refuse.
    """
    entries: dict[str, Any] = {_CARD: np.frombuffer(card.encode(), np.uint8)}
    try:
        entries |= _checked({name: np.asarray(one, np.float32) for name, one in arrays.items()})
    except ValueError as error:
        raise InvalidInput(f"weights {path} are not written: {error}") from error
    with replacing(Path(path), ZIP) as unfinished, unfinished.open("wb") as file:
        np.savez(file, **entries)


def read_arrays(
    path: str | PathLike[str], card_of: Callable[[str], _C], command: str
) -> tuple[Arrays, _C]:
    """The arrays, and what `card_of` makes of the card; it raises ValueError for one that is none.

    Raises InvalidInput, which names the `command` that writes such files, for a file that is
    missing, damaged or something else.
    """
    check_path("a file of weights", path)
    try:
        # NumPy would wait for a pipe, and take another file for an array or pickled objects.
        if Path(path).exists() and not Path(path).is_file():
            raise ValueError("it is no file")
        if Path(path).exists() and not is_zipfile(path):
            raise ValueError("it is no whole archive")
        with np.load(path, allow_pickle=False) as file:
            # Before anything is unpacked: a small archive can hold more than the memory does.
            if sum(entry.file_size for entry in file.zip.infolist()) > MOST_UNPACKED_BYTES:
                raise ValueError(f"unpacked it is larger than {MOST_UNPACKED_BYTES} bytes")
            entries = {name: file[name] for name in file.files}
        card = card_of(bytes(entries.pop(_CARD)).decode())
        return _checked(entries), card
    except FileNotFoundError as error:
        raise InvalidInput(f"weights {path}: no such file") from error
    # Damaged archives raise errors of many kinds in zipfile, zlib and NumPy; all become one line,
    # without NumPy's advice to allow pickled objects.
    except Exception as error:
        told = " ".join((str(error) or type(error).__name__).split()).partition(" If you trust")
        raise InvalidInput(
            f"weights {path}: no .npz of weights of {command}, or damaged ({told[0]})"
        ) from error


def _checked(arrays: dict[str, NDArray[Any]]) -> Arrays:
    for name, array in arrays.items():
        if array.dtype != np.float32 or not np.isfinite(array).all():
            raise ValueError(f"array {name!r} is not of finite float32 numbers")
        if array.size and np.abs(array).max() > LARGEST_WEIGHT:
            raise ValueError(f"array {name!r} holds numbers beyond {LARGEST_WEIGHT:g}")
    return arrays

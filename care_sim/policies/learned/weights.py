"""Weights of learned policies in a file that executes no code: float32 arrays and a card that says
whose they are.

The file is an .npz of NumPy, read with `allow_pickle=False`; the card is JSON text in one of its
entries.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import ZipInfo

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_path, is_number
from care_sim.base.errors import InvalidInput
from care_sim.base.files import ZIP, replacing
from care_sim.base.json_text import parsed_json
from care_sim.core.grid import AngularGrid
from care_sim.core.grid_stack import Grid, GridStack
from care_sim.core.rig import Rig
from care_sim.policies.learned.wrapping import Wrapping, wrapping_of_line

FORMAT = "care-sim weights 1"
MOST_UNPACKED_BYTES = 2**26
"""Bytes that a file may hold when it is unpacked; the shipped ones hold some thousands."""
LARGEST_WEIGHT = 1e6
"""What a weight may be, of either sign. Inputs are at most 1 and a file holds 2^24 numbers, so that
three layers of any shape stay below 1e29, while float32 ends at 3e38; the shipped ones stay below
5."""
_CARD = "card"

Arrays = dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class Card:
    """What a file of weights is, what it fits, and how it was made.

    `kind` names the policy. `grid` is the one that was trained on. `budget` is the number of cells
    per keyframe, None if any will do. `setup` is the sensor set-up that was trained with, as a
    `Rig` tells it. `wrapper` says behind which wrappers the weights were trained, None without.
    `scenario`, `data`, `seeds`, `steps`, `machine`, `versions` and `result` tell people how the
    weights were trained and what they reached.
    """

    kind: str
    grid: Grid
    budget: int | None = None
    setup: str = ""
    wrapper: Wrapping | None = None
    scenario: str | None = None
    data: str = ""
    seeds: Mapping[str, Any] = field(default_factory=dict)
    steps: int = 0
    machine: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    result: Mapping[str, Any] = field(default_factory=dict)

    def to_json(self) -> str:
        """As text that people can read."""
        return json.dumps({"format": FORMAT} | asdict(self), indent=1)

    @classmethod
    def from_json(cls, text: str) -> "Card":
        """Read text back. Raises ValueError for anything but a card."""
        plain = parsed_json(text)
        if not isinstance(plain, dict) or plain.pop("format", None) != FORMAT:
            raise ValueError(f"its card is not of the format {FORMAT!r}")
        # Cards of earlier versions do not tell the set-up.
        plain.setdefault("setup", "")
        # Exactly the fields of a card: what a later form adds might change what the weights mean.
        if wrong := set(plain) ^ {column.name for column in fields(cls)}:
            raise ValueError(f"its card lacks or has too much: {', '.join(sorted(wrong))}")
        for name, value in plain.items():
            # To Python true is an int.
            if not isinstance(value, _TYPES[name]) or isinstance(value, bool):
                raise ValueError(f"its card says {name} {value!r}")
        made = {"grid": _grid(plain["grid"]), "wrapper": _wrapping(plain["wrapper"])}
        card = cls(**plain | made)
        if card.budget is not None and not 0 < card.budget <= card.grid.size:
            raise ValueError(f"its card says budget {card.budget}")
        return card


_HINTS = {
    "budget": "; those trained with several budgets fit any",
    "grid": (
        "; what was learned belongs to the cells of that grid: play the sensor set-up that has it, "
        "or a policy that is not tagged `learned` in `care-sim policies`"
    ),
}
"""Why weights do not fit, and what does."""
_TYPES: dict[str, Any] = {column.name: str for column in fields(Card)}
_TYPES |= {
    "grid": dict,
    "budget": int | None,
    "wrapper": dict | str | None,
    "scenario": str | None,
    "steps": int,
}
_TYPES |= dict.fromkeys(("seeds", "versions", "result"), dict)


@dataclass(frozen=True)
class Weights:
    """The arrays and the card of the file at `path`."""

    path: Path
    arrays: Arrays
    card: Card

    def check(self, kind: str, rig: Rig) -> None:
        """Raise InvalidInput, with what the file has and what is needed, unless the weights are of
        this kind and fit this rig.
        """
        card = self.card
        needed: dict[str, Any] = {"kind": kind, "grid": rig.grid}
        needed |= {"budget": rig.budget} if card.budget is not None else {}
        for name, value in needed.items():
            if getattr(card, name) != value:
                has, wanted = (_told(name, it, rig) for it in (getattr(card, name), value))
                hint = _HINTS.get(name, "")
                raise InvalidInput(
                    f"weights {self.path}: {name} is {has}, needed is {wanted}{hint}"
                )
        # By the hash behind the name. A card or a rig that does not tell its set-up fits any.
        if len({one.setup.rpartition(" ")[2] for one in (card, rig)} - {""}) > 1:
            raise InvalidInput(
                f"weights {self.path}: the set-up is {card.setup}, needed is {rig.setup}"
            )

    def array(self, name: str, *shape: int | None) -> NDArray[np.float32]:
        """An array by name; None in `shape` is any length. Raises InvalidInput for a missing one,
        or another shape.
        """
        if name not in self.arrays:
            raise InvalidInput(
                f"weights {self.path}: no array {name!r}; it has {', '.join(self.arrays) or 'none'}"
            )
        array = self.arrays[name]
        if array.ndim != len(shape) or any(
            n not in (None, m) for n, m in zip(shape, array.shape, strict=True)
        ):
            wanted = " x ".join("any" if n is None else str(n) for n in shape)
            raise InvalidInput(
                f"weights {self.path}: array {name!r} has the shape {array.shape}, needed is "
                f"{wanted}"
            )
        return array


def save_weights(
    path: str | PathLike[str], arrays: Mapping[str, NDArray[np.floating]], card: Card
) -> None:
    """Write weights, whole or not at all; the same arrays and card give the same bytes."""
    entries: dict[str, Any] = {_CARD: np.frombuffer(card.to_json().encode(), np.uint8)}
    entries |= {name: np.asarray(array, np.float32) for name, array in arrays.items()}
    with replacing(Path(path), ZIP) as unfinished, unfinished.open("wb") as file:
        np.savez(file, **entries)


def load_weights(path: str | PathLike[str]) -> Weights:
    """Read weights. Raises InvalidInput for a file that is missing, damaged or something else."""
    check_path("a file of weights", path)
    try:
        with np.load(path, allow_pickle=False) as file:
            _check_contents(file.zip.infolist())
            entries = {name: file[name] for name in file.files}
        card = Card.from_json(bytes(entries.pop(_CARD)).decode())
        return Weights(Path(path), _checked(entries), card)
    except FileNotFoundError as error:
        raise InvalidInput(f"weights {path}: no such file") from error
    # Damaged archives raise errors of many kinds in zipfile, zlib and NumPy; all become one line,
    # without NumPy's advice to allow pickled objects.
    except Exception as error:
        reason = " ".join((str(error) or type(error).__name__).split()).partition(" If you trust")[
            0
        ]
        raise InvalidInput(
            f"weights {path}: no .npz of weights of care-sim train, or damaged ({reason})"
        ) from error


def shipped_weights(name: str) -> Path:
    """Where the weights of that name lie that come with the package."""
    return Path(__file__).parent / "shipped" / f"{name}.npz"


def _check_contents(entries: list[ZipInfo]) -> None:
    # Of two entries of one name each reader would take its own.
    if len({entry.filename for entry in entries}) < len(entries):
        raise ValueError("an entry comes twice")
    # Before anything is unpacked: a small archive can hold more than the memory does.
    if sum(entry.file_size for entry in entries) > MOST_UNPACKED_BYTES:
        raise ValueError(f"unpacked it is larger than {MOST_UNPACKED_BYTES} bytes")


def _grid(plain: dict[str, Any]) -> Grid:
    if set(plain) != {column.name for column in fields(GridStack)}:
        return _own_grid(plain)
    return GridStack(tuple(map(_own_grid, plain["grids"])), plain["places"])


def _own_grid(plain: dict[str, Any]) -> AngularGrid:
    # Cards of earlier versions are of level grids all round in equal steps, and say no more.
    usual = {"field_of_view": 2 * np.pi, "heading": 0.0, "pitch": 0.0, "roll": 0.0}
    numbers = usual | plain
    listed = numbers.pop("listed", [])
    names = {column.name for column in fields(AngularGrid)} - {"listed"}
    if set(numbers) != names or not (
        isinstance(listed, list) and all(map(is_number, [*numbers.values(), *listed]))
    ):
        raise ValueError(f"its card says grid {plain!r}")
    return AngularGrid(**numbers, listed=tuple(listed))


def _wrapping(stored: dict[str, Any] | str | None) -> Wrapping | None:
    if isinstance(stored, str):
        return wrapping_of_line(stored)
    return None if stored is None else Wrapping.from_plain(stored)


def _checked(arrays: dict[str, NDArray[Any]]) -> Arrays:
    for name, array in arrays.items():
        if array.dtype != np.float32 or not np.isfinite(array).all():
            raise ValueError(f"array {name!r} is not of finite float32 numbers")
        if array.size and np.abs(array).max() > LARGEST_WEIGHT:
            raise ValueError(f"array {name!r} holds numbers beyond {LARGEST_WEIGHT:g}")
    return arrays


def _told(name: str, value: Any, rig: Rig) -> str:
    """A value of a card as a reader wants it."""
    if name == "budget":
        return f"{value} cells ({value / rig.grid.size:.4g})"
    if isinstance(value, GridStack):
        told_each = "; ".join(_told(name, head.grid, rig) for head in value.heads)
        return f"{len(value.heads)} LiDARs: {told_each}"
    if isinstance(value, AngularGrid):
        told = asdict(value)
        rows = ", rows listed" if told.pop("listed") else ""
        return " ".join(f"{key} {number:.6g}" for key, number in told.items()) + rows
    return repr(value)

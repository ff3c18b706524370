"""Weights of learned policies in a file that executes no code: float32 arrays and a card that says whose they are.

The file is an .npz of NumPy, read with `allow_pickle=False`; the card is JSON text in one of its entries.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from care_sim.errors import InvalidInput
from care_sim.types import Rig

FORMAT = "care-sim weights 1"
_CARD = "card"
_TYPES = {"kind": str, "grid": dict, "budget": int | None, "wrapper": str | None}
"""Of what a file is checked by."""

Arrays = dict[str, NDArray[np.float32]]


@dataclass(frozen=True)
class Card:
    """What a file of weights is, what it fits, and how it was made.

    `kind` names the policy. `grid` are the fields of `AngularGrid`; `budget` the cells a keyframe and `wrapper` the
    wrapper with its parameters in one text, None where any will do. `scenario`, `data`, `seeds`, `steps`, `machine`,
    `versions` and `result` tell people how the weights were trained and what they reached.
    """

    kind: str
    grid: Mapping[str, Any]
    budget: int | None = None
    wrapper: str | None = None
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
        plain = json.loads(text)
        if not isinstance(plain, dict) or plain.pop("format", None) != FORMAT:
            raise ValueError(f"its card is not of the format {FORMAT!r}")
        if wrong := set(plain) ^ {column.name for column in fields(cls)}:
            raise ValueError(f"its card lacks or has too much: {', '.join(sorted(wrong))}")
        for name, kinds in _TYPES.items():
            if not isinstance(plain[name], kinds):
                raise ValueError(f"its card says {name} {plain[name]!r}")
        return cls(**plain)


@dataclass(frozen=True)
class Weights:
    """The arrays and the card of the file at `path`."""

    path: Path
    arrays: Arrays
    card: Card

    def check(self, kind: str, rig: Rig, wrapper: str | None = None) -> None:
        """Raise InvalidInput, with what the file has and what is needed, unless the weights are of this kind and fit
        this rig and wrapper.
        """
        card = self.card
        needed: dict[str, Any] = {"kind": kind, "grid": asdict(rig.grid)}
        needed |= {"budget": rig.budget} if card.budget is not None else {}
        needed |= {"wrapper": wrapper} if card.wrapper is not None else {}
        for name, value in needed.items():
            if getattr(card, name) != value:
                has, wanted = (_told(name, it, rig) for it in (getattr(card, name), value))
                raise InvalidInput(f"weights {self.path}: {name} is {has}, needed is {wanted}")

    def array(self, name: str, *shape: int | None) -> NDArray[np.float32]:
        """An array by name; None in `shape` is any length. Raises InvalidInput for a missing one, or another shape."""
        if name not in self.arrays:
            raise InvalidInput(f"weights {self.path}: no array {name!r}; it has {', '.join(self.arrays) or 'none'}")
        array = self.arrays[name]
        if array.ndim != len(shape) or any(n not in (None, m) for n, m in zip(shape, array.shape, strict=True)):
            wanted = " x ".join("any" if n is None else str(n) for n in shape)
            raise InvalidInput(f"weights {self.path}: array {name!r} has the shape {array.shape}, needed is {wanted}")
        return array


def save(path: str | PathLike[str], arrays: Mapping[str, NDArray[np.floating]], card: Card) -> None:
    """Write weights; the same arrays and card give the same bytes."""
    entries: dict[str, Any] = {_CARD: np.frombuffer(card.to_json().encode(), np.uint8)}
    entries |= {name: np.asarray(array, np.float32) for name, array in arrays.items()}
    with open(path, "wb") as file:
        np.savez(file, **entries)


def load(path: str | PathLike[str]) -> Weights:
    """Read weights. Raises InvalidInput for a file that is missing, damaged or something else."""
    try:
        with np.load(path, allow_pickle=False) as file:
            entries = {name: file[name] for name in file.files}
        card = Card.from_json(bytes(entries.pop(_CARD)).decode())
        return Weights(Path(path), _checked(entries), card)
    except FileNotFoundError as error:
        raise InvalidInput(f"weights {path}: no such file") from error
    except (OSError, ValueError, KeyError, EOFError, TypeError, AttributeError, MemoryError, BadZipFile) as error:
        reason = " ".join(str(error).split())
        raise InvalidInput(f"weights {path}: not a file of weights, or damaged ({reason})") from error


def shipped(name: str) -> Path:
    """Where the weights of that name lie that come with the package."""
    return Path(__file__).parent / "shipped" / f"{name}.npz"


def _checked(arrays: dict[str, NDArray[Any]]) -> Arrays:
    for name, array in arrays.items():
        if array.dtype != np.float32 or not np.isfinite(array).all():
            raise ValueError(f"array {name!r} is not of finite float32 numbers")
    return arrays


def _told(name: str, value: Any, rig: Rig) -> str:
    """A value of a card as a reader wants it."""
    if name == "budget":
        return f"{value} cells ({value / rig.grid.size:.4g})"
    if name == "grid" and isinstance(value, Mapping):
        return " ".join(f"{key} {number:.6g}" for key, number in value.items())
    return repr(value)

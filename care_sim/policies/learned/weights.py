"""Weights of learned policies in a file of arrays (`care_sim.base.array_files`), whose card, JSON
text, says what they fit.
"""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.array_files import Arrays, read_arrays, write_arrays
from care_sim.base.checks import is_number
from care_sim.base.errors import InvalidInput
from care_sim.base.files import parsed_json
from care_sim.core.cells.stack import Grid, GridStack
from care_sim.core.defaults import Wrapping, wrapping_of_line
from care_sim.core.grid import AngularGrid
from care_sim.core.rig import Rig

FORMAT = "care-sim weights 1"


@dataclass(frozen=True)
class Card:
    """Description of a file of weights: what it fits, and how it was made.

    `kind` names the policy. `grid` is the grid of the training. `budget` is the number of cells per
    keyframe, None for any. `setup` is the sensor set-up of the training, as in a `Rig`. `wrapper`
    names the wrappers of the training, None without. `scenario`, `data`, `seeds`, `steps`,
    `machine`, `versions` and `result` describe the training and its results for people.
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
        """Return readable JSON text."""
        return json.dumps({"format": FORMAT} | asdict(self), indent=1)

    @classmethod
    def from_json(cls, text: str) -> "Card":
        """Read text back. Raises ValueError for anything but a card."""
        plain = parsed_json(text)
        if not isinstance(plain, dict) or plain.pop("format", None) != FORMAT:
            raise ValueError(f"its card is not of the format {FORMAT!r}")
        # Cards of earlier versions do not hold the set-up.
        plain.setdefault("setup", "")
        # Exactly the fields of a card: fields of a later form might change the meaning of the
        # weights.
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
        "or a policy that is not tagged `learned` in `care-sim list policies`"
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
        """Raise InvalidInput unless the weights are of this kind and fit this rig. The message
        names what the file has and what is needed.
        """
        card = self.card
        needed: dict[str, Any] = {"kind": kind, "grid": rig.grid}
        needed |= {"budget": rig.budget} if card.budget is not None else {}
        for name, value in needed.items():
            if getattr(card, name) != value:
                has, wanted = (_describe(name, it, rig) for it in (getattr(card, name), value))
                hint = _HINTS.get(name, "")
                raise InvalidInput(
                    f"weights {self.path}: {name} is {has}, needed is {wanted}{hint}"
                )
        # By the hash behind the name. A card or a rig without a set-up fits any.
        if len({one.setup.rpartition(" ")[2] for one in (card, rig)} - {""}) > 1:
            raise InvalidInput(
                f"weights {self.path}: the set-up is {card.setup}, needed is {rig.setup}"
            )

    def array(self, name: str, *shape: int | None) -> NDArray[np.float32]:
        """Return an array by name; None in `shape` is any length. Raises InvalidInput for a missing
        one, or another shape.
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
    """Write weights, whole or not at all; the same arrays and card give the same bytes. Raises
    InvalidInput for numbers that `load_weights` would refuse.
    """
    write_arrays(path, arrays, card.to_json())


def load_weights(path: str | PathLike[str]) -> Weights:
    """Read weights. Raises InvalidInput for a file that is missing, damaged or of another kind."""
    arrays, card = read_arrays(path, Card.from_json, "care-sim train")
    return Weights(Path(path), arrays, card)


def shipped_weights(name: str) -> Path:
    """Return the path of the shipped weights of that name."""
    return Path(__file__).parent / "shipped" / f"{name}.npz"


def _grid(plain: dict[str, Any]) -> Grid:
    if set(plain) != {column.name for column in fields(GridStack)}:
        return _own_grid(plain)
    return GridStack(tuple(map(_own_grid, plain["grids"])), plain["places"])


def _own_grid(plain: dict[str, Any]) -> AngularGrid:
    # Cards of earlier versions belong to level grids of a full turn in equal steps, and hold
    # nothing more.
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


def _describe(name: str, value: Any, rig: Rig) -> str:
    """Return a value of a card in readable form."""
    if name == "budget":
        return f"{value} cells ({value / rig.grid.size:.4g})"
    if isinstance(value, GridStack):
        told_each = "; ".join(_describe(name, head.grid, rig) for head in value.heads)
        return f"{len(value.heads)} LiDARs: {told_each}"
    if isinstance(value, AngularGrid):
        told = asdict(value)
        rows = ", rows listed" if told.pop("listed") else ""
        return " ".join(f"{key} {number:.6g}" for key, number in told.items()) + rows
    return repr(value)

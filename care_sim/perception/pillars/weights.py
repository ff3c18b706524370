"""The numbers of a trained network, in a file of arrays with a card
(`care_sim.base.array_files`).
"""

import json
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.array_files import Arrays, read_arrays, write_arrays
from care_sim.base.errors import InvalidInput
from care_sim.base.files import parsed_json
from care_sim.core.types import CLASSES
from care_sim.perception.pillars.network import shapes

FORMAT = "care-sim pillars 1"
"""It goes up when the layers or what they are told change."""
SHIPPED = Path(__file__).parent / "shipped" / "pillars.npz"
CALIBRATION = "calibration"
"""(classes, 2) slope and offset from the logit of a peak to that of its score."""
COMMAND = "care-sim train detector"


def save_detector(
    path: str | PathLike[str], arrays: Mapping[str, NDArray[np.float32]], card: Mapping[str, Any]
) -> None:
    """Write the arrays of `array_shapes` and a card of plain values."""
    write_arrays(path, arrays, json.dumps({"format": FORMAT} | dict(card), indent=1))


def load_detector(path: str | PathLike[str] | None = None) -> tuple[Arrays, dict[str, Any]]:
    """The arrays and the card of a file, of the shipped one without a path.

    Raises InvalidInput for a file that is missing, damaged, or does not hold exactly these arrays.
    """
    path = SHIPPED if path is None else path
    arrays, card = read_arrays(path, _card, COMMAND)
    wanted = array_shapes()
    if wrong := sorted(set(arrays) ^ set(wanted)):
        raise InvalidInput(f"weights {path}: lacks or has too much: {', '.join(wrong)}")
    for name, shape in wanted.items():
        if arrays[name].shape != shape:
            raise InvalidInput(
                f"weights {path}: array {name!r} has the shape {arrays[name].shape}, needed is "
                f"{shape}"
            )
    if not (arrays[CALIBRATION][:, 0] > 0).all():
        raise InvalidInput(f"weights {path}: the slopes of array {CALIBRATION!r} must be above 0")
    return arrays, card


def array_shapes() -> dict[str, tuple[int, ...]]:
    """The shape of every array of a file, by name."""
    return shapes() | {CALIBRATION: (len(CLASSES), 2)}


def _card(text: str) -> dict[str, Any]:
    plain = parsed_json(text)
    if not isinstance(plain, dict) or plain.get("format") != FORMAT:
        raise ValueError(f"its card is not of the format {FORMAT!r}")
    return plain

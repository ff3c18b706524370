"""A learned detector that reads only points: a network over pillars, trained on scans of every
budget.
"""

import json
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.array_files import Arrays, read_arrays, write_arrays
from care_sim.base.checks import check_known, check_number
from care_sim.base.errors import InvalidInput
from care_sim.base.extras import import_torch
from care_sim.base.files import parsed_json
from care_sim.base.limits import one_thread
from care_sim.core.arrays import Floats
from care_sim.core.types import CLASSES, Detections
from care_sim.perception.pillars.decoding import peaks_of, points_within
from care_sim.perception.pillars.network import Fixed, answers, on_plan, place_planes, shapes

FORMAT = "care-sim pillars 1"
"""Version of the format; raise it when layers or inputs change."""
SHIPPED = Path(__file__).parent / "shipped" / "pillars.npz"
STREETS, CLUTTER = "streets", "clutter"
WEIGHTS = {STREETS: SHIPPED, CLUTTER: SHIPPED.with_name("pillars-clutter.npz")}
"""The shipped weights by training data: clean streets and drives, or cluttered streets."""
CALIBRATION = "calibration"
"""(classes, 2) slope and offset from the logit of a peak to that of its score."""
COMMAND = "care-sim train detector"


def save_detector(
    path: str | PathLike[str], arrays: Mapping[str, NDArray[np.float32]], card: Mapping[str, Any]
) -> None:
    """Write the arrays of `array_shapes` and a card of plain values."""
    write_arrays(path, arrays, json.dumps({"format": FORMAT} | dict(card), indent=1))


def load_detector(path: str | PathLike[str] | None = None) -> tuple[Arrays, dict[str, Any]]:
    """Return the arrays and the card of a file, by default of the shipped one.

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


LEAST_SCORE = 0.3
"""Score below which a detection does not become a track."""


class PillarsDetector:
    """The learned detector. `weights` are shipped ones, `streets` or `clutter`, named after their
    training data. `file` replaces them by weights that `care-sim train detector` wrote.

    Boxes have a score of `least_score` or more. A score is the share of such boxes within 2 m of an
    object of their class, in scenes outside the training. Runs on one core with PyTorch, the extra
    `rl`.

    Raises MissingExtra without it, InvalidInput for a file that is not of such weights.
    """

    far = False
    stateless = True

    def __init__(
        self,
        file: str | PathLike[str] | None = None,
        least_score: float = LEAST_SCORE,
        weights: str = STREETS,
    ):
        check_number("least_score", least_score, 0.0, 1.0)
        check_known("weights of detector pillars", weights, WEIGHTS)
        if file is not None and weights != STREETS:
            raise InvalidInput("give file or weights of detector pillars, not both")
        self._torch = import_torch()
        self._file = WEIGHTS[weights] if file is None else file
        arrays, self.card = load_detector(self._file)
        self._network = Fixed(self._torch, arrays)
        self._places = place_planes(self._torch)
        self._calibration = arrays[CALIBRATION].astype(np.float64)
        self._least_score = least_score

    def detect(self, points: Floats, sensor_height_m: float) -> Detections:
        """See `care_sim.perception.points_only.PointDetector`; by peak, surest first.

        Raises InvalidInput for points that are not (P, 3) finite numbers.
        """
        points = np.asarray(points, np.float64)
        if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
            raise InvalidInput(f"points must be (P, 3) finite numbers, got shape {points.shape}")
        answer = self.answer(points, sensor_height_m)
        found = peaks_of(answer, sensor_height_m, self._calibration, self._least_score)
        returns = points_within(np.ascontiguousarray(points), np.ascontiguousarray(found.boxes))
        return Detections(found.classes, found.boxes, returns, found.scores)

    def answer(self, points: Floats, sensor_height_m: float) -> NDArray[np.float32]:
        """Return (OUTPUTS, CELLS, CELLS) the network's output for points (P, 3). Raises
        InvalidInput if it is not finite.
        """
        torch = self._torch
        seen = on_plan(points, sensor_height_m)
        # One thread: several processes play at the same time, and sums have one order.
        with one_thread(torch), torch.inference_mode():
            inputs, pillars = torch.from_numpy(seen.inputs), torch.from_numpy(seen.pillars)
            answer = answers(torch, self._network, inputs, pillars, self._places)
        made: NDArray[np.float32] = answer[0].numpy()
        # Products of small weights may still overflow. No cell is a peak beside NaN, so the scan
        # would look empty.
        if not np.isfinite(made).all():
            raise InvalidInput(f"weights {self._file}: the network answers numbers beyond float32")
        return made

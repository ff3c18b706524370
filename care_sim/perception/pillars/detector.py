"""A learned detector that sees points only: a network over pillars, trained on scans of every
budget.
"""

from os import PathLike

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput
from care_sim.base.extras import import_torch
from care_sim.base.limits import one_thread
from care_sim.core.arrays import Floats
from care_sim.core.types import Detections
from care_sim.perception.pillars.box_kernels import points_within
from care_sim.perception.pillars.decoding import peaks_of
from care_sim.perception.pillars.network import Fixed, answers, place_planes
from care_sim.perception.pillars.plan import on_plan
from care_sim.perception.pillars.weights import CALIBRATION, SHIPPED, load_detector

LEAST_SCORE = 0.3
"""What is less sure does not become a track."""


class PillarsDetector:
    """The learned detector. `file` holds weights that `care-sim train detector` wrote; without it
    the shipped ones act.

    What it reports has a score of `least_score` or more. A score is the share of such boxes that
    lie within 2 m of an object of their class, in scenes apart from those of the training. Runs on
    one core with PyTorch, the extra `rl`. Raises MissingExtra without it, InvalidInput for a file
    that is not of such weights.
    """

    def __init__(self, file: str | PathLike[str] | None = None, least_score: float = LEAST_SCORE):
        check_number("least_score", least_score, 0.0, 1.0)
        self._torch = import_torch()
        self._file = SHIPPED if file is None else file
        arrays, self.card = load_detector(file)
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
        """(OUTPUTS, CELLS, CELLS) what the network says of points (P, 3). Raises InvalidInput where
        that is not finite.
        """
        torch = self._torch
        seen = on_plan(points, sensor_height_m)
        # One thread: several processes play at the same time, and sums have one order.
        with one_thread(torch), torch.inference_mode():
            inputs, pillars = torch.from_numpy(seen.inputs), torch.from_numpy(seen.pillars)
            answer = answers(torch, self._network, inputs, pillars, self._places)
        made: NDArray[np.float32] = answer[0].numpy()
        # Weights may each be small enough, and their products still overflow. Nothing is a peak
        # beside NaN, so the scan would look empty.
        if not np.isfinite(made).all():
            raise InvalidInput(f"weights {self._file}: the network answers numbers beyond float32")
        return made

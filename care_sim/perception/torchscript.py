"""A learned detector from a TorchScript file, and the example to follow for one's own.

A detector is any class with `detect(points, sensor_height_m)`; see
`care_sim.perception.points_only.PointDetector`. One around an ONNX file, in a package of its own:

    class OnnxDetector:
        def __init__(self, file: str):
            self._session = onnxruntime.InferenceSession(file)

        def detect(self, points, sensor_height_m):
            inputs = {"points": points.astype("float32")}
            classes, boxes, scores = self._session.run(None, inputs)
            return Detections(classes, boxes, inside(points, boxes).sum(axis=1), scores)

is found under the name `mine` by this entry in the package's pyproject.toml:

    [project.entry-points."care_sim.detectors"]
    mine = "my_package:OnnxDetector"
"""

from os import PathLike, fspath
from pathlib import Path

import numpy as np

from care_sim.base.checks import check_flag
from care_sim.base.errors import InvalidInput
from care_sim.base.extras import import_torch
from care_sim.core.arrays import Floats
from care_sim.core.types import Detections
from care_sim.perception.points_only import inside


class TorchScriptDetector:
    """Runs the module in `file`: `forward(points, sensor_height_m) -> (classes, boxes, scores)`.

    `points` is a float32 tensor (P, 3) in the sensor frame, `sensor_height_m` a float; `classes`
    (n,) index `care_sim.core.types.CLASSES`, `boxes` (n, 7) are x, y, z, length, width, height, yaw
    in the sensor frame, `scores` (n,) lie in [0, 1]. With `times` the points are (P, 4), last the
    seconds from the keyframe, 0 or less. Runs on the CPU. Needs torch. Raises MissingExtra without
    it, InvalidInput for a file that is no TorchScript module.
    """

    def __init__(self, file: str | PathLike[str], times: bool = False):
        check_flag("times", times)
        self.wants_times = times
        self._torch = import_torch()
        self._file = fspath(file)
        if not Path(file).is_file():
            raise InvalidInput(
                f"{self._file}: no such file; allowed is a TorchScript module (torch.jit.save)"
            )
        try:
            self._module = self._torch.jit.load(self._file, map_location="cpu").eval()
        except RuntimeError as error:
            raise InvalidInput(f"{self._file}: no TorchScript module (torch.jit.save)") from error

    def detect(self, points: Floats, sensor_height_m: float) -> Detections:
        """See `care_sim.perception.points_only.PointDetector`."""
        # Nothing is learned here, so no gradients are kept.
        with self._torch.inference_mode():
            outputs = self._module(
                self._torch.from_numpy(points.astype(np.float32)), float(sensor_height_m)
            )
        classes, boxes, scores = (output.numpy() for output in outputs)
        return Detections(classes, boxes, inside(points[:, :3], boxes).sum(axis=1), scores)

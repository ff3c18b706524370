"""Time the network of `pillars` on one core with PyTorch, NumPy and numba.

    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python docs/examples/pillars_in_numpy.py

Its convolutions are nearly all of its time. Each way does them on the same scans of a street; the
answers must be alike. Needs the extra `rl`.
"""

import time
from typing import Any

import numba
import numpy as np
import torch

from care_sim.perception.pillars.detector import PillarsDetector, load_detector
from care_sim.perception.pillars.network import LAYERS, POINT_LAYERS
from care_sim.sources.street_films import street_film

STREET = 2500
SCANS = 10


class InNumpy:
    """The layers of `care_sim.perception.pillars.network.Fixed`: each window is a row, and each
    layer is one product of matrices.
    """

    def __init__(self, arrays: dict[str, Any]):
        self._points = {layer.name for layer in POINT_LAYERS}
        self._layers = {
            name: (arrays[f"{name}.weight"], arrays[f"{name}.bias"], layer)
            for name, layer in LAYERS.items()
        }

    def __call__(self, name: str, told: torch.Tensor) -> torch.Tensor:
        """To rows of points, or to planes (1, inputs, h, w)."""
        weight, bias, layer = self._layers[name]
        if name in self._points:
            made = told.numpy() @ weight[:, :, 0, 0].T + bias
        else:
            made = self.convolved(told.numpy()[0], weight, layer.stride) + bias[:, None, None]
            made = made[None]
        return torch.from_numpy(np.maximum(made, 0) if layer.rectified else made)

    def convolved(self, planes: Any, weight: Any, stride: int) -> Any:
        """(outputs, h, w) of planes (inputs, h, w), with zeros round them."""
        size = weight.shape[-1]
        edge = size // 2
        padded = np.pad(planes, ((0, 0), (edge, edge), (edge, edge)))
        windows = np.lib.stride_tricks.sliding_window_view(padded, (size, size), (1, 2))
        return np.tensordot(weight, windows[:, ::stride, ::stride], ([1, 2, 3], [0, 3, 4]))


class InNumba(InNumpy):
    """The same in compiled loops."""

    def convolved(self, planes: Any, weight: Any, stride: int) -> Any:
        """See `InNumpy`."""
        edge = weight.shape[-1] // 2
        padded = np.pad(planes, ((0, 0), (edge, edge), (edge, edge)))
        return _looped(padded, np.ascontiguousarray(weight), stride)


@numba.njit(fastmath=True)
def _looped(padded, weight, stride):
    outputs, inputs, size, _ = weight.shape
    height = (padded.shape[1] - size) // stride + 1
    width = (padded.shape[2] - size) // stride + 1
    made = np.zeros((outputs, height, width), np.float32)
    for o in range(outputs):
        for i in range(inputs):
            for a in range(size):
                for b in range(size):
                    factor = weight[o, i, a, b]
                    for y in range(height):
                        row = padded[i, y * stride + a]
                        for x in range(width):
                            made[o, y, x] += factor * row[x * stride + b]
    return made


def answers_and_times(scans: int) -> dict[str, tuple[list[Any], float]]:
    """By name what each way answers on scans of a street, and its median time of one core, ms."""
    film = street_film(STREET)
    arrays, _ = load_detector(None)
    detector = PillarsDetector()
    ways = {"PyTorch": detector._network, "NumPy": InNumpy(arrays), "numba": InNumba(arrays)}
    told = {}
    for name, way in ways.items():
        detector._network = way
        points = [shot.cloud.points for shot in film.shots[:scans]]
        detector.answer(points[0], film.sensor_height_m)
        made, spent = [], []
        for cloud in points:
            begun = time.process_time()
            made.append(detector.answer(cloud, film.sensor_height_m))
            spent.append(1000 * (time.process_time() - begun))
        told[name] = made, float(np.median(spent))
    return told


def main() -> None:
    """Print the times as ratios."""
    told = answers_and_times(SCANS)
    first, least = told["PyTorch"]
    for name, (made, spent) in told.items():
        apart = max(float(np.abs(a - b).max()) for a, b in zip(first, made, strict=True))
        print(
            f"{name}: {spent / least:.1f} times PyTorch's {least:.0f} ms; answers {apart:.1e} apart"
        )


if __name__ == "__main__":
    main()

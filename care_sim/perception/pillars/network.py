"""The network: a table of its layers, and the one way through them, in plain PyTorch.

What a layer does is handed in: to train it normalises over a batch, to detect its numbers are
fixed. So both go the same way.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from care_sim.core.types import CLASSES
from care_sim.perception.pillars.plan import PILLARS, POINT_INPUTS

BOX_OUTPUTS = (
    "x", "y", "height", "log length", "log width", "log height", "cos", "sin", "cos 2", "sin 2",
)  # fmt: skip
"""What a cell says of the box whose centre is near: x and y from the middle of the cell, the height
of its centre above the road, metres; the logarithms of its size; its yaw as a direction, and as an
axis. An axis is what points tell; which way along it they seldom do, and the direction is then
short, but the axis is not."""
OUTPUTS = len(CLASSES) + len(BOX_OUTPUTS)

_PLACES = 3
"""What every pillar is told of its place: range, and cosine and sine of its bearing. The side of a
body that faces the sensor returns, so where its middle lies hangs on the bearing."""


@dataclass(frozen=True)
class Layer:
    """A convolution of `size` x `size` from `inputs` to `outputs` channels. `rectified` ones are
    normalised and cut off at 0.
    """

    name: str
    inputs: int
    outputs: int
    size: int = 3
    stride: int = 1
    rectified: bool = True


POINT_LAYERS = (Layer("point0", len(POINT_INPUTS), 32, 1), Layer("point1", 32, 24, 1))
"""Each point by itself."""
_STAGES = (
    (Layer("near0", 24 + 1 + _PLACES, 32, stride=2), Layer("near1", 32, 32)),
    (Layer("body0", 32, 64, stride=2), Layer("body1", 64, 64), Layer("body2", 64, 64)),
    (Layer("lane0", 64, 96, stride=2), Layer("lane1", 96, 96), Layer("lane2", 96, 96)),
    (Layer("street0", 96, 128, stride=2), Layer("street1", 128, 128), Layer("street2", 128, 128)),
)
"""Of cells of 1, 2, 4 and 8 m."""
_BACK = (
    (Layer("lane_back", 128, 96, 1), Layer("lane_both", 96, 96)),
    (Layer("body_back", 96, 64, 1), Layer("body_both", 64, 64)),
    (Layer("near_back", 64, 32, 1), Layer("near_both", 32, 32)),
)
"""What a coarser stage tells the finer one before it, and what that makes of both."""
_ANSWER = Layer("answer", 32, OUTPUTS, 1, rectified=False)
PLAN_LAYERS = (*(one for stage in (*_STAGES, *_BACK) for one in stage), _ANSWER)
LAYERS = {layer.name: layer for layer in (*POINT_LAYERS, *PLAN_LAYERS)}

Apply = Callable[[str, Any], Any]
"""What a layer does, by its name: to rows (n, inputs) of points, to planes (s, inputs, h, w) of the
plan."""


def answers(
    torch: Any, apply: Apply, inputs: Any, pillars: Any, places: Any, scans: int = 1
) -> Any:
    """(scans, OUTPUTS, CELLS, CELLS): of each class how sure it is, as a logit, that a centre lies
    in the cell, then BOX_OUTPUTS.

    `inputs` (p, len(POINT_INPUTS)) and `pillars` (p,) are the `Points` of all scans, the pillars of
    scan s counted on from s * PILLARS**2. `places` are `place_planes`.
    """
    told = inputs
    for layer in POINT_LAYERS:
        told = apply(layer.name, told)

    # The mean of its points, and how many they are: a pillar in which few cells fired looks like
    # one in which many did.
    size = scans * PILLARS**2
    counts = torch.zeros(size, 1).index_add_(0, pillars, torch.ones(len(pillars), 1))
    means = torch.zeros(size, told.shape[1]).index_add_(0, pillars, told) / counts.clamp(min=1)
    rows = torch.cat([means, torch.log1p(counts)], 1).view(scans, PILLARS, PILLARS, -1)
    planes = torch.cat([rows.permute(0, 3, 1, 2), places.expand(scans, -1, -1, -1)], 1)

    looked = []
    for stage in _STAGES:
        for layer in stage:
            planes = apply(layer.name, planes)
        looked.append(planes)
    for (back, both), finer in zip(_BACK, reversed(looked[:-1]), strict=True):
        coarse = torch.nn.functional.interpolate(apply(back.name, planes), scale_factor=2)
        planes = apply(both.name, finer + coarse)
    return apply(_ANSWER.name, planes)


def place_planes(torch: Any) -> Any:
    """(1, 3, PILLARS, PILLARS) what every pillar is told of its place."""
    along = ((np.arange(PILLARS) + 0.5) / PILLARS * 2 - 1).astype(np.float32)
    x, y = along[:, None], along[None, :]
    ranges = np.hypot(x, y)
    planes = np.stack([ranges, x / ranges, y / ranges])[None]
    return torch.from_numpy(planes).to(memory_format=torch.channels_last)


def shapes() -> dict[str, tuple[int, ...]]:
    """The shape of every array that fixes the network, by name."""
    made: dict[str, tuple[int, ...]] = {}
    for layer in LAYERS.values():
        made[f"{layer.name}.weight"] = (layer.outputs, layer.inputs, layer.size, layer.size)
        made[f"{layer.name}.bias"] = (layer.outputs,)
    return made


class Fixed:
    """What the layers do with fixed numbers: `arrays` by the names of `shapes`."""

    def __init__(self, torch: Any, arrays: dict[str, Any]):
        self._do = torch.nn.functional
        self._points = {layer.name for layer in POINT_LAYERS}
        tensors = {name: torch.from_numpy(array) for name, array in arrays.items()}
        self._layers = {
            name: (
                tensors[f"{name}.weight"].contiguous(memory_format=torch.channels_last),
                tensors[f"{name}.bias"],
                layer,
            )
            for name, layer in LAYERS.items()
        }

    def __call__(self, name: str, told: Any) -> Any:
        """See `Apply`."""
        weight, bias, layer = self._layers[name]
        if name in self._points:
            made = self._do.linear(told, weight.flatten(1), bias)
        else:
            made = self._do.conv2d(told, weight, bias, layer.stride, layer.size // 2)
        return made.relu_() if layer.rectified else made

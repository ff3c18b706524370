"""The network in plain PyTorch: a table of its layers, and the pass through them.

The operation of a layer is an argument. Training normalises over a batch; detection uses fixed
numbers. Both share the same pass.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats
from care_sim.core.types import CLASSES

PILLAR_M = 0.5
"""Side of a pillar: a person covers one, a car about thirty."""
PILLARS = 208
"""Pillars along each side of the plan, with the sensor in its middle: 52 m each way, a range of 50
m and half a car. The number can be halved four times.
"""
CELL_M = 2 * PILLAR_M
"""Side of an output cell."""
CELLS = PILLARS // 2
REACH_M = PILLAR_M * PILLARS / 2
OWN_ROOF_M = 2.0
"""Range within which returns are the car's own roof."""
LOWEST_M, HIGHEST_M = -1.0, 4.5
"""Heights above the road between which points count: a road that falls away, and the highest bus.
"""
POINT_INPUTS = ("dx", "dy", "height", "low", "range", "cos", "sin", "z")
"""Inputs per point. Place in its pillar (sides at -1 and 1). Height above the road, metres. The
same up to 0.5 m, doubled, since a kerb differs little from a foot. Planar range over REACH_M.
Cosine and sine of its bearing. Height z in the sensor frame, metres.
"""
_LOW_M = 0.5


class Points(NamedTuple):
    """Points of the plan: `inputs` (p, len(POINT_INPUTS)) float32, `pillars` (p,) the index of the
    pillar that each stands in, row (x) by row.
    """

    inputs: NDArray[np.float32]
    pillars: NDArray[np.int64]


def on_plan(points: Floats, sensor_height_m: float) -> Points:
    """Return the network's inputs for points (P, 3) in the sensor frame. Points off the plan are
    left out.
    """
    x, y, z = points[:, :3].T
    height = z + sensor_height_m
    ranges = np.hypot(x, y)
    kept = (np.maximum(np.abs(x), np.abs(y)) < REACH_M) & (ranges > OWN_ROOF_M)
    kept &= (height > LOWEST_M) & (height < HIGHEST_M)
    x, y, z, height, ranges = (column[kept] for column in (x, y, z, height, ranges))

    places = (np.stack([x, y]) + REACH_M) / PILLAR_M
    # The last bits of a sum may lift a place to the far edge.
    rows, columns = np.minimum(places.astype(np.int64), PILLARS - 1)
    within = 2 * (places - [rows, columns]) - 1
    low = np.minimum(height, _LOW_M) / _LOW_M
    told = (*within, height, low, ranges / REACH_M, x / ranges, y / ranges, z)
    return Points(np.stack(told, axis=1).astype(np.float32), rows * PILLARS + columns)


def cell_centres() -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The middle of every cell, x (CELLS, 1) and y (1, CELLS), metres in the sensor frame."""
    along = ((np.arange(CELLS) + 0.5) * CELL_M - REACH_M).astype(np.float32)
    return along[:, None], along[None, :]


BOX_OUTPUTS = (
    "x", "y", "height", "log length", "log width", "log height", "cos", "sin", "cos 2", "sin 2",
)  # fmt: skip
"""Outputs of a cell for the box whose centre is near. Place: x and y from the middle of the cell,
and height of the centre above the road, metres. Then logarithms of the size, and yaw as a direction
and as an axis. Points show the axis, but seldom the way along it. The direction is then short, but
the axis is not.
"""
OUTPUTS = len(CLASSES) + len(BOX_OUTPUTS)

_PLACES = 3
"""Inputs per pillar: range, and cosine and sine of its bearing. Only the side of a body that faces
the sensor returns, so the place of its middle depends on the bearing.
"""


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
"""Stages with cells of 1, 2, 4 and 8 m."""
_BACK = (
    (Layer("lane_back", 128, 96, 1), Layer("lane_both", 96, 96)),
    (Layer("body_back", 96, 64, 1), Layer("body_both", 64, 64)),
    (Layer("near_back", 64, 32, 1), Layer("near_both", 32, 32)),
)
"""Layers that pass a coarser stage to the finer one before it, and combine both."""
_ANSWER = Layer("answer", 32, OUTPUTS, 1, rectified=False)
PLAN_LAYERS = (*(one for stage in (*_STAGES, *_BACK) for one in stage), _ANSWER)
LAYERS = {layer.name: layer for layer in (*POINT_LAYERS, *PLAN_LAYERS)}

Apply = Callable[[str, Any], Any]
"""Applies a layer by name, to rows (n, inputs) of points or to planes (s, inputs, h, w) of the
plan.
"""


def answers(
    torch: Any, apply: Apply, inputs: Any, pillars: Any, places: Any, scans: int = 1
) -> Any:
    """Return (scans, OUTPUTS, CELLS, CELLS): the logit of a centre in the cell per class, then
    BOX_OUTPUTS.

    `inputs` (p, len(POINT_INPUTS)) and `pillars` (p,) are the `Points` of all scans, the pillars of
    scan s counted on from s * PILLARS**2. `places` are `place_planes`.
    """
    told = inputs
    for layer in POINT_LAYERS:
        told = apply(layer.name, told)

    # The mean of its points, and their number: otherwise pillars with few fired cells look like
    # those with many.
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
    """Return (1, 3, PILLARS, PILLARS) the inputs per pillar."""
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
    """Layers with fixed numbers: `arrays` by the names of `shapes`."""

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

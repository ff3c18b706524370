"""The network of the learned detector in training: its layers normalise over a batch."""

from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from care_sim.base.array_files import Arrays
from care_sim.core.types import CLASSES
from care_sim.perception.pillars.network import (
    LAYERS,
    PILLARS,
    POINT_LAYERS,
    Layer,
    answers,
    on_plan,
    place_planes,
)
from care_sim.training.supervised.detector_data import Example

RARE = -4.0
"""Initial logit of a centre in a cell: one cell in fifty. With even odds the first steps would be
spent on unlearning them.
"""


class Learning(nn.Module):
    """Learns the arrays of `care_sim.perception.pillars.network.shapes`."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.ModuleDict({name: _module(layer) for name, layer in LAYERS.items()})
        self._places = place_planes(torch)

    def forward(self, examples: list[Example]) -> Tensor:
        """Return (s, OUTPUTS, CELLS, CELLS) the outputs for the scans of some examples."""
        seen = [on_plan(one.points.astype(np.float64), one.sensor_height_m) for one in examples]
        pillars = [one.pillars + number * PILLARS**2 for number, one in enumerate(seen)]
        inputs = torch.from_numpy(np.concatenate([one.inputs for one in seen]))
        told: Tensor = answers(
            torch,
            lambda name, given: self.layers[name](given),
            inputs,
            torch.from_numpy(np.concatenate(pillars)),
            self._places,
            len(examples),
        )
        return told

    def begin_at(self, arrays: Arrays, examples: list[Example]) -> None:
        """Start from learned weights. Each layer is normalised over some `examples`; scale and
        offset undo the normalisation, so that outputs on these examples stay.
        """
        hooks = []
        with torch.no_grad():
            for name in LAYERS:
                module: Any = self.layers[name]
                first = module[0]
                weight, bias = (
                    torch.from_numpy(arrays[f"{name}.{of}"]) for of in ("weight", "bias")
                )
                first.weight.copy_(weight.reshape(first.weight.shape))
                if first.bias is not None:
                    first.bias.copy_(bias)
                else:
                    hooks.append(first.register_forward_hook(_undone(module[1], bias)))
            self.train()
            self.forward(examples)
        for hook in hooks:
            hook.remove()

    def arrays(self) -> Arrays:
        """Return the numbers for detection."""
        made: Arrays = {}
        with torch.no_grad():
            for name, layer in LAYERS.items():
                weight, bias = _fixed(self.layers[name])
                shape = (layer.outputs, layer.inputs, layer.size, layer.size)
                made[f"{name}.weight"] = weight.reshape(shape).contiguous().numpy().copy()
                made[f"{name}.bias"] = bias.numpy().copy()
        return made


def _module(layer: Layer) -> nn.Sequential:
    if layer in POINT_LAYERS:
        return nn.Sequential(nn.Linear(layer.inputs, layer.outputs), nn.ReLU())
    planes = layer.inputs, layer.outputs, layer.size, layer.stride, layer.size // 2
    if not layer.rectified:
        answer = nn.Conv2d(*planes)
        bias = torch.zeros(layer.outputs)
        bias[: len(CLASSES)] = RARE
        answer.bias = nn.Parameter(bias)
        return nn.Sequential(answer)
    return nn.Sequential(
        nn.Conv2d(*planes, bias=False), nn.BatchNorm2d(layer.outputs), nn.ReLU(inplace=True)
    )


def _undone(normal: Any, bias: Tensor) -> Any:
    """Return a hook that makes a normalisation the identity plus a `bias`."""

    def set_up(_module: Any, _given: Any, planes: Tensor) -> None:
        mean, variance = planes.mean((0, 2, 3)), planes.var((0, 2, 3), unbiased=False)
        normal.weight.copy_(torch.sqrt(variance + normal.eps))
        normal.bias.copy_(bias + mean)
        normal.running_mean.copy_(mean)
        normal.running_var.copy_(variance)

    return set_up


def _fixed(module: Any) -> tuple[Tensor, Tensor]:
    """Return the weight and bias that equal a module in evaluation."""
    first = module[0]
    if first.bias is not None:
        return first.weight, first.bias
    # A normalisation with fixed mean and variance is linear.
    normal = module[1]
    scale = normal.weight / torch.sqrt(normal.running_var + normal.eps)
    return first.weight * scale.view(-1, 1, 1, 1), normal.bias - normal.running_mean * scale

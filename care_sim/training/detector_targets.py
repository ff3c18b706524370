"""What the network of the learned detector should have answered, and by how much its answer is off.

The loss is that of CenterPoint (Yin, Zhou, Kraehenbuehl 2021, Sec. 4): a focal loss that forgives
answers near a centre, and absolute differences of what is told of the box.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.core.arrays import Floats, Integers
from care_sim.core.types import CLASSES
from care_sim.perception.pillars.network import BOX_OUTPUTS
from care_sim.perception.pillars.plan import CELL_M, CELLS, REACH_M
from care_sim.training.detector_data import Example

SPREAD_M = (0.8, 1.6)
"""Standard deviation of the bump at a centre: of a person, and of the longest bus; between them a
quarter of the length."""
TOLD_FROM = 0.2
"""Where a bump is higher, the cell is asked for the box: neighbours of the centre tell of it, too.
"""
BOX_SHARE = 1.0
"""Of the differences of boxes in the loss."""


class Targets(NamedTuple):
    """Of s scans: `sure` (s, classes, CELLS, CELLS) bumps of height 1 at the centres, `boxes`
    (s, BOX_OUTPUTS, CELLS, CELLS), and how much each cell's box counts, `weights` (s, 1, CELLS,
    CELLS).
    """

    sure: NDArray[np.float32]
    boxes: NDArray[np.float32]
    weights: NDArray[np.float32]


def targets_of(examples: list[Example]) -> Targets:
    """What the network should answer."""
    s = len(examples)
    made = Targets(
        np.zeros((s, len(CLASSES), CELLS, CELLS), np.float32),
        np.zeros((s, len(BOX_OUTPUTS), CELLS, CELLS), np.float32),
        np.zeros((s, 1, CELLS, CELLS), np.float32),
    )
    for number, example in enumerate(examples):
        for label, box in zip(example.classes.tolist(), example.boxes, strict=True):
            own = Targets(*(table[number] for table in made))
            _mark(own, label, box, example.sensor_height_m)
    return made


def loss(torch: Any, answer: Any, wanted: Any) -> Any:
    """How much an answer (s, OUTPUTS, CELLS, CELLS) is off the `Targets` as tensors."""
    sure, told = answer[:, : len(CLASSES)], answer[:, len(CLASSES) :]
    log = torch.nn.functional.logsigmoid
    chance = torch.sigmoid(sure)
    centre = wanted.sure == 1
    missed = (1 - chance) ** 2 * log(sure) * centre
    invented = (1 - wanted.sure) ** 4 * chance**2 * log(-sure)
    centres = centre.sum().clamp(min=1)

    off = ((told - wanted.boxes).abs() * wanted.weights).sum() / wanted.weights.sum().clamp(min=1)
    return -(missed + invented).sum() / centres + BOX_SHARE * off


def box_told(
    box: Floats, sensor_height_m: float, rows: Integers, columns: Integers
) -> NDArray[np.float32]:
    """(BOX_OUTPUTS, n) what cells in these `rows` (n,) and `columns` (n,) should tell of a box
    (7,).
    """
    x, y, z, length, width, height, yaw = box.tolist()
    away_x = x - ((rows + 0.5) * CELL_M - REACH_M)
    away_y = y - ((columns + 0.5) * CELL_M - REACH_M)
    alike = [
        z + sensor_height_m, *np.log([length, width, height]),
        np.cos(yaw), np.sin(yaw), np.cos(2 * yaw), np.sin(2 * yaw),
    ]  # fmt: skip
    rest = np.repeat(np.array(alike)[:, None], len(rows), axis=1)
    return np.concatenate([away_x[None], away_y[None], rest]).astype(np.float32)


def _mark(own: Targets, label: int, box: Floats, sensor_height_m: float) -> None:
    """Enter an object into the targets of its scan."""
    spread = float(np.clip(box[3] / 4, *SPREAD_M)) / CELL_M
    centre = np.minimum(((box[:2] + REACH_M) / CELL_M).astype(np.int64), CELLS - 1)
    reach = int(np.ceil(3 * spread))
    low, high = np.maximum(centre - reach, 0), np.minimum(centre + reach + 1, CELLS)
    rows, columns = np.mgrid[low[0] : high[0], low[1] : high[1]].reshape(2, -1)
    away = (rows - centre[0]) ** 2 + (columns - centre[1]) ** 2
    bump = np.exp(-away / (2 * spread**2)).astype(np.float32)
    own.sure[label, rows, columns] = np.maximum(own.sure[label, rows, columns], bump)

    # A cell between two objects tells of the one whose bump is higher there.
    near = (bump > TOLD_FROM) & (bump > own.weights[0, rows, columns])
    rows, columns = rows[near], columns[near]
    own.weights[0, rows, columns] = bump[near]
    own.boxes[:, rows, columns] = box_told(box, sensor_height_m, rows, columns)

"""An energy budget: every shot is paid for, and a cell may have several."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_sim.base.checks import check_number
from care_sim.core.firing.base import Floor, demanded
from care_sim.core.firing.free_cells import FreeCells
from care_sim.core.grid import Cells
from care_sim.core.grid_stack import Grid

MOST_SHOTS = 100
"""Ten times the reach, as far as reach grows with the root of the shots."""


class Energy(FreeCells):
    """Free cells, each of which may be fired up to `shots` times at a keyframe; what its receiver
    counts adds up (`care_sim.sensors.signal`, `care_sim.sensors.lidar_faults`).

    The scores say how the energy is to be shared. Shots are dealt one by one, each to the cell
    whose score is the highest per shot that it would then have (as seats are dealt to parties by
    D'Hondt). So equal scores have equally many shots, all cells their first one before any its
    second, and scores of 3 to 1 ask for three shots to one. The floor spends what is left once
    every demanded cell has `shots`. With one shot that is free cells.

    No product is known that aims every shot and counts photons over several.
    """

    name = "energy"
    numbers = ("SHOTS",)
    usual = (4,)
    unit = counted = "shot"
    product = "agile scanner whose receiver counts photons over several shots of a direction"
    source = (
        "AEye, RRRWP_19_0812, for shots that revisit a direction; Ouster, US 2023/0243975 A1, "
        "abstract, for counts added up over laser cycles"
    )

    def __init__(self, grid: Grid, shots: int):
        check_number("shots of firing energy", shots, 1, MOST_SHOTS)
        super().__init__(grid)
        self.most_shots = shots

    def fire(self, scores: NDArray[Any], budget: int, floor: Floor, last: Cells) -> Cells:
        """A cell for every shot, ascending: one that is fired n times stands there n times."""
        # A score is what an action holds, float32; a share of it needs more bits.
        flat = scores.ravel().astype(np.float32).astype(np.float64)
        cells = demanded(scores)
        # The nth shot of a cell comes after n shots of every cell before it, so that no more cells
        # than the budget holds n times can have an nth shot.
        numbers = range(1, self.most_shots + 1)
        rounds = [cells[: budget // number] for number in numbers]
        claims = [flat[cells] / number for number, cells in zip(numbers, rounds, strict=True)]
        # Of equal claims the one to the lower number of a shot comes first, then the lower cell's.
        dealt = np.argsort(-np.concatenate(claims), kind="stable")[:budget]
        fired = np.concatenate(rounds)[dealt]
        if floor is not None and len(fired) < budget:
            free = floor()
            fired = np.concatenate([fired, free[flat[free] <= 0][: budget - len(fired)]])
        return np.sort(fired)

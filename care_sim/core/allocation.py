"""Algorithm 1 of the paper, the shared allocator, and Eq. 1, the budget in cells.

Exploitation comes first, then the reserve layers, then the shared random floor. In the environments
a policy calls `allocate` for lines 1 to 5, without a floor. Line 6, the floor, and the hard cap are
those of the hardware (`care_sim.core.firing`), which every action passes, whatever made it.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from care_sim.base.checks import check_number, check_whole, is_number
from care_sim.base.errors import InvalidInput, shown
from care_sim.core.allocation_kernels import bounds, fill_stages
from care_sim.core.cell_sets import CellSets, cell_indices
from care_sim.core.grid import Cells
from care_sim.core.types import Demand

HIGHEST_CELL = 2**24
"""A thousand times the cells of the paper's grid."""

_SETS = "a list of sets of cells"


def budget_cells(budget: float, cells: int, unit: str = "cell") -> int:
    """B = round(beta * N) (Eq. 1): the cells that a fraction `budget` of all `cells` is, or as many
    units of another hardware (`care_sim.core.firing`).

    Raises InvalidInput for a fraction outside (0, 1], and for one that leaves none.
    """
    if not (is_number(budget) and 0 < budget <= 1):
        raise InvalidInput(f"budget must lie in (0, 1], got {shown(budget)}")
    if round(float(budget) * cells) < 1:
        raise InvalidInput(f"budget {budget} leaves no {unit} of {cells}; {1 / cells:.2g} is one")
    return round(float(budget) * cells)


def allocate(
    demand: Demand,
    budget: int,
    reserve_fraction: float,
    floor: Sequence[int] | Cells | None = None,
) -> Cells:
    """Choose at most `budget` cells (n,), in order of selection (Algorithm 1).

    Exploitation sets fill at most round((1 - rho) B) cells, round-robin. Then each reserve layer in
    order fills up to B, round-robin. Then `floor`, a permutation of all cells, fills up to B; None
    leaves the rest unspent. Within a set, cells are taken in its own order
    (`care_sim.core.cell_order`), and a cell that is already taken costs the set no turn. rho = 0
    keeps no reserve: layers then take only what exploitation leaves. Raises InvalidInput for
    another form of demand or floor.
    """
    check_number("reserve_fraction", reserve_fraction, 0, 1)
    check_whole("budget", budget, 0, HIGHEST_CELL)
    stages = stages_of(demand)
    # A layer may use all that is left of B, so that it inherits what exploitation did not need.
    limits = [round((1 - reserve_fraction) * budget)] + [budget] * (len(stages) - 1)
    chosen = _filled(stages, limits)
    if floor is None:
        return chosen
    return np.concatenate([chosen, _free(floor, chosen, budget - len(chosen))])


def stages_of(demand: Demand) -> list[Sequence[Cells]]:
    """The sets of exploitation, then those of each reserve layer in order. Raises InvalidInput for
    another form of demand.
    """
    if not isinstance(demand, Demand):
        raise InvalidInput(f"demand must be a Demand, got {shown(demand)}")
    layers = _sequence("layers", "a list of layers", demand.layers)
    return [
        _sequence("exploitation", _SETS, demand.exploitation),
        *(_sequence("a layer", _SETS, layer) for layer in layers),
    ]


def taken_by_stage(demand: Demand, budget: int, reserve_fraction: float) -> list[Cells]:
    """The cells that each stage of a demand takes, in order of selection: exploitation, then each
    reserve layer. Joined they are what `allocate` chooses without a floor. Raises as it does.
    """
    chosen = allocate(demand, budget, reserve_fraction)
    # A stage is full before the next begins, so that without the later ones it takes the same.
    ends = [
        len(allocate(Demand(demand.exploitation, demand.layers[:count]), budget, reserve_fraction))
        for count in range(len(demand.layers))
    ]
    return np.split(chosen, ends)


def _sequence(name: str, form: str, given: Any) -> Sequence[Any]:
    """A part of a demand. Raises InvalidInput unless it is a sequence."""
    is_sequence = given.ndim if isinstance(given, np.ndarray) else isinstance(given, Sequence)
    if not is_sequence:
        raise InvalidInput(f"{name} must be {form}, got {shown(given)}")
    sequence: Sequence[Any] = given
    return sequence


def _filled(stages: Sequence[Sequence[Cells]], limits: Sequence[int]) -> Cells:
    """Stage after stage, round-robin over its sets, up to its limit in all."""
    # The sets of all stages lie in one array. A stage of the sets [3, 5] and [5, 9] and a stage of
    # the set [7] are cells [3, 5, 5, 9, 7], sizes [2, 2, 1] and counts [2, 1].
    sets = CellSets.joined([CellSets.of(stage) for stage in stages])
    counts = np.array([*map(len, stages)], np.int64)

    # A table of flags runs from the lowest to the highest cell, so its size must be bounded. The
    # grid is not known here: `care_sim.policies.base.Policy` refuses cells below 0 or beyond the
    # grid afterwards, and the table must hold them until then.
    lowest, highest = bounds(sets.cells)
    if highest - lowest > HIGHEST_CELL:
        wrong = lowest if lowest < 0 else highest
        raise InvalidInput(f"cells must lie in 0..{HIGHEST_CELL}, got {wrong}")
    most = np.array(limits, np.int64)
    return fill_stages(sets.cells, sets.sizes, counts, most, lowest, highest)


def _free(floor: Sequence[int] | Cells, chosen: Cells, count: int) -> Cells:
    """The first `count` cells of the floor that are not chosen."""
    taken = set(chosen.tolist())
    free = list[int]()
    for cell in cell_indices(floor, "floor").tolist():
        if len(free) >= count:
            break
        if cell not in taken:
            # Noted as well: a floor that names a cell twice fires it once.
            taken.add(cell)
            free.append(cell)
    return np.array(free, np.int64)

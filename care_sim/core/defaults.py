"""Constants and plain data that help and configurations load without the rest: the allocator's
defaults, and the wrappers that weights were trained behind.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from care_sim.base.checks import check_known, check_whole
from care_sim.base.errors import InvalidInput

RESERVE_FRACTION = 0.3
"""rho, the share of the budget kept for the reserve (paper, Remark 2)."""
AZIMUTH_MARGIN = 2
"""Dilation of hulls and wedges, in columns (paper, Remark 2)."""
ELEVATION_MARGIN = 1
"""Dilation of hulls and wedges, in rows (paper, Remark 2)."""
CELLS = "cells"
"""Hardware that fires every cell by itself: the paper's, and the default."""

AS_DEMANDED = "as-demanded"
CELL_ORDERS = (
    AS_DEMANDED,
    "rows-down",
    "rows-up",
    "columns",
    "random",
    "spread",
    "core-spread",
)
"""How the cells of a set can be listed:

- `as-demanded`, as the policy lists them;
- `rows-down`, row by row from the top, `rows-up`, from the bottom, both by ascending column;
- `columns`, column by column from right to left, each from the top;
- `random`, by one permutation of the grid, the same at every keyframe and for every policy;
- `spread`, by a low-discrepancy sequence: any first few cells lie evenly over the set;
- `core-spread`, first the set without the margins by which sets are dilated, then these margins,
  both spread. A set narrower than the margins keeps its middle; on the first and last row of the
  grid there is none. A set that was dilated by less loses as much all the same.
"""
HEAVIEST = 1e6
"""Largest weight of a term of the reward: sums of floats do not lose the other terms."""


ACTION_WRAPPERS = ("SectorReserve", "SectorScores")
_LINE = re.compile(r"(\w+) (\d{1,4}) x (\d{1,4}), GridObservation (\d{1,4}) x (\d{1,4})")


@dataclass(frozen=True)
class Wrapping:
    """`action` over `azimuths` x `elevations` sectors, `GridObservation` of `columns` x `rows`
    blocks.

    See `care_sim.envs.wrappers.sector_actions` and `care_sim.envs.wrappers.grid_observation`.
    Raises InvalidInput for another action, and for sectors that are not made of whole blocks.
    """

    action: str = "SectorReserve"
    azimuths: int = 32
    elevations: int = 4
    columns: int = 64
    rows: int = 8

    def __post_init__(self) -> None:
        check_known("action", self.action, ACTION_WRAPPERS)
        for name in ("azimuths", "elevations", "columns", "rows"):
            check_whole(name, getattr(self, name), 1)
        # The network slides over whole blocks from sector to sector.
        for blocks, sectors in (("columns", "azimuths"), ("rows", "elevations")):
            if getattr(self, blocks) % getattr(self, sectors):
                raise InvalidInput(
                    f"{sectors} must divide {blocks}, got {getattr(self, sectors)} and "
                    f"{getattr(self, blocks)}"
                )

    @classmethod
    def from_plain(cls, plain: Mapping[str, Any]) -> "Wrapping":
        """Read what `dataclasses.asdict` made of one. Raises InvalidInput for anything else."""
        names = [field.name for field in fields(cls)]
        if set(plain) != set(names):
            raise InvalidInput(f"wrapper must have {', '.join(names)}, got {plain!r}")
        return cls(**plain)

    @property
    def blocks_per_sector(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows // self.elevations, self.columns // self.azimuths


def wrapping_of_line(line: str) -> Wrapping:
    """Read the form of cards from before 0.2.0, the shipped ones among them: one line of text such
    as "SectorReserve 32 x 4, GridObservation 64 x 8". Raises InvalidInput for another.
    """
    found = _LINE.fullmatch(line)
    if not found:
        raise InvalidInput(
            f"wrapper {line!r} is none of the form 'SectorReserve 32 x 4, GridObservation 64 x 8'"
        )
    action, *sizes = found.groups()
    return Wrapping(action, *map(int, sizes))

"""The wrappers that weights were trained behind, as plain data, so that a policy acts and sees as
its learner did.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

from care_sim.base.checks import check_known, check_whole
from care_sim.base.errors import InvalidInput

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

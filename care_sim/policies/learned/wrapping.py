"""The wrappers that weights were trained behind, in one line of text, so that a policy acts and
sees as its learner.
"""

import re
from dataclasses import dataclass, fields

from care_sim.base.checks import check_known, check_whole
from care_sim.base.errors import InvalidInput

ACTION_WRAPPERS = ("SectorReserve", "SectorScores")
_TEXT = re.compile(r"(\w+) (\d{1,4}) x (\d{1,4}), GridObservation (\d{1,4}) x (\d{1,4})")


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
        for blocks, sectors in (("columns", "azimuths"), ("rows", "elevations")):
            if getattr(self, blocks) % getattr(self, sectors):
                raise InvalidInput(
                    f"{sectors} must divide {blocks}, got {getattr(self, sectors)} and "
                    f"{getattr(self, blocks)}"
                )

    def __str__(self) -> str:
        return (
            f"{self.action} {self.azimuths} x {self.elevations}, GridObservation {self.columns} "
            f"x {self.rows}"
        )

    @classmethod
    def parse(cls, text: str | None) -> "Wrapping":
        """Read text back. Raises InvalidInput for another."""
        found = _TEXT.fullmatch(text or "")
        if not found:
            raise InvalidInput(f"wrapper {text!r} is none of the form '{cls()}'")
        action, *sizes = found.groups()
        names = [field.name for field in fields(cls)][1:]
        return cls(action, **dict(zip(names, map(int, sizes), strict=True)))

    @property
    def blocks_a_sector(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.rows // self.elevations, self.columns // self.azimuths

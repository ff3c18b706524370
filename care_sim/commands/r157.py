"""`care-sim r157`: the preventable cut-ins of UN Regulation 157."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.core.driver_settings import FIXED
from care_sim.study.designs.r157 import r157_study


@dataclass(frozen=True, kw_only=True)
class R157(FixedStudy):
    """Play the cut-ins that the careful human driver of UN Regulation 157 prevents, and tell which
    of them every policy avoids.
    """

    seeds: tuple[int, ...] = (1,)
    """One number: that many seeds, from 0. Several numbers: these seeds, of one split; 7 7 is seed
    7 alone.
    """
    driver: str = FIXED
    """fixed, or careful-human: the regulation's driver at the wheel."""
    out: Path = Path("runs/r157")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        return self.play("r157", partial(r157_study, driver=self.driver), self.out)

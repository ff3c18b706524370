"""The command that films one seed under several policies, side by side."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from care_sim.errors import InvalidInput
from care_sim.study.options import USUAL, Options
from care_sim.study.running import console


@dataclass(frozen=True, kw_only=True)
class Clip:
    """Film the same seed under several policies, side by side."""

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """dartout, dense or cutin; `care-sim scenarios` lists them."""
    policies: tuple[str, ...] = ("history", "care")
    """`care-sim policies` lists them. `full` always runs with budget 1.0."""
    budget: float = 0.1
    """Share of the cells that may fire at a keyframe, above 0 and at most 1."""
    seed: int = 0
    """Draws scenario, camera faults, noise and floor."""
    out: Path = Path("runs/clip.gif")
    """The file: animated GIF, WebP or PNG, or MP4 (extra 'video'), by its ending."""
    conditions: Annotated[Options, tyro.conf.arg(name="")] = USUAL
    """Further conditions."""

    def __call__(self) -> int:
        """Run it."""
        from care_sim.study.config import grid
        from care_sim.study.filming import film_side_by_side

        configs = grid([self.scenario], self.policies, [self.budget], [self.seed], **self.conditions.arguments())
        if not configs:
            raise InvalidInput("--policies needs at least one value")
        film_side_by_side(configs, self.out)
        console().print(f"{' beside '.join(config.label for config in configs)}: {self.out}", soft_wrap=True)
        return 0

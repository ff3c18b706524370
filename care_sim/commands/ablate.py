"""`care-sim ablate`: the paper's ablations, one thing varied at a time."""

from dataclasses import dataclass
from pathlib import Path

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.study.designs.ablations import ablation_study


@dataclass(frozen=True, kw_only=True)
class Ablate(FixedStudy):
    """Vary one thing at a time as the paper's ablations do, one table per thing varied."""

    out: Path = Path("runs/ablate")
    """Folder of the results; an interrupted study goes on there."""

    def __call__(self) -> int:
        """Run it."""
        return self.play("ablate", ablation_study, self.out)

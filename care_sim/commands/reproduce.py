"""`care-sim reproduce`: the paper's closed-loop study beside the paper's figures."""

from dataclasses import dataclass

from care_sim.commands.shared.episode_studies import FixedStudy
from care_sim.study.designs.paper import paper_study


@dataclass(frozen=True, kw_only=True)
class Reproduce(FixedStudy):
    """Play the paper's study and print it beside the paper's figures.

    Play the paper's closed-loop study, 49 configurations per seed and those of --also, and
    print it beside the paper's figures.
    """

    def __call__(self) -> int:
        """Run it."""
        return self.play("paper", paper_study, "reproduce")

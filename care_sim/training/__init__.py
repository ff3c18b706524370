"""Training of learned policies: `care-sim train`."""

from collections.abc import Callable
from typing import Any

from care_sim.training.config import Ppo, RecurrentPpo, Sac
from care_sim.training.curves import Curves
from care_sim.training.scorer import TrainScorer

COMMANDS: dict[str, Callable[..., Any]] = {
    "ppo": Ppo,
    "sac": Sac,
    "recurrent-ppo": RecurrentPpo,
    "learned-scorer": TrainScorer,
    "curves": Curves,
}
"""What can be trained, by name; and the figure of what was."""

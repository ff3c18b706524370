"""Training of the learned policies whose weights come with the package: the commands of `care-sim train`."""

from collections.abc import Callable
from typing import Any

from care_sim.training.scorer import TrainScorer

COMMANDS: dict[str, Callable[..., Any]] = {"learned-scorer": TrainScorer}

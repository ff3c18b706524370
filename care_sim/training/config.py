"""What is trained, on what, and how long."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from care_sim.base.bounds import bounded, check_fields
from care_sim.base.checks import LARGEST_INTEGER
from care_sim.base.errors import InvalidInput
from care_sim.base.seed_ranges import TRAINING, VALIDATION
from care_sim.core.grid_rays import MOST_COLUMNS, MOST_ROWS
from care_sim.envs.reward import HEAVIEST
from care_sim.policies.learned.wrapping import Wrapping
from care_sim.study.parameters import parameters

HOW_LONG = ("steps", "out", "resume", "tensorboard", "threads", "processes")
"""Fields in which a resumed run may differ from the run before."""


@dataclass(frozen=True, kw_only=True)
class AgentConfig:
    """Fields that all learners share. `care_sim.base.seed_ranges` says which seeds are for what."""

    algorithm: ClassVar[str]

    env: str = "CARE-Dense-v0"
    """Environment id, of an installed scenario too; or a scenario as `sweep` names it."""
    budget: tuple[float, ...] = (0.03,)
    """Share of the cells that may fire per keyframe. With several values, the environments take one
    each in turn, and the weights fit any budget; the first one is evaluated."""
    env_parameters: tuple[str, ...] = ()
    """Further arguments of the environment as NAME=VALUE, for example vehicles=5
    false_negative_rate=0.2.
    """
    action: Literal["SectorReserve", "SectorScores"] = "SectorReserve"
    """What the action scores: sectors for the reserve alone, or for everything."""
    azimuths: int = bounded(32, 1, MOST_COLUMNS)
    """Sectors round the car."""
    elevations: int = bounded(4, 1, MOST_ROWS)
    """Sectors from top to bottom."""
    columns: int = bounded(64, 1, MOST_COLUMNS)
    """Blocks of the observation round the car."""
    rows: int = bounded(8, 1, MOST_ROWS)
    """Blocks of the observation from top to bottom."""
    gain: float = bounded(10.0, 0, HEAVIEST)
    """Weight of the reward term `gain` in the closed loop; the other terms keep their weights."""
    steps: int = bounded(200_000, 1, LARGEST_INTEGER)
    """Environment steps in all."""
    seed: int = bounded(0, 0, LARGEST_INTEGER)
    """Seed of the first weights, the exploration and the training episodes."""
    environments: int = bounded(8, 1, 1024)
    """Environments, or worlds, side by side."""
    processes: bool = False
    """Give every environment a process of its own. Without it they are the worlds of one vector
    environment, in threads where they are many; what is learned is the same."""
    threads: int = bounded(1, 1, 1024)
    """Threads of PyTorch. Sums are added in another order by more of them: the last bits of the
    weights differ, and then what is learned."""
    learning_rate: float = bounded(1e-3, 1e-8, 1)
    """Step size of Adam."""
    discount: float = bounded(0.9, 0, 1)
    """What a reward counts if it comes one keyframe later."""
    evaluate_every: int = bounded(20_000, 1, LARGEST_INTEGER)
    """Environment steps between evaluations. Each evaluation also writes a checkpoint."""
    episodes: int = bounded(20, 1, TRAINING - VALIDATION)
    """Held-out episodes per evaluation."""
    out: Path = Path("runs/train")
    """Folder of configuration, weights, checkpoint and learning curve."""
    resume: bool = False
    """Continue from the checkpoint in `out`."""
    tensorboard: bool = False
    """Write a log for TensorBoard into the folder: `tensorboard --logdir FOLDER` shows it."""

    def __post_init__(self) -> None:
        check_fields(self)
        if not 0 < len(self.budget) <= self.environments:
            raise InvalidInput(
                f"budget needs one value to {self.environments}, the environments; got "
                f"{self.budget}"
            )
        # Both are properties that refuse what does not fit: now, not when training begins.
        self.wrapping, self.arguments  # noqa: B018

    @property
    def wrapping(self) -> Wrapping:
        """The wrappers. Raises InvalidInput for numbers that do not fit each other."""
        return Wrapping(self.action, self.azimuths, self.elevations, self.columns, self.rows)

    @property
    def arguments(self) -> dict[str, Any]:
        """Of the environment, besides the budget."""
        given = dict(parameters(self.env_parameters))
        for name, option in (("budget", "--budget"), ("reward_weights", "--gain")):
            if name in given:
                raise InvalidInput(f"{name} is no env_parameter but set by {option}")
        return given

    def to_json(self) -> str:
        """As text that people can read."""
        plain = {"algorithm": self.algorithm} | asdict(self) | {"out": str(self.out)}
        return json.dumps(plain, indent=1) + "\n"

    @property
    def recipe(self) -> dict[str, Any]:
        """What decides the weights, as plain data: all but where and how long."""
        return {
            name: value
            for name, value in json.loads(self.to_json()).items()
            if name not in HOW_LONG
        }

    def check_same(self, before: Mapping[str, Any]) -> None:
        """Raise InvalidInput unless the run of that configuration can be gone on with.

        The message names the first difference.
        """
        for name, value in self.recipe.items():
            if before.get(name) != value:
                raise InvalidInput(
                    f"{self.out}: trained with {name} {before.get(name)!r}, asked is {value!r}"
                )


@dataclass(frozen=True, kw_only=True)
class OnPolicy(AgentConfig):
    """Fields of learners that learn from the episodes they have just played."""

    rollout: int = bounded(128, 1, 100_000)
    """Steps per environment between two updates."""
    batch: int = bounded(256, 2, 1_000_000)
    """Steps per gradient."""
    epochs: int = bounded(4, 1, 1000)
    """How often each step is used for learning."""
    noise: float = bounded(0.3, 1e-3, 10)
    """Standard deviation of the exploration at the start."""

    def __post_init__(self) -> None:
        super().__post_init__()
        # Advantages are normalised, and one alone has no deviation.
        if self.rollout * self.environments < 2:
            raise InvalidInput("rollout needs two steps or more, or two environments, got one step")


@dataclass(frozen=True, kw_only=True)
class PpoConfig(OnPolicy):
    """Train an allocator by proximal policy optimisation; its weights become the policy `ppo`."""

    algorithm = "ppo"

    hidden: int = bounded(16, 1, 4096)
    """Units per hidden layer of the network that slides over the sectors."""


@dataclass(frozen=True, kw_only=True)
class RecurrentPpoConfig(OnPolicy):
    """Train an allocator with a memory (an LSTM) by proximal policy optimisation."""

    algorithm = "recurrent-ppo"


@dataclass(frozen=True, kw_only=True)
class SacConfig(AgentConfig):
    """Train an allocator by soft actor-critic."""

    algorithm = "sac"

    memory: int = bounded(20_000, 1, 1_000_000)
    """Steps that are kept to learn from; 25 kB each."""
    batch: int = bounded(256, 2, 1_000_000)
    """Steps per gradient."""


ALGORITHMS = tuple(config.algorithm for config in (PpoConfig, RecurrentPpoConfig, SacConfig))
"""What a run may have been trained by."""

"""Configuration of a training: learner, environments, length."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal, get_args

from care_sim.base.checks import LARGEST_INTEGER, bounded, check_fields, check_known
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.seeds import TRAINING, VALIDATION
from care_sim.core.cells.rays import MOST_COLUMNS, MOST_ROWS
from care_sim.core.defaults import HEAVIEST, Wrapping
from care_sim.study.rows.parameters import parameters

Part = Literal["pictures", "place", "tracks", "faults"]
"""Parts that a training can leave out (`care_sim.training.networks`)."""
HOW_LONG = ("steps", "out", "resume", "tensorboard", "threads", "processes")
"""Fields in which a resumed run may differ from the run before."""


@dataclass(frozen=True, kw_only=True)
class AgentConfig:
    """Fields that all learners share. `care_sim.base.seeds` says which seeds are for what."""

    algorithm: ClassVar[str]

    env: tuple[str, ...] = ("CARE-Dense-v0",)
    """Environment id, also of an installed scenario, or a scenario's name as in `sweep`. Several
    need --drawn; a repeated one is drawn more often.
    """
    budget: tuple[float, ...] = (0.03,)
    """Share of the cells that may fire per keyframe. Several values are assigned to the
    environments in turn, and the weights fit any budget. The first value is evaluated; with --drawn
    all are.
    """
    env_parameters: tuple[str, ...] = ()
    """Further arguments of the environment as NAME=VALUE, for example vehicles=5
    false_negative_rate=0.2. For one of several environments: CARE-NCAP-v0.test=drawn.
    """
    drawn: bool = False
    """For every episode, draw the environment, the budget, the faults of the camera, and whether
    left and right are swapped. The reward is then minus the missed chances of a first detection, in
    every environment.
    """
    without: tuple[Part, ...] = ()
    """Parts to leave out, to measure their worth: the pictures; the place (each sector's own
    number); tracks in the pictures; faults of the camera.
    """
    action: Literal["SectorReserve", "SectorScores"] = "SectorReserve"
    """Scope of the action's sector scores: the reserve only, or everything."""
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
    """Run every environment in its own process. By default they are the worlds of one vector
    environment, with threads if they are many. The learned weights are the same.
    """
    threads: int = bounded(1, 1, 1024)
    """Threads of PyTorch. Another number changes the order of sums, the last bits of the weights,
    and so the learned policy.
    """
    learning_rate: float = bounded(1e-3, 1e-8, 1)
    """Step size of Adam."""
    discount: float = bounded(0.9, 0, 1)
    """Discount of a reward per keyframe."""
    evaluate_every: int = bounded(20_000, 1, LARGEST_INTEGER)
    """Environment steps between evaluations. Each evaluation also writes a checkpoint."""
    episodes: int = bounded(20, 1, TRAINING - VALIDATION)
    """Held-out episodes per evaluation."""
    out: Path = Path("runs/train")
    """Folder of configuration, weights, checkpoint and learning curve."""
    resume: bool = False
    """Continue from the checkpoint in `out`. Loading a checkpoint runs code from it: resume your
    own runs only."""
    tensorboard: bool = False
    """Write a log for TensorBoard into the folder: `tensorboard --logdir FOLDER` shows it."""

    def __post_init__(self) -> None:
        # A single one may be given by name.
        env: Any = self.env
        if isinstance(env, str):
            object.__setattr__(self, "env", (env,))
        check_fields(self)
        check_drawn(self)
        if not self.budget:
            raise InvalidInput("budget needs one value or more")
        if len(self.budget) > self.environments and not self.drawn:
            raise InvalidInput(
                f"budget needs one value to {self.environments}, the environments; got "
                f"{self.budget}"
            )
        # Both raise errors now, not when training begins.
        _ = self.wrapping, [self.arguments(name) for name in self.env]

    @property
    def wrapping(self) -> Wrapping:
        """Return the wrappers. Raises InvalidInput for numbers that do not fit each other."""
        return Wrapping(self.action, self.azimuths, self.elevations, self.columns, self.rows)

    def arguments(self, env: str) -> dict[str, Any]:
        """Return the arguments of one of the environments, without the budget: shared ones and its
        own.
        """
        for name, _ in parameters(self.env_parameters):
            whose, dot, _ = name.rpartition(".")
            if dot:
                check_known(f"environment of env_parameter {name}", whose, self.env)
        given = arguments_of(self.env_parameters, env)
        for name, option in (("budget", "--budget"), ("reward_weights", "--gain")):
            if name in given:
                raise InvalidInput(f"{name} is no env_parameter but set by {option}")
        return given

    def to_json(self) -> str:
        """Return readable JSON text."""
        plain = {"algorithm": self.algorithm} | asdict(self) | {"out": str(self.out)}
        # A single one by name, as in earlier versions.
        plain["env"] = self.env[0] if len(self.env) == 1 else self.env
        return json.dumps(plain, indent=1) + "\n"

    @property
    def recipe(self) -> dict[str, Any]:
        """Return everything that decides the weights, as plain data: all but the folder and the
        length.
        """
        return {
            name: value
            for name, value in json.loads(self.to_json()).items()
            if name not in HOW_LONG
        }

    def check_same(self, before: Mapping[str, Any]) -> None:
        """Raise InvalidInput unless a run of this configuration can be resumed. The message names
        the first difference.
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
        # Advantages are normalised, and a single one has no deviation.
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


def arguments_of(env_parameters: Sequence[str], env: str) -> dict[str, Any]:
    """Return the arguments NAME=VALUE of one of several environments. Its own, ENV.NAME=VALUE,
    override shared ones in any order. Raises InvalidInput for another form.
    """
    given, own = dict[str, Any](), dict[str, Any]()
    for name, value in parameters(env_parameters):
        whose, dot, bare = name.rpartition(".")
        if whose in ("", env):
            (own if dot else given)[bare] = value
    return given | own


def check_drawn(config: AgentConfig) -> None:
    """Raise InvalidInput for options that need drawn episodes, or do not fit them."""
    if not config.env or not all(isinstance(name, str) for name in config.env):
        raise InvalidInput(f"env needs one name or more, got {shown(config.env)}")
    for part in config.without:
        check_known("part to be without", part, get_args(Part))
    # These learners have their own layers, which distinguish sectors.
    if "place" in config.without and not isinstance(config, PpoConfig):
        raise InvalidInput(f"without place needs ppo: {config.algorithm} sees all sectors at once")
    if config.drawn:
        if config.gain != type(config).gain:
            raise InvalidInput("gain weighs a term of another reward than that of --drawn")
        return
    if len(config.env) > 1:
        raise InvalidInput(f"{len(config.env)} environments need --drawn: each episode is of one")
    if "faults" in config.without:
        raise InvalidInput("without faults needs --drawn: else env_parameters alone say faults")


ALGORITHMS = tuple(config.algorithm for config in (PpoConfig, RecurrentPpoConfig, SacConfig))
"""Configurations of learners."""

"""Configuration of a training: what is trained, on what, and how long."""

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
"""What can be left out (`care_sim.training.networks`)."""
HOW_LONG = ("steps", "out", "resume", "tensorboard", "threads", "processes")
"""Fields in which a resumed run may differ from the run before."""


@dataclass(frozen=True, kw_only=True)
class AgentConfig:
    """Fields that all learners share. `care_sim.base.seeds` says which seeds are for what."""

    algorithm: ClassVar[str]

    env: tuple[str, ...] = ("CARE-Dense-v0",)
    """Environment id, of an installed scenario too; or a scenario as `sweep` names it. Several need
    --drawn; one that is named twice is drawn twice as often."""
    budget: tuple[float, ...] = (0.03,)
    """Share of the cells that may fire per keyframe. With several values, the environments take one
    each in turn, and the weights fit any budget; the first one is evaluated. With --drawn all
    are."""
    env_parameters: tuple[str, ...] = ()
    """Further arguments of the environment as NAME=VALUE, for example vehicles=5
    false_negative_rate=0.2; of one of several as CARE-NCAP-v0.test=drawn.
    """
    drawn: bool = False
    """Draw for every episode which of the environments, which budget, which faults of the camera,
    and whether left and right change places. The reward is then minus the chances of a first
    detection that were missed, in every environment."""
    without: tuple[Part, ...] = ()
    """What to leave out, to see what it is worth: the pictures; the place, that is the number of
    its own that each sector has; what the pictures tell of tracks; faults of the camera."""
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
    """Continue from the checkpoint in `out`. Loading a checkpoint runs code from it: resume your
    own runs only."""
    tensorboard: bool = False
    """Write a log for TensorBoard into the folder: `tensorboard --logdir FOLDER` shows it."""

    def __post_init__(self) -> None:
        # One alone may be given as its name.
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
        # Both refuse what does not fit: now, not when training begins.
        _ = self.wrapping, [self.arguments(name) for name in self.env]

    @property
    def wrapping(self) -> Wrapping:
        """The wrappers. Raises InvalidInput for numbers that do not fit each other."""
        return Wrapping(self.action, self.azimuths, self.elevations, self.columns, self.rows)

    def arguments(self, env: str) -> dict[str, Any]:
        """Return the arguments of one of the environments, besides the budget: those of all, and
        its own.
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
        """As text that people can read."""
        plain = {"algorithm": self.algorithm} | asdict(self) | {"out": str(self.out)}
        # One alone as its name, as it was before there could be several.
        plain["env"] = self.env[0] if len(self.env) == 1 else self.env
        return json.dumps(plain, indent=1) + "\n"

    @property
    def recipe(self) -> dict[str, Any]:
        """Return everything that decides the weights, as plain data: all but where and how long."""
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


def arguments_of(env_parameters: Sequence[str], env: str) -> dict[str, Any]:
    """The arguments NAME=VALUE of one of several environments: those of all, over which its own,
    ENV.NAME=VALUE, win wherever they stand. Raises InvalidInput for another form.
    """
    given, own = dict[str, Any](), dict[str, Any]()
    for name, value in parameters(env_parameters):
        whose, dot, bare = name.rpartition(".")
        if whose in ("", env):
            (own if dot else given)[bare] = value
    return given | own


def check_drawn(config: AgentConfig) -> None:
    """Raise InvalidInput for what fits drawn episodes alone, or does not fit them."""
    if not config.env or not all(isinstance(name, str) for name in config.env):
        raise InvalidInput(f"env needs one name or more, got {shown(config.env)}")
    for part in config.without:
        check_known("part to be without", part, get_args(Part))
    # Layers of their own tell them one sector from another.
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
"""What a run may have been trained by."""

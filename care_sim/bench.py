"""How fast the environments are on this machine, beside a known one, and where a keyframe's time goes."""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.utils.performance import benchmark_init, benchmark_step
from rich.console import Console

from care_sim.control import BrakingController
from care_sim.envs.sensing import Observed
from care_sim.errors import InvalidInput
from care_sim.perception.detectors import ReturnsDetector
from care_sim.perception.memory import TrackMemory
from care_sim.policies.base import Policy
from care_sim.sensors.camera import CameraDetector, Picture
from care_sim.sensors.lidar import Lidar
from care_sim.study.config import ENVIRONMENTS, EpisodeConfig
from care_sim.study.episode import peak_rss_mb
from care_sim.study.provenance import machine, versions
from care_sim.study.table import Table
from care_sim.types import Belief
from care_sim.world.bullet import BulletWorld
from care_sim.world.world import World

TARGET_STEPS_PER_S = 100.0
TARGET_MEMORY_MB = 500.0
"""What the benchmark promises for its default configuration, on one core and for one process."""

REFERENCE = "highway-fast-v0"
"""highway-env's fast environment under random actions: driving without sensors."""

POLICY = "policy + allocation"
STAGES: dict[str, tuple[tuple[type, str], ...]] = {
    "camera": ((BulletWorld, "body_ids"), (Picture, "of"), (CameraDetector, "detect")),
    "cast": ((Lidar, "fire"),),
    "detect": ((ReturnsDetector, "detect"),),
    "track": ((TrackMemory, "update"), (TrackMemory, "predict"), (TrackMemory, "tracks")),
    "control": ((BrakingController, "command"),),
    "world step": ((World, "advance"),),
    "observation": ((Belief, "to_observation"),),
}
"""The callables that make up each stage of a keyframe; none of them calls another."""

Environment = gymnasium.Env[Any, Any]
Report = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class BenchConfig:
    """Measure the speed of the environments, one process, beside highway-env in the same run."""

    scenario: str = "dense"
    """Scenario whose keyframe is taken apart and whose speed is held against the target."""
    budget: float = 0.10
    """Budget fraction, 0 to 1."""
    policy: str = "care"
    """Policy that chooses the cells."""
    seed: int = 0
    """Seed of the first episode."""
    seconds: float = 3.0
    """Duration of every single measurement."""
    repeats: int = 5
    """Rounds; in each round every environment is measured once."""
    out: Path | None = None
    """File for the figures as JSON."""

    def __post_init__(self) -> None:
        if not self.seconds > 0:
            raise InvalidInput(f"seconds must be positive, got {self.seconds}")
        if self.repeats < 1:
            raise InvalidInput(f"repeats must be at least 1, got {self.repeats}")


class Driven(gymnasium.Wrapper[Observed, Any, Any, Any]):
    """An environment that a policy steers, whatever the action: speed measures need no agent."""

    def __init__(self, env: Environment, policy: Policy):
        super().__init__(env)
        self.action_space = spaces.Discrete(1)
        self.policy = policy

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observed, Report]:
        """Begin an episode."""
        self.policy.reset()
        self._observation, info = self.env.reset(seed=seed, options=options)
        return self._observation, info

    def step(self, action: Any) -> tuple[Observed, Any, bool, bool, Report]:
        """Let the policy act."""
        result = self.env.step(self.policy(self._observation))
        self._observation = result[0]
        return result


def run(config: BenchConfig) -> int:
    """Measure, print the tables, write the JSON; 0 whether or not the targets are met."""
    if config.out is not None:
        config.out.parent.mkdir(parents=True, exist_ok=True)
        config.out.touch()
    report = measure(config)
    console = Console(highlight=False)
    for table in tables(report):
        console.print(table.rich())
    if config.out is not None:
        config.out.write_text(json.dumps(report, indent=2) + "\n")
    return 0


def measure(config: BenchConfig) -> Report:
    """All figures of a run: `machine`, `versions`, `speed`, `stages`, `memory_mb`, `targets`."""
    makers = _makers(config)
    main = ENVIRONMENTS[config.scenario]
    speed: dict[str, dict[str, list[float]]] = {name: {"steps_per_s": [], "inits_per_s": []} for name in makers}
    stages = []
    _stages(config, makers[main])
    for _ in range(config.repeats):
        for name, maker in makers.items():
            for figure, value in _speed(maker, config).items():
                speed[name][figure].append(value)
        stages.append(_stages(config, makers[main]))
    reached = float(np.median(speed[main]["steps_per_s"]))
    memory = peak_rss_mb()
    return {
        "config": {name: value for name, value in asdict(config).items() if name != "out"},
        "machine": machine(),
        "versions": versions(),
        "speed": speed,
        "ratio": reached / float(np.median(speed[REFERENCE]["steps_per_s"])),
        "stages": {name: [stage[name] for stage in stages] for name in stages[0]},
        "memory_mb": memory,
        "targets": {
            f"{main}: at least {TARGET_STEPS_PER_S:.0f} steps/s": reached >= TARGET_STEPS_PER_S,
            f"below {TARGET_MEMORY_MB:.0f} MB": memory < TARGET_MEMORY_MB,
        },
    }


def tables(report: Report) -> list[Table]:
    """The figures for people: speed, stages, and whether the targets are met."""
    where, libraries = report["machine"], report["versions"]
    place = f"{where['processor']}, {where['cores']} cores, {where['system']}"
    speeds = [
        (name, *(_spread(figures[key]) for key in ("steps_per_s", "inits_per_s")))
        for name, figures in report["speed"].items()
    ]
    stages = [(name, _spread(values)) for name, values in report["stages"].items()]
    targets = [(name, "met" if met else "not met") for name, met in report["targets"].items()]
    return [
        Table(
            f"Speed, one process: median (least to most) of {report['config']['repeats']}",
            ("environment", "steps/s, resets included", "constructions with reset/s"),
            tuple(speeds),
            (
                place,
                ", ".join(f"{name} {number}" for name, number in libraries.items()),
                f"{report['ratio']:.2f} times the steps/s of {REFERENCE}",
            ),
        ),
        Table("Where a keyframe's time goes, ms", ("stage", "median (least to most)"), tuple(stages)),
        Table(
            "Targets", ("target", ""), tuple(targets), (f"peak memory of this process {report['memory_mb']:.0f} MB",)
        ),
    ]


def _spread(values: list[float]) -> str:
    low, middle, high = (float(np.quantile(values, q)) for q in (0.0, 0.5, 1.0))
    digits = 1 if middle >= 10 else 2
    return f"{middle:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"


def _makers(config: BenchConfig) -> dict[str, Callable[[], Environment]]:
    """Makers of every environment measured, the chosen scenario first."""
    chosen = EpisodeConfig(config.scenario, config.policy, config.budget, config.seed)
    names = sorted(ENVIRONMENTS, key=lambda name: name != config.scenario)
    makers = {ENVIRONMENTS[name]: partial(_driven, replace(chosen, scenario=name)) for name in names}
    return {**makers, REFERENCE: partial(gymnasium.make, f"highway_env:{REFERENCE}", disable_env_checker=True)}


def _driven(config: EpisodeConfig) -> Environment:
    env = config.make_env()
    return Driven(env, config.make_policy(env))


def _speed(maker: Callable[[], Environment], config: BenchConfig) -> dict[str, float]:
    seconds = cast("int", config.seconds)
    with maker() as env:
        steps = benchmark_step(env, seconds, config.seed)
    with ExitStack() as made:
        inits = benchmark_init(partial(_one_at_a_time, maker, made), seconds, config.seed)
    return {"steps_per_s": steps, "inits_per_s": inits}


def _one_at_a_time(maker: Callable[[], Environment], made: ExitStack) -> Environment:
    """A new environment in the place of the one before, which `benchmark_init` leaves open."""
    made.close()
    return made.enter_context(maker())


def _stages(config: BenchConfig, maker: Callable[[], Environment]) -> dict[str, float]:
    """Mean milliseconds a keyframe of every stage over one episode, and quantiles of the policy's."""
    with maker() as env, ExitStack() as watches:
        env.reset(seed=config.seed)
        stages = {POLICY: ((type(env.get_wrapper_attr("policy")), "__call__"),), **STAGES}
        calls = {name: [watches.enter_context(_timed(*part)) for part in parts] for name, parts in stages.items()}
        whole, keyframes = _to_the_end(env)
    spent = {name: sum(map(sum, parts)) for name, parts in calls.items()}
    spent |= {"the rest": whole - sum(spent.values()), "whole keyframe": whole}
    choices = {f"{POLICY}, p{q}": 1e3 * float(np.percentile(calls[POLICY][0], q)) for q in (50, 99)}
    return {name: 1e3 * seconds / keyframes for name, seconds in spent.items()} | choices


def _to_the_end(env: Environment) -> tuple[float, int]:
    """Seconds and keyframes until the episode ends."""
    started, keyframes, ended = time.perf_counter(), 0, False
    while not ended:
        _, _, terminated, truncated, _ = env.step(0)
        keyframes, ended = keyframes + 1, terminated or truncated
    return time.perf_counter() - started, keyframes


@contextmanager
def _timed(owner: type, name: str) -> Iterator[list[float]]:
    """The durations, in seconds, of the calls of `owner.name` while this lasts."""
    durations: list[float] = []
    inherited, original = name not in vars(owner), vars(owner).get(name)
    call = getattr(owner, name)

    def timed(*arguments: Any, **named: Any) -> Any:
        started = time.perf_counter()
        try:
            return call(*arguments, **named)
        finally:
            durations.append(time.perf_counter() - started)

    setattr(owner, name, staticmethod(timed) if isinstance(original, classmethod) else timed)
    try:
        yield durations
    finally:
        delattr(owner, name) if inherited else setattr(owner, name, original)

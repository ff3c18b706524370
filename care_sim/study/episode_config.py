"""The configuration of an episode of the closed loop: everything that decides it, checked when it
is written down.
"""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from itertools import product
from math import prod
from typing import Any, Self, cast

import gymnasium

from care_sim.base.checks import check_seed
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import COLUMNS_WHERE_CHANGED, DEFAULTS, ClosedLoopConditions
from care_sim.core.sensor_setup import SensorSetup
from care_sim.envs import ENVIRONMENT_IDS, make_scenario_env
from care_sim.envs.closed_loop import KEYFRAME_S, ClosedLoopEnv
from care_sim.envs.vector.arguments import why_separate
from care_sim.perception.detectors import PROXY
from care_sim.policies.base import PrivilegedPolicy
from care_sim.scenarios import SCENARIOS, make_scenario
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_columns
from care_sim.study.provenance import detector_digest, scenario_digest
from care_sim.study.run_config import (
    CONDITION_NAMES,
    Parameters,
    Row,
    RunConfig,
    SimilarityKey,
    check_size,
    collected,
    departures,
    effective_conditions,
    files_in,
    flat,
)


@dataclass(frozen=True)
class EpisodeConfig(ClosedLoopConditions, RunConfig):
    """Everything that decides an episode.

    The fields are the arguments of the environments (see
    `care_sim.envs.closed_loop.ClosedLoopEnv`); those of detector, scenario and policy are
    pairs of name and value. Raises InvalidInput for anything that scenario, environment or policy
    does not accept.
    """

    scenario: str
    policy: str
    budget: float = 0.1
    seed: int = 0
    keyframe_s: float = KEYFRAME_S
    # Made, since a field with a name for its default takes nothing but names.
    sensor: str | SensorSetup = field(default_factory=lambda: DEFAULT_SETUP)
    detector: str = PROXY
    detector_parameters: Parameters = ()
    scenario_parameters: Parameters = ()
    policy_parameters: Parameters = ()

    def __post_init__(self) -> None:
        check_seed(self.seed)
        self.check_parameters("detector_parameters", "scenario_parameters", "policy_parameters")
        make_scenario(self.scenario, **dict(self.scenario_parameters))
        _check_shared(self.scenario)
        # Making the environment and the policy is the check of all other fields: they alone know
        # what they accept.
        with self.make_env() as env:
            policy = self.make_policy(env)
            alone = (
                isinstance(policy, PrivilegedPolicy) or why_separate(closed_loop(env)) is not None
            )
        # No field: it follows from them, and is nothing that decides the row.
        object.__setattr__(self, "_alone", alone)
        super().__post_init__()

    def with_seed(self, seed: int) -> Self:
        """The same with another seed. What is sound for one seed is sound for all, so that only the
        seed is checked.
        """
        check_seed(seed)
        return self.changed(seed=int(seed))

    def make_env(self) -> gymnasium.Env[Any, Any]:
        """The environment of this episode, not yet reset."""
        return make_scenario_env(
            self.scenario,
            budget=self.budget,
            keyframe_s=self.keyframe_s,
            sensor=self.sensor,
            detector=self.detector,
            detector_parameters=dict(self.detector_parameters),
            **{name: getattr(self, name) for name in CONDITION_NAMES},
            **dict(self.scenario_parameters),
        )

    def row(self) -> Row:
        """All parameters, flat; those of detector, scenario and policy as `detector.NAME`,
        `scenario.NAME`, `policy.NAME`. `sensor`, `detector`, `keyframe_s` and
        `COLUMNS_WHERE_CHANGED` are columns only where they are not the default.
        """
        plain = {n: getattr(self, n) for n in PLAIN_FIELDS if n not in COLUMNS_WHERE_CHANGED}
        # Without the columns the rows, and the digests made of them, stay as they were before there
        # was a choice.
        own = {"detector": PROXY, "keyframe_s": KEYFRAME_S}
        chosen = own | {name: DEFAULTS[name] for name in COLUMNS_WHERE_CHANGED}
        other = {n: getattr(self, n) for n, usual in chosen.items() if getattr(self, n) != usual}
        return (
            plain
            | sensor_columns(self.sensor)
            | other
            | flat("detector", self.detector_parameters)
            | flat("scenario", self.scenario_parameters)
            | flat("policy", self.policy_parameters)
        )

    def installed(self) -> list[str | None]:
        """Those of the base; of another detector than the default, and of a scenario that is not
        built in, its hash and those of the files that its parameters name.
        """
        own = super().installed()
        if self.detector != PROXY:
            own += [detector_digest(self.detector), *files_in(self.detector_parameters)]
        if self.scenario not in SCENARIOS:
            own += [scenario_digest(self.scenario), *files_in(self.scenario_parameters)]
        return own

    @property
    def label(self) -> str:
        """A short name for people: scenario, policy, budget, seed and what departs from the
        defaults.
        """
        main = ("scenario", "policy", "budget", "seed", "sensor_hash", "sensor_setup")
        changes = departures(self, main)
        return " ".join(
            [f"{self.scenario} {self.policy} {self.budget:.4g} seed {self.seed}", *changes]
        )

    @property
    def order(self) -> int:
        """The seed: an interrupted study leaves whole pairs of policies, up to a batch of each."""
        return self.seed

    @property
    def alone(self) -> bool:
        """Whether it is played by itself: for a privileged policy, which asks its own world for the
        truth, and in worlds that are not played as arrays (`care_sim.envs.vector.arguments`).
        """
        return bool(vars(self)["_alone"])

    @property
    def batch(self) -> Hashable:
        """Everything but the seed, of those that can be played together."""
        return self if self.alone else self.changed(seed=0)

    @property
    def similarity_keys(self) -> tuple[SimilarityKey, ...]:
        """Everything but the seed; scenario, policy and budget; the policy; nothing."""
        all_but_seed = tuple(item for item in self.row().items() if item[0] != "seed")
        return all_but_seed, (self.scenario, self.policy, self.budget), (self.policy,), ()


def closed_loop(env: gymnasium.Env[Any, Any]) -> ClosedLoopEnv:
    """The environment of an episode without what Gymnasium puts around it."""
    return cast(ClosedLoopEnv, env.unwrapped)


def _check_shared(scenario: str) -> None:
    """Raise InvalidInput for a scenario that this process alone knows: workers would not find it,
    and nothing would tell its code.
    """
    if scenario in SCENARIOS and scenario not in ENVIRONMENT_IDS:
        raise InvalidInput(
            f"scenario {scenario} is registered by hand, which other processes do not see: name "
            "its class as MODULE:OBJECT, or install it"
        )


PLAIN_FIELDS = ["scenario", "policy", "budget", "seed", *CONDITION_NAMES]
"""Fields that are one value."""


def grid(
    scenarios: Iterable[str],
    policies: Iterable[str],
    budgets: Sequence[float],
    seeds: Sequence[int],
    false_negative_rates: Sequence[float] = (0.0,),
    camera_latencies: Sequence[int] = (0,),
    **common: Any,
) -> list[EpisodeConfig]:
    """All combinations, without repeats; `full` runs once for all that it does not feel.

    `common` are further fields of `EpisodeConfig`.
    """
    axes: list[Sequence[Any]] = [
        [*scenarios],
        [*policies],
        budgets,
        false_negative_rates,
        camera_latencies,
    ]
    # Before the configurations are made: each one makes an environment.
    check_size(prod(map(len, axes)))
    configs = (
        _config(
            scenario,
            policy,
            budget,
            {"false_negative_rate": rate, "camera_latency": latency} | common,
        )
        for scenario, policy, budget, rate, latency in product(*axes)
    )
    # Without repeats: for the full scan all budgets give the same configuration.
    return of_seeds([*dict.fromkeys(configs)], seeds)


def of_seeds(configs: Sequence[EpisodeConfig], seeds: Sequence[int]) -> list[EpisodeConfig]:
    """The configurations with each of the seeds. Raises InvalidInput for too many, before they are
    made.
    """
    check_size(len(configs) * len(seeds))
    return [config.with_seed(seed) for config in configs for seed in dict.fromkeys(seeds)]


def of_cases(configs: Sequence[EpisodeConfig], cases: Sequence[Parameters]) -> list[EpisodeConfig]:
    """The configurations in each of the cases: parameters of the scenario, of which the caller
    knows that they are sound. Raises InvalidInput for too many, before they are made.
    """
    check_size(len(configs) * len(cases))
    return [config.changed(scenario_parameters=case) for case in cases for config in configs]


def _config(scenario: str, policy: str, budget: float, given: dict[str, Any]) -> EpisodeConfig:
    return EpisodeConfig(scenario, policy, **effective_conditions(policy, budget, given))


def listed_episodes(configs: Sequence[EpisodeConfig]) -> dict[str, Any]:
    """What `config.json` tells of the configurations, each once, with the list of its seeds."""
    return collected([asdict(config) for config in configs], "seed", "seeds")

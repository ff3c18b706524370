"""The configuration of an episode of the closed loop: everything that decides it."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import asdict, dataclass, field
from itertools import product
from math import prod
from typing import Any, cast

import gymnasium

from care_sim.base.checks import check_seed
from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import COLUMNS_WHERE_CHANGED, DEFAULTS, ClosedLoopConditions
from care_sim.core.sensor_setup import SensorSetup
from care_sim.envs import ENVIRONMENT_IDS, make_scenario_env
from care_sim.envs.closed_loop import KEYFRAME_S, ClosedLoopEnv
from care_sim.perception.detectors import PRIVILEGED, PROXY
from care_sim.policies import tags_of
from care_sim.scenarios import SCENARIOS, make_scenario
from care_sim.sensors.setups import DEFAULT_SETUP, sensor_columns, sensor_setup
from care_sim.study.provenance import detector_digest, detector_files, scenario_digest
from care_sim.study.rows.parameters import Parameters
from care_sim.study.run_config import (
    Row,
    RunConfig,
    check_size,
    collected,
    effective_conditions,
    files_in,
)

PLAIN_FIELDS = ["scenario", "policy", "budget", "seed", *DEFAULTS]
"""Fields that are one value."""


@dataclass(frozen=True)
class EpisodeConfig(ClosedLoopConditions, RunConfig):
    """Everything that decides an episode.

    The fields are the arguments of the environments (see
    `care_sim.envs.closed_loop.ClosedLoopEnv`); those of detector, scenario and policy are
    pairs of name and value. Raises InvalidInput for a seed, condition, budget, scenario or name
    that is not allowed, and for a parameter that scenario or policy does not have.
    """

    scenario: str
    policy: str
    budget: float = 0.1
    seed: int = 0
    keyframe_s: float = KEYFRAME_S
    # Made by a factory, since a field with a name as default takes only names.
    sensor: str | SensorSetup = field(default_factory=lambda: DEFAULT_SETUP)
    detector: str = PROXY
    detector_parameters: Parameters = ()
    scenario_parameters: Parameters = ()
    policy_parameters: Parameters = ()

    columns = tuple(name for name in PLAIN_FIELDS if name not in COLUMNS_WHERE_CHANGED)
    usual = {"detector": PROXY, "keyframe_s": KEYFRAME_S} | {
        name: DEFAULTS[name] for name in COLUMNS_WHERE_CHANGED
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        check_seed(self.seed)
        self.check_task(sensor_setup(self.sensor).grid)
        make_scenario(self.scenario, **dict(self.scenario_parameters))
        # Workers would not find a scenario that only this process has, and no digest would cover
        # its code.
        if self.scenario in SCENARIOS and self.scenario not in ENVIRONMENT_IDS:
            raise InvalidInput(
                f"scenario {self.scenario} is registered by hand, which other processes do not "
                "see: name its class as MODULE:OBJECT, or install it"
            )

    def make_env(self) -> gymnasium.Env[Any, Any]:
        """The environment of this episode, not yet reset."""
        return make_scenario_env(
            self.scenario,
            budget=self.budget,
            keyframe_s=self.keyframe_s,
            sensor=self.sensor,
            detector=self.detector,
            detector_parameters=dict(self.detector_parameters),
            **{name: getattr(self, name) for name in DEFAULTS},
            **dict(self.scenario_parameters),
        )

    def try_out(self) -> None:
        """Make environment and policy. Raises what they do not accept."""
        with self.make_env() as env:
            self.make_policy(env)

    def place(self) -> Row:
        """Columns of another sensor set-up than the default."""
        return sensor_columns(self.sensor)

    def installed(self) -> list[str | None]:
        """Return the hashes of installed code: the base's, and those of a non-default detector and
        a foreign scenario. Includes the files in their parameters, and the files that the detector
        declares.
        """
        own = super().installed()
        if self.detector != PROXY:
            own += [detector_digest(self.detector), *files_in(self.detector_parameters)]
            own += detector_files(self.detector, self.detector_parameters)
        if self.scenario not in SCENARIOS:
            own += [scenario_digest(self.scenario), *files_in(self.scenario_parameters)]
        return own

    @property
    def name(self) -> str:
        """Scenario, policy, budget, seed."""
        return f"{self.scenario} {self.policy} {self.budget:.4g} seed {self.seed}"

    @property
    def order(self) -> int:
        """Ordered by seed: an interrupted study leaves whole pairs of policies, up to a batch of
        each.
        """
        return self.seed

    @property
    def batch(self) -> Hashable:
        """Everything but the seed. An episode is played alone (`care_sim.study.episode_play`) if
        its policy reads truth, or if its scenario or detector is not built in.
        """
        is_known = self.scenario in SCENARIOS and self.detector in PRIVILEGED
        together = is_known and "privileged" not in tags_of(self.policy)
        return self.changed(seed=0) if together else self


def closed_loop(env: gymnasium.Env[Any, Any]) -> ClosedLoopEnv:
    """Return the environment of an episode without Gymnasium's wrappers."""
    return cast(ClosedLoopEnv, env.unwrapped)


def grid(
    scenarios: Iterable[str],
    policies: Iterable[str],
    budgets: Sequence[float],
    seeds: Sequence[int],
    false_negative_rates: Sequence[float] = (0.0,),
    camera_latencies: Sequence[int] = (0,),
    **common: Any,
) -> list[EpisodeConfig]:
    """Return all combinations, without repeats; `full` runs once for all conditions that do not
    affect it.

    `common` are further fields of `EpisodeConfig`.
    """
    axes: list[Sequence[Any]] = [
        [*scenarios],
        [*policies],
        budgets,
        false_negative_rates,
        camera_latencies,
    ]
    check_size(prod(map(len, axes)))
    configs = []
    for scenario, policy, budget, rate, latency in product(*axes):
        given = {"false_negative_rate": rate, "camera_latency": latency} | common
        felt = effective_conditions(policy, budget, given)
        configs.append(EpisodeConfig(scenario, policy, **felt))
    # Without repeats: for the full scan all budgets give the same configuration.
    return of_seeds([*dict.fromkeys(configs)], seeds)


def of_seeds(configs: Sequence[EpisodeConfig], seeds: Sequence[int]) -> list[EpisodeConfig]:
    """The configurations with each of the seeds. Raises InvalidInput for too many, before they are
    made.
    """
    check_size(len(configs) * len(seeds))
    # A configuration that is sound for one seed is sound for all, so only the seed is checked.
    for seed in seeds:
        check_seed(seed)
    own = [int(seed) for seed in dict.fromkeys(seeds)]
    return [config.changed(seed=seed) for config in configs for seed in own]


def of_cases(configs: Sequence[EpisodeConfig], cases: Sequence[Parameters]) -> list[EpisodeConfig]:
    """The configurations in each of the cases: parameters of the scenario, of which the caller
    knows that they are sound. Raises InvalidInput for too many, before they are made.
    """
    check_size(len(configs) * len(cases))
    return [config.changed(scenario_parameters=case) for case in cases for config in configs]


def listed_episodes(configs: Sequence[EpisodeConfig]) -> dict[str, Any]:
    """Return the entry of the configurations in `config.json`, each once, with the list of its
    seeds.
    """
    return collected([asdict(config) for config in configs], "seed", "seeds")

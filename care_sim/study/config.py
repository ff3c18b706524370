"""What an episode is made of: checked when written down, and named by a digest."""

import hashlib
import json
from collections.abc import Iterable, Sequence
from copy import copy
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from itertools import product
from typing import Any

import gymnasium
import numpy as np

import care_sim
from care_sim.conditions import UNFELT_BY_FULL, Conditions
from care_sim.envs import CLOSED_LOOP
from care_sim.errors import check_whole
from care_sim.policies import make_policy
from care_sim.policies.base import Policy
from care_sim.scenarios import make_scenario
from care_sim.study.provenance import SESSION, code_digest, policy_digest

Parameters = tuple[tuple[str, Any], ...]
"""Names and values, of a scenario's physics or of a policy."""

ENVIRONMENTS = {name.split("-")[1].lower(): name for name in CLOSED_LOOP}
"""Environment id of every scenario."""

LARGEST_SEED = 2**63 - 1
"""What a column of a results file holds."""


@dataclass(frozen=True)
class EpisodeConfig(Conditions):
    """Everything that decides an episode.

    The fields are the arguments of the environments (see `care_sim.envs.closed_loop.ClosedLoopEnv`);
    `scenario_parameters` and `policy_parameters` are pairs of name and value. Raises InvalidInput for
    anything that scenario, environment or policy does not accept.
    """

    scenario: str
    policy: str
    budget: float = 0.1
    seed: int = 0
    scenario_parameters: Parameters = ()
    policy_parameters: Parameters = ()

    def __post_init__(self) -> None:
        _check_seed(self.seed)
        for name in ("scenario_parameters", "policy_parameters"):
            object.__setattr__(self, name, tuple((key, _plain(value)) for key, value in getattr(self, name)))
        make_scenario(self.scenario, **dict(self.scenario_parameters))
        with self.make_env() as env:
            self.make_policy(env)
        super().__post_init__()

    def with_seed(self, seed: int) -> "EpisodeConfig":
        """The same of another seed; what is sound for one is for all, so that only the seed is checked."""
        _check_seed(seed)
        other = copy(self)
        object.__setattr__(other, "seed", int(seed))
        return other

    def make_env(self) -> gymnasium.Env[Any, Any]:
        """The environment of this episode, not yet reset."""
        return gymnasium.make(
            f"care_sim:{ENVIRONMENTS[self.scenario]}",
            disable_env_checker=True,
            budget=self.budget,
            **{field.name: getattr(self, field.name) for field in fields(Conditions)},
            **dict(self.scenario_parameters),
        )

    def make_policy(self, env: gymnasium.Env[Any, Any]) -> Policy:
        """The policy of this episode for its environment."""
        return make_policy(self.policy, env, **dict(self.policy_parameters))

    def row(self) -> dict[str, Any]:
        """Every parameter flat; those of scenario and policy as `scenario.NAME` and `policy.NAME`."""
        flat = {name: getattr(self, name) for name in PLAIN_FIELDS}
        flat |= {f"scenario.{name}": value for name, value in self.scenario_parameters}
        return flat | {f"policy.{name}": value for name, value in self.policy_parameters}

    def digest(self) -> str:
        """Hash of the effective configuration; package version, code and an installed policy's code included.

        It never repeats in another run when an installed policy has no source to read.
        """
        installed = policy_digest(self.policy)
        code = [code_digest(), self._session if installed is None else installed]
        effective = [sorted(self.row().items()), care_sim.__version__, *code]
        return hashlib.sha256(json.dumps(effective).encode()).hexdigest()[:16]

    @cached_property
    def _session(self) -> str:
        """The run that first asked for the digest, which the workers keep."""
        return SESSION

    @property
    def label(self) -> str:
        """A short name for people: scenario, policy, budget, seed and what departs from the defaults."""
        usual = {field.name: field.default for field in fields(self)}
        main = ("scenario", "policy", "budget", "seed")
        changes = [f"{n}={v}" for n, v in self.row().items() if n not in main and v != usual.get(n)]
        return " ".join([f"{self.scenario} {self.policy} {self.budget:.4g} seed {self.seed}", *changes])


PLAIN_FIELDS = ["scenario", "policy", "budget", "seed", *(field.name for field in fields(Conditions))]
"""Fields that are one value."""

_USUAL = {field.name: field.default for field in fields(Conditions)}


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
    axes = list(product(budgets, false_negative_rates, camera_latencies))
    configs = (
        _config(scenario, policy, budget, {"false_negative_rate": rate, "camera_latency": latency} | common)
        for scenario, policy in product(scenarios, policies)
        for budget, rate, latency in axes
    )
    return [config.with_seed(seed) for config in dict.fromkeys(configs) for seed in dict.fromkeys(seeds)]


def _config(scenario: str, policy: str, budget: float, given: dict[str, Any]) -> EpisodeConfig:
    if policy == "full":
        budget, given = 1.0, given | {name: _USUAL[name] for name in UNFELT_BY_FULL}
    return EpisodeConfig(scenario, policy, budget, **given)


def _check_seed(seed: object) -> None:
    check_whole("seed", seed, 0, LARGEST_SEED)


def _plain(value: Any) -> Any:
    """A parameter's value as Python's own type, which files can hold."""
    return value.item() if isinstance(value, np.generic) else tuple(value) if isinstance(value, list) else value


def without_seeds(configs: Sequence[EpisodeConfig]) -> list[dict[str, Any]]:
    """The configurations as plain data, each once, with the list of its seeds."""
    seeds: dict[str, list[int]] = {}
    kept: dict[str, dict[str, Any]] = {}
    for config in configs:
        plain = asdict(config)
        seed = plain.pop("seed")
        key = json.dumps(plain)
        kept[key] = plain
        seeds.setdefault(key, []).append(seed)
    return [{**plain, "seeds": seeds[key]} for key, plain in kept.items()]

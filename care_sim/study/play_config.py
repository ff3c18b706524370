"""Configurations of the open loop: a policy in a scene, and a policy on the belief of a driver."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import asdict, dataclass, fields
from itertools import product
from math import prod
from typing import Any, Self

import gymnasium

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import COLUMNS_WHERE_CHANGED, DEFAULTS, OF_BOTH_LOOPS, Conditions
from care_sim.envs.open_loop import UNFILMED, FilmEnv
from care_sim.evaluation.sightings import ANNOTATED, check_presence
from care_sim.loops.film import Film
from care_sim.perception.detectors import PROXY
from care_sim.policies import check_policy
from care_sim.sensors.setups import sensor_setup
from care_sim.sources.scenes import Scene, Source
from care_sim.study.kept_films import kept_film
from care_sim.study.provenance import detector_digest, detector_files, source_digests
from care_sim.study.rows.parameters import Parameters
from care_sim.study.run_config import (
    FULL,
    REFERENCE,
    Row,
    RunConfig,
    check_size,
    collected,
    effective_conditions,
    files_in,
    parameters_for,
)

_FILMED = [name for name in OF_BOTH_LOOPS if name not in UNFILMED]
_PLAIN = [name for name in _FILMED if name not in COLUMNS_WHERE_CHANGED]


@dataclass(frozen=True)
class PlayConfig(Conditions, RunConfig):
    """Everything that decides a play: the scene of a source, the policy, the detector, the rule of
    presence at scene start (`care_sim.evaluation.sightings`), the conditions.

    Raises InvalidInput for a condition, budget or name that is not allowed, and for a parameter
    that the policy does not have. Whether the scene can be read shows when it is played.
    """

    source: Source
    scene: Scene
    policy: str
    budget: float = 0.1
    detector: str = PROXY
    detector_parameters: Parameters = ()
    policy_parameters: Parameters = ()
    presence: str = ANNOTATED

    columns = ("policy", "budget", "detector", *_PLAIN)
    usual = {"presence": ANNOTATED} | {
        name: DEFAULTS[name] for name in _FILMED if name not in _PLAIN
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in UNFILMED:
            if getattr(self, name) != DEFAULTS[name]:
                raise InvalidInput(
                    f"{name} cannot be changed in the open loop: its films are made without it"
                )
        check_presence(self.presence)
        self.source.check_returns(self.filmed)
        self.check_task(sensor_setup(self.source.sensor).grid)

    def of_scene(self, scene: Scene, floor_seed: int) -> Self:
        """Return the same play in another scene with another floor, which need no check."""
        return self.changed(scene=scene, floor_seed=floor_seed)

    def film(self) -> Film:
        """The film of the scene. Raises InvalidInput where it cannot be made."""
        return kept_film(self.source, self.scene, self.filmed)

    def make_env(self, film: Film) -> FilmEnv:
        """The environment of this play, not yet reset, over the film of its scene."""
        return FilmEnv(film, **self._arguments())

    def try_out(self) -> None:
        """Make environment and policy, for any film: a generated street needs no data. Raises what
        they do not accept.
        """
        with gymnasium.make(
            "care_sim:CARE-Street-v0",
            disable_env_checker=True,
            sensor=self.source.sensor,
            **self._arguments(),
        ) as env:
            self.make_policy(env)

    def place(self) -> Row:
        """Columns of the source and the scene."""
        return self.source.row(self.scene) | {"scene": self.scene.name}

    def installed(self) -> list[str | None]:
        """Return the hashes of installed code: those of the base, of the detector, of the files
        that it reads or its parameters name, and of a foreign source.
        """
        return [
            *super().installed(),
            detector_digest(self.detector),
            *files_in(self.detector_parameters),
            *detector_files(self.detector, self.detector_parameters),
            *source_digests(self.source),
        ]

    @property
    def name(self) -> str:
        """Scene, policy, budget."""
        return f"{self.scene.name} {self.policy} {self.budget:.4g}"

    @property
    def batch(self) -> Hashable:
        """All plays of a scene share its film, unless other pulses return in it."""
        return self.source, self.scene, self.filmed

    def _arguments(self) -> dict[str, Any]:
        conditions = {name: getattr(self, name) for name in _FILMED}
        own = {name: getattr(self, name) for name in ("budget", "detector", "presence")}
        return own | {"detector_parameters": dict(self.detector_parameters)} | conditions


PLAY_FIELDS = ["source", "scene", *PlayConfig.columns]
"""Columns that every row of a play has."""


def play_grid(
    source: Source,
    scenes: Sequence[Scene],
    policies: Iterable[str],
    budgets: Sequence[float],
    floor_seeds: Sequence[int] = (0,),
    camera_latencies: Sequence[int] = (0,),
    **common: Any,
) -> list[PlayConfig]:
    """Return all combinations, scene by scene and without repeats; `full` plays once for all
    conditions that do not affect it.

    `common` are further fields of `PlayConfig`.
    """
    axes: list[Sequence[Any]] = [camera_latencies, [*policies], budgets]
    check_size(prod(map(len, axes)))
    made = []
    for latency, policy, budget in product(*axes):
        felt = effective_conditions(policy, budget, {"camera_latency": latency} | common)
        made.append(PlayConfig(source, scenes[0], policy, **felt))
    floors = {config: floor_seeds if config.policy != FULL else (0,) for config in made}
    check_size(len(scenes) * sum(map(len, floors.values())))
    return [
        config.of_scene(scene, floor_seed)
        for scene in scenes
        for config, own in floors.items()
        # The full scan fires every cell, and a seed of the floor changes nothing in it.
        for floor_seed in own
    ]


def listed_plays(configs: Sequence[PlayConfig]) -> dict[str, Any]:
    """The scenes, and the configurations that were played in all of them, as plain data, each once
    with the list of its floor seeds.
    """
    scenes = list(dict.fromkeys(config.scene for config in configs))
    # All scenes have the same configurations, so that those of the first tell all.
    hidden = (*UNFILMED, "scene")
    plain = [
        {name: value for name, value in asdict(config).items() if name not in hidden}
        | {"source": config.source.kind}
        for config in configs
        if config.scene == scenes[0]
    ]
    return {
        "scenes": [scene.name for scene in scenes],
        **collected(plain, "floor_seed", "floor_seeds"),
    }


@dataclass(frozen=True)
class MechanismConfig(PlayConfig):
    """A play of `policy`, with its demands on the belief of `driver`, the policy that plays. Raises
    InvalidInput as `PlayConfig` does, and for an impossible driver.
    """

    driver: str = REFERENCE

    columns = (*PlayConfig.columns, "driver")

    def __post_init__(self) -> None:
        check_policy(self.driver)
        # Its budget is all cells, so no policy could differ from it at another budget.
        if self.driver == FULL:
            raise InvalidInput(f"driver must be a policy with a budget, got {FULL!r}")
        super().__post_init__()

    @classmethod
    def of(cls, play: PlayConfig, driver: str) -> Self:
        """The same play, with a driver."""
        own = {field.name: getattr(play, field.name) for field in fields(PlayConfig)}
        return cls(**own, driver=driver)


def mechanism_plays(
    source: Source,
    scenes: Sequence[Scene],
    policies: Sequence[str],
    *,
    budget: float,
    driver: str,
    **common: Any,
) -> list[MechanismConfig]:
    """Return the driver, the `policies` and the full scan, scene by scene. `common` are further
    fields of `PlayConfig`, except the single floor.

    Raises InvalidInput for parameters of the driver: rows name the driver, but have no column for
    its parameters.
    """
    if own := parameters_for(driver, common.get("policy_parameters", ())):
        raise InvalidInput(
            f"the driver {driver} plays without parameters, got {own[0][0]}: give those of another "
            "policy as POLICY.NAME=VALUE"
        )
    everyone = dict.fromkeys([driver, *policies, FULL])
    check_size(len(scenes) * len(everyone))
    # One scene's are checked, and the others are the same in another scene.
    floor_seed = common.pop("floor_seed", 0)
    first = [
        MechanismConfig.of(play, driver)
        for play in play_grid(source, scenes[:1], everyone, [budget], [floor_seed], **common)
    ]
    return [config.of_scene(scene, config.floor_seed) for scene in scenes for config in first]

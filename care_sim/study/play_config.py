"""The configuration of a play of the open loop: a policy in a scene whose film they all share."""

from collections.abc import Hashable, Iterable, Sequence
from dataclasses import asdict, dataclass
from itertools import product
from math import prod
from typing import Any, Self

import gymnasium

from care_sim.base.errors import InvalidInput
from care_sim.core.conditions import COLUMNS_WHERE_CHANGED, DEFAULTS, OF_BOTH_LOOPS, Conditions
from care_sim.envs.open_loop import UNFILMED, FilmEnv
from care_sim.evaluation.sightings import ANNOTATED
from care_sim.loops.film import Film
from care_sim.perception.detectors import PROXY
from care_sim.sources.scenes import Scene, Source
from care_sim.study.parameters import Parameters
from care_sim.study.provenance import detector_digest, source_digests
from care_sim.study.run_config import (
    FULL,
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

_FILMED = [name for name in OF_BOTH_LOOPS if name not in UNFILMED]
_PLAIN = [name for name in _FILMED if name not in COLUMNS_WHERE_CHANGED]


@dataclass(frozen=True)
class PlayConfig(Conditions, RunConfig):
    """Everything that decides a play: the scene of a source, the policy, the detector, who counts
    as present at scene start (`care_sim.evaluation.sightings`), the conditions.

    Raises InvalidInput for anything that environment, detector or policy does not accept. Whether
    the scene can be read shows when it is played.
    """

    source: Source
    scene: Scene
    policy: str
    budget: float = 0.1
    detector: str = PROXY
    detector_parameters: Parameters = ()
    policy_parameters: Parameters = ()
    presence: str = ANNOTATED

    def __post_init__(self) -> None:
        self.check_parameters("detector_parameters", "policy_parameters")
        for name in UNFILMED:
            if getattr(self, name) != DEFAULTS[name]:
                raise InvalidInput(
                    f"{name} cannot be changed in the open loop: its films are made without it"
                )
        self.source.check_returns(self.filmed)
        with gymnasium.make(
            # Any film will do for this check, and a generated street needs no data.
            "care_sim:CARE-Street-v0",
            disable_env_checker=True,
            sensor=self.source.sensor,
            **self._arguments(),
        ) as env:
            self.make_policy(env)
        super().__post_init__()

    def of_scene(self, scene: Scene, floor_seed: int) -> Self:
        """The same in another scene with another floor, which need no check."""
        return self.changed(scene=scene, floor_seed=floor_seed)

    def film(self) -> Film:
        """The film of the scene. Raises InvalidInput where it cannot be made."""
        return self.source.film(self.scene, self.filmed)

    def make_env(self, film: Film) -> FilmEnv:
        """The environment of this play, not yet reset, over the film of its scene."""
        return FilmEnv(film, **self._arguments())

    def row(self) -> Row:
        """Every parameter flat; those of detector and policy as `detector.NAME` and `policy.NAME`.
        `presence` and `COLUMNS_WHERE_CHANGED` are columns only where they are not the default.
        """
        plain = {name: getattr(self, name) for name in ("policy", "budget", "detector", *_PLAIN)}
        own = flat("detector", self.detector_parameters) | flat("policy", self.policy_parameters)
        # Without the column the rows, and the digests made of them, stay as they were before there
        # was a choice.
        chosen = {"presence": ANNOTATED} | {n: DEFAULTS[n] for n in _FILMED if n not in _PLAIN}
        other = {n: getattr(self, n) for n, usual in chosen.items() if getattr(self, n) != usual}
        return self.source.row(self.scene) | {"scene": self.scene.name} | plain | other | own

    def installed(self) -> list[str | None]:
        """Those of the base, the hash of the detector, those of the files that its parameters name,
        and those of a source that is not built in.
        """
        return [
            *super().installed(),
            detector_digest(self.detector),
            *files_in(self.detector_parameters),
            *source_digests(self.source),
        ]

    @property
    def label(self) -> str:
        """A short name for people: scene, policy, budget and what departs from the defaults."""
        main = (
            *(name for name in self.source.row(self.scene) if name != "sensor"),
            "scene",
            "policy",
            "budget",
            *(() if self.detector != PROXY else ("detector",)),
        )
        return " ".join(
            [f"{self.scene.name} {self.policy} {self.budget:.4g}", *departures(self, main)]
        )

    @property
    def order(self) -> int:
        """Zero for all: plays come scene by scene, and that is their order."""
        return 0

    @property
    def batch(self) -> Hashable:
        """All plays of a scene share its film, unless other pulses return in it."""
        return self.source, self.scene, self.filmed

    @property
    def similarity_keys(self) -> tuple[SimilarityKey, ...]:
        """Policy, budget and detector; policy and detector; the detector; nothing."""
        return (
            (self.policy, self.budget, self.detector),
            (self.policy, self.detector),
            (self.detector,),
            (),
        )

    def _arguments(self) -> dict[str, Any]:
        conditions = {name: getattr(self, name) for name in _FILMED}
        own = {name: getattr(self, name) for name in ("budget", "detector", "presence")}
        return own | {"detector_parameters": dict(self.detector_parameters)} | conditions


PLAY_FIELDS = ["source", "scene", "policy", "budget", "detector", *_PLAIN]
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
    """All combinations, scene by scene and without repeats; `full` plays once for all that it does
    not feel.

    `common` are further fields of `PlayConfig`.
    """
    axes: list[Sequence[Any]] = [camera_latencies, [*policies], budgets]
    check_size(prod(map(len, axes)))
    made = [
        _config(source, scenes[0], policy, budget, {"camera_latency": latency} | common)
        for latency, policy, budget in product(*axes)
    ]
    floors = {config: floor_seeds if config.policy != FULL else (0,) for config in made}
    check_size(len(scenes) * sum(map(len, floors.values())))
    return [
        config.of_scene(scene, floor_seed)
        for scene in scenes
        for config, own in floors.items()
        # The full scan fires every cell, and a seed of the floor changes nothing in it.
        for floor_seed in own
    ]


def _config(
    source: Source, scene: Scene, policy: str, budget: float, given: dict[str, Any]
) -> PlayConfig:
    return PlayConfig(source, scene, policy, **effective_conditions(policy, budget, given))


def listed_plays(configs: Sequence[PlayConfig]) -> dict[str, Any]:
    """The scenes, and the configurations that were played in all of them, as plain data, each once
    with the list of its floor seeds.
    """
    scenes = list(dict.fromkeys(config.scene for config in configs))
    # All scenes have the same configurations, so that those of the first tell all.
    plain = [_plain(config) for config in configs if config.scene == scenes[0]]
    return {
        "scenes": [scene.name for scene in scenes],
        **collected(plain, "floor_seed", "floor_seeds"),
    }


def _plain(config: PlayConfig) -> dict[str, Any]:
    own = {
        name: value for name, value in asdict(config).items() if name not in (*UNFILMED, "scene")
    }
    return own | {"source": config.source.kind}

"""Plays of the scenes of the open loop: every policy of a scene meets the same film, and each play
gives one row and its events.
"""

import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, fields
from typing import Any, NamedTuple, cast

import numpy as np

import care_sim
from care_sim.base.digests import portable_bytes
from care_sim.core.belief import Belief
from care_sim.core.forgetting import released_cells
from care_sim.core.grid import Cells
from care_sim.core.residual import explained
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.evaluation.chances import Chances
from care_sim.evaluation.counts import expected_columns
from care_sim.evaluation.differences import AllocationDifference, allocation_difference
from care_sim.evaluation.recall import SceneScore, Tally
from care_sim.evaluation.strata import strata
from care_sim.loops.film import Film
from care_sim.loops.open_loop import OpenLoop, OpenLoopKeyframe, SceneKeyframe
from care_sim.policies.base import Policy
from care_sim.study.episode_play import GymEnv, peak_rss_mb, result_or_reason
from care_sim.study.play_config import PlayConfig
from care_sim.study.run_config import FULL, REFERENCE, Row

_EVENT_COLUMNS = ("keyframe", "object", "class", "range_m", "azimuth", "chances")
"""Columns of an event that do not depend on policies."""
_NAMES = (
    "source",
    "scene",
    "policy",
    "budget",
    "detector",
    "floor_seed",
    "camera_latency",
    "digest",
)
"""Columns by which an event finds its play."""


def event_sightings(score: SceneScore) -> dict[str, list[Any]]:
    """Return the events as columns; metres and radians to three decimals."""
    # Three decimals are millimetres and milliradians, finer than any sensor here.
    rows = score.event_rows()
    columns = {name: [row[name] for row in rows] for name in _EVENT_COLUMNS}
    return columns | {name: [round(v, 3) for v in columns[name]] for name in ("range_m", "azimuth")}


def event_columns(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the events of all plays as columns of one table: the play's names, the sighting, and
    the time of detection.
    """
    # One entry per event. The names of a play repeat over its events.
    counts = [len(row["ttfds"]) for row in rows]
    names = {
        name: np.repeat(np.array([row[name] for row in rows], dtype=object), counts)
        for name in _NAMES
    }
    seen = {
        name: [value for row in rows for value in row["sightings"][name]] for name in _EVENT_COLUMNS
    }
    # A TTFD of 0 keyframes is a detection at first sight.
    delays = np.array([delay for row in rows for delay in row["ttfds"]], dtype=np.int64)
    return {**names, **seen, "detected": delays == 0, "ttfd": delays}


DECISION_MS = ("policy_p50_ms", "policy_p99_ms")
"""Columns of the policy's time per keyframe."""
SUMS = tuple(field.name for field in fields(Tally))


def play_scene(batch: Sequence[PlayConfig]) -> list[Row | str]:
    """Play one scene in a worker; return per play its row, or the reason of its failure in one
    line.
    """
    scene = result_or_reason(ScenePlayer, batch[0])
    if isinstance(scene, str):
        return [scene] * len(batch)
    return [result_or_reason(scene.row, config, len(batch)) for config in batch]


@dataclass(frozen=True)
class PlayRecord:
    """Record of a play.

    `tracks`, `explained` and `released` are means per keyframe: tracks, explained camera
    detections, and cells of full hulls that exploitation does not demand. `released` is None for a
    policy without exploitation. `expected` are the columns of expected counts, empty for a detector
    without chance. `decisions_ms` are the milliseconds of every call of the policy, its process
    included. `wall_s` is in seconds.
    """

    score: SceneScore
    keyframes: list[OpenLoopKeyframe]
    tracks: float
    explained: float
    released: float | None
    expected: dict[str, float]
    decisions_ms: list[float]
    wall_s: float

    @property
    def fired(self) -> list[Cells]:
        """The cells of every keyframe."""
        return [record.fired for record in self.keyframes]


class ScenePlayer:
    """Plays policies in one scene. The plays of the reference are kept, because the others are
    compared with them.

    Raises InvalidInput where the film of the scene cannot be made.
    """

    def __init__(self, config: PlayConfig):
        started = time.perf_counter()
        self._film = config.film()
        self._film_s = time.perf_counter() - started
        self._film_hash = film_hash(self._film)
        self._references: dict[PlayConfig, PlayRecord] = {}

    def row(self, config: PlayConfig, sharers: int = 1) -> Row:
        """The row of a play.

        Columns:

        - every parameter of `PlayConfig.row`, `version` and `digest`
        - `film_hash`, equal for the same film, and `episode_hash` over fired cells and detections
        - the fields of `Tally`, those of every stratum as `KIND/STRATUM/FIELD`, `ttfds` and
          `sightings` of the events
        - `emerging`, the number of events by which the two presences differ
          (`care_sim.evaluation.sightings`)
        - `tracks`, `explained` and `released`
        - `expected/COUNT` of newcomers, for detectors with chance (`care_sim.evaluation.counts`)
        - `differing_keyframes` and `differing_cells` against the reference
        - `keyframes`, `DECISION_MS`, `peak_rss_mb`, and `wall_s` with an even share of the film's
        """
        record = self._record(config)
        score = record.score
        return {
            **config.row(),
            "version": care_sim.__version__,
            "digest": config.digest(),
            "film_hash": self._film_hash,
            "episode_hash": play_hash(record.keyframes),
            "keyframes": len(record.keyframes),
            **asdict(score.tally()),
            **_strata(score),
            "ttfds": tuple(score.delays.tolist()),
            "sightings": event_sightings(score),
            "emerging": len(score.sightings.emerging),
            "tracks": record.tracks,
            "explained": record.explained,
            "released": record.released,
            **record.expected,
            **self._difference(config, record),
            **_decision_columns(record.decisions_ms),
            "wall_s": record.wall_s + self._film_s / sharers,
            "peak_rss_mb": peak_rss_mb(),
        }

    def _record(self, config: PlayConfig) -> PlayRecord:
        # The reference may be played earlier, for a comparison, and is then kept for its row.
        if config != _reference(config):
            return play_through_film(config, self._film)
        if config not in self._references:
            self._references[config] = play_through_film(config, self._film)
        return self._references[config]

    def _difference(self, config: PlayConfig, record: PlayRecord) -> Row:
        reference = _reference(config)
        if config.policy == FULL or config == reference:
            return {"differing_keyframes": None, "differing_cells": None}
        moved: AllocationDifference = allocation_difference(
            record.fired, self._record(reference).fired
        )
        return {"differing_keyframes": moved.differing, "differing_cells": moved.cells}


def play_through_film(config: PlayConfig, film: Film) -> PlayRecord:
    """Play a policy through the film of its scene."""
    started = time.perf_counter()
    with config.make_env(film) as env:
        policy = config.make_policy(env)
        observation, _ = env.reset(seed=config.scene.seed)
        policy.reset()
        loop = env.loop
        chances = Chances.of(config.detector, dict(config.detector_parameters), env.rig)
        counts = []
        decisions_ms = []
        released = []
        while not loop.over:
            belief = loop.belief
            # Before the step: what the policy knew when it chose its cells.
            counts.append(
                (
                    len(belief.tracks),
                    int(explained(belief.detections, belief.tracks, loop.rig).sum()),
                )
            )
            asked = time.perf_counter()
            action = policy(observation)
            decisions_ms.append(1e3 * (time.perf_counter() - asked))
            observation, *_ = env.step(action)
            if chances:
                chances.note(loop)
            if (count := _released(policy, belief)) is not None:
                released.append(count)
        score = env.score
        keyframes = env.keyframes
    seen = score.sightings
    expected = expected_columns(seen, chances.of_events(seen)) if chances else {}
    tracks, explanations = np.mean(counts, axis=0).tolist()
    mean_released = float(np.mean(released)) if released else None
    wall_s = time.perf_counter() - started
    means = tracks, explanations, mean_released
    return PlayRecord(score, keyframes, *means, expected, decisions_ms, wall_s)


def _decision_columns(decisions_ms: Sequence[float]) -> Row:
    values = np.percentile(decisions_ms, (50, 99)).round(4).tolist()
    return dict(zip(DECISION_MS, values, strict=True))


def _released(policy: Policy, belief: Belief) -> int | None:
    """Return the cells released at the keyframe just played; None without exploitation."""
    if policy.demanded is None or not len(policy.demanded.exploitation):
        return None
    rig = policy.rig
    hulls = rig.hulls(belief.tracks.boxes)
    return released_cells(hulls, policy.demanded.exploitation, rig.grid.size)


def film_hash(film: Film) -> str:
    """Hash a film's content and its initially hidden objects, measured numbers rounded
    (`care_sim.base.digests`).

    A return is hashed by its cell and object, not its range: Bullet intersects round bodies by
    iteration, which turns a last bit into a millimetre.
    """
    cameras = tuple(astuple(camera) for camera in film.cameras)
    content = hashlib.sha256(
        portable_bytes(film.name, cameras, film.sensor_height_m, film.keyframe_s)
    )
    # The parts of a shot that a policy or the scoring reads, in a fixed order.
    for shot in film.shots:
        annotations = shot.annotations
        seen = shot.seen
        # With hardware that fires cells more than once the same film holds more returns.
        cloud = shot.cloud.to_shots()
        content.update(portable_bytes(shot.time_s, shot.token, astuple(shot.ego)))
        content.update(
            portable_bytes(
                annotations.objects,
                annotations.classes,
                annotations.boxes,
                seen.detections.rows(),
                seen.objects,
            )
        )
        content.update(portable_bytes(cloud.cells, cloud.objects))
        for sweep in shot.sweeps:
            content.update(portable_bytes(sweep.time_s, sweep.cloud.cells, sweep.cloud.objects))
    hidden = film.hidden
    content.update(portable_bytes(hidden.objects, hidden.classes, hidden.boxes))
    return content.hexdigest()[:16]


def _reference(config: PlayConfig) -> PlayConfig:
    """The play of the reference policy under the same conditions."""
    return config.changed(policy=REFERENCE, policy_parameters=())


def _strata(score: SceneScore) -> Row:
    return {
        f"{kind}/{label}/{name}": value
        for kind, masks in strata(score.sightings).items()
        for label, mask in masks.items()
        for name, value in asdict(score.tally(mask)).items()
    }


def play_hash(keyframes: Sequence[OpenLoopKeyframe]) -> str:
    """Hash the fired cells and the detections."""
    content = hashlib.sha256()
    for record in keyframes:
        content.update(
            portable_bytes(record.fired, record.detections.classes, record.detections.boxes)
        )
    return content.hexdigest()[:16]


SceneWatcher = Callable[[OpenLoop, SceneKeyframe], None]


class PlayedScene(NamedTuple):
    """A play: its row, the record of every keyframe and its detections (both hold truth)."""

    row: Row
    keyframes: list[SceneKeyframe]
    score: SceneScore


def trace_scene(
    config: PlayConfig,
    film: Film,
    *watchers: SceneWatcher,
    begin: Callable[[OpenLoop], None] = lambda _loop: None,
    wrap: Callable[[GymEnv, Policy], GymEnv] = lambda env, _policy: env,
) -> PlayedScene:
    """Play a policy through the film of its scene.

    The row has every parameter of `PlayConfig.row`, the fields of
    `care_sim.evaluation.recall.SceneOutcome`, `version`, `keyframes`, `wall_s` and the play's
    `episode_hash`. `begin` is called before the first keyframe, `watchers` after each; `wrap` puts
    wrappers that watch around the environment.
    """
    started = time.perf_counter()
    inner = config.make_env(film)
    policy = config.make_policy(inner)
    keyframes = []
    with wrap(inner, policy) as env:
        played = cast(OpenLoopEnv, env.unwrapped)
        observation, _ = env.reset(seed=config.scene.seed)
        policy.reset()
        begin(played.loop)
        while not played.loop.over:
            observation, *_ = env.step(policy(observation))
            keyframes.append(played.last)
            for watch in watchers:
                watch(played.loop, played.last)
        score, records = played.score, played.keyframes
    row = {
        **config.row(),
        "version": care_sim.__version__,
        **asdict(score.outcome()),
        "keyframes": len(keyframes),
        "wall_s": time.perf_counter() - started,
        "episode_hash": play_hash(records),
    }
    return PlayedScene(row, keyframes, score)

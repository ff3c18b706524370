"""Mechanism of a scene: one row per policy, of its own play and of the shared belief.

Truth (the object behind a return, a camera box or a track) is read here for the scoring. No policy
receives it.
"""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

import care_sim
from care_sim.base.errors import InvalidInput
from care_sim.core.belief import Belief
from care_sim.core.grid import Cells
from care_sim.core.residual import camera_layers, explained, wedges
from care_sim.evaluation.differences import allocation_difference
from care_sim.evaluation.rays import (
    RAY_SHARES,
    Appearance,
    ReserveUse,
    ServedDemand,
    miss_reason,
    rays_by_share,
    reserve_use,
)
from care_sim.evaluation.sightings import Sightings
from care_sim.loops.film import Film
from care_sim.loops.open_loop import OpenLoop
from care_sim.study.episode_play import peak_rss_mb, result_or_reason
from care_sim.study.play_config import MechanismConfig, PlayConfig
from care_sim.study.run_config import FULL, Row
from care_sim.study.scene_play import film_hash

_COVERAGE = 0.5
"""Share of an object's hull cells in hulls of tracks from which the object appears inside
established coverage.
"""


@dataclass(frozen=True)
class NewObject:
    """An object at its first sighting, with its true `appearance`. `hull` (n,) are the cells of a
    perfect track. `covered` is True if hulls of tracks hold at least half of them.
    """

    appearance: Appearance
    hull: Cells
    covered: bool


def new_objects(loop: OpenLoop, belief: Belief, sightings: Sightings) -> list[NewObject]:
    """Return the first sightings of the next keyframe, in the order of `sightings.events`. `belief`
    is what the policies get.
    """
    annotations = loop.shot.annotations
    rows = np.flatnonzero(sightings.appearing(loop.index))
    if not len(rows):
        return []
    pictured = loop.true_detected_objects()
    own_wedges = wedges(belief.detections, loop.rig)
    by_memory = explained(belief.detections, belief.tracks, loop.rig)
    tracked = loop.true_objects(belief.tracks)
    known = np.concatenate([*loop.rig.hulls(belief.tracks.boxes), np.empty(0, np.int64)])
    hulls = loop.rig.hulls(annotations.boxes[rows])
    made = []
    for number, hull in zip(annotations.objects[rows].tolist(), hulls, strict=True):
        boxes = np.flatnonzero(pictured == number)
        cloud = loop.shot.cloud.to_shots()
        appearance = Appearance(
            returns=cloud.cells[cloud.objects == number],
            wedges=tuple(own_wedges[box] for box in boxes.tolist()),
            explained=by_memory[boxes],
            tracked=number in tracked,
        )
        made.append(NewObject(appearance, hull, is_covered(hull, known)))
    return made


def is_covered(hull: Cells, known: Cells) -> bool:
    """Return True if an object with this `hull` (n,) appears inside established coverage: hulls of
    tracks, with cells `known` (m,), hold at least half of it.
    """
    return bool(np.isin(hull, known).sum() >= _COVERAGE * len(hull))


FOUND = ""
"""Placeholder reason without a miss."""
ACCOUNT_COLUMNS = ("ttfds", "misses", "tracked", *(f"rays_{share}" for share in RAY_SHARES))
"""Columns of the events of a row's own play, in the order of `Sightings.events`. First the censored
times to first detection in keyframes, and the reasons of misses at the first keyframe. Then marks
(1 or 0) of events that already had a track, and rays that hit them then, by share.
"""
DIFFERING = ("differing_keyframes", "differing_cells")
"""Columns of other policies that the driver lacks."""
RECEIVED = "received"
"""Cells that the policy would give to every new object of the shared belief."""
BELIEF_SUMS = ("filled", "filled_rho", "explained_cells", "untaken_cells")
"""Sums over keyframes in the driver's row: those of `ReserveUse`."""
BELIEF_MARKS = ("pictured", "falsely_explained", "covered")
"""Marks of every new object in the driver's row, 1 or 0."""


def account_play(config: PlayConfig, film: Film, sightings: Sightings) -> Row:
    """Play a policy through the film of its scene, and account for its rays: `keyframes` and
    `ACCOUNT_COLUMNS`. Raises InvalidInput for a policy without a demand.
    """
    reasons: list[str] = []
    tracked: list[int] = []
    rays = [np.empty((0, len(RAY_SHARES)), np.int64)]
    with config.make_env(film) as env:
        policy = config.make_policy(env)
        observation, _ = env.reset(seed=config.scene.seed)
        policy.reset()
        rig = env.rig
        while not env.loop.over:
            entries = new_objects(env.loop, rig.read(observation), sightings)
            observation, *_ = env.step(policy(observation))
            if not entries:
                continue
            if policy.demanded is None:
                raise InvalidInput(
                    f"policy {config.policy} states no demand, without which its rays cannot be "
                    "accounted for"
                )
            served = ServedDemand.of(policy.demanded, env.keyframes[-1].fired, rig)
            for new in entries:
                seen = new.appearance
                reasons.append(miss_reason(seen, served, config.min_returns))
                tracked.append(int(seen.tracked))
                rays.append(rays_by_share(seen.returns, served)[None])
        delays = env.score.delays.tolist()
        keyframes = len(env.keyframes)
    # Every event has a reason; only those of misses are kept.
    told = [reason if delay else FOUND for reason, delay in zip(reasons, delays, strict=True)]
    columns = (delays, told, tracked, *np.concatenate(rays).T.tolist())
    own = zip(ACCOUNT_COLUMNS, map(tuple, columns), strict=True)
    return {"keyframes": keyframes, **dict(own)}


@dataclass
class SharedBelief:
    """Events of one policy's drive through a film.

    `fired` are the cells of every keyframe by policy name; `received` counts those in the hull of
    each new object. `entries` are these objects, and `reserve` is the camera wedges' use of the
    reserve.
    """

    fired: dict[str, list[Cells]]
    received: dict[str, list[int]]
    entries: list[NewObject] = field(default_factory=list)
    reserve: ReserveUse = field(default_factory=ReserveUse)


def share_belief(
    driver: PlayConfig, others: Sequence[PlayConfig], film: Film, sightings: Sightings
) -> SharedBelief:
    """Let the `driver` play its film, and at every keyframe compute what the `others` would fire.
    They have its budget and its conditions.
    """
    with driver.make_env(film) as env:
        policies = {config.policy: config.make_policy(env) for config in (*others, driver)}
        observation, _ = env.reset(seed=driver.scene.seed)
        for policy in policies.values():
            policy.reset()
        shared = SharedBelief({name: [] for name in policies}, {name: [] for name in policies})
        rig = env.rig
        while not env.loop.over:
            # The policies read the observation, in its precision.
            belief = rig.read(observation)
            entries = new_objects(env.loop, belief, sightings)
            layers = camera_layers(belief, rig)
            hulls = rig.hulls(belief.tracks.boxes)
            shared.reserve += reserve_use(hulls, *layers, rig.budget, rig.reserve_fraction)
            actions = {name: policy(observation) for name, policy in policies.items()}
            for name, action in actions.items():
                fired = env.would_fire(action)
                shared.fired[name].append(fired)
                shared.received[name] += [int(np.isin(new.hull, fired).sum()) for new in entries]
            shared.entries += entries
            observation, *_ = env.step(actions[driver.policy])
    return shared


def play_mechanism(batch: Sequence[MechanismConfig]) -> list[Row | str]:
    """Play one scene in a worker; return per play its row, or the reason of its failure in one
    line.
    """
    scene = result_or_reason(MechanismScene, batch)
    if isinstance(scene, str):
        return [scene] * len(batch)
    return [result_or_reason(scene.row, config, len(batch)) for config in batch]


class MechanismScene:
    """A scene that the driver has played, with the demands of all others.

    Raises InvalidInput where the film of the scene cannot be made.
    """

    def __init__(self, batch: Sequence[MechanismConfig]):
        started = time.perf_counter()
        config = batch[0]
        self._film = config.film()
        self._film_hash = film_hash(self._film)
        shown = [shot.annotations for shot in self._film.shots]
        self._sightings = Sightings.of(
            self._film.name, shown, hidden=self._film.hidden, presence=config.presence
        )
        # The full scan is a bound, with its own budget, and not compared on the shared belief.
        budgeted = [one for one in batch if one.policy != FULL]
        self._shared = self._share(budgeted) if budgeted else None
        self._shared_s = time.perf_counter() - started

    def row(self, config: MechanismConfig, sharers: int = 1) -> Row:
        """Return the row of a policy; `docs/columns.md` explains its columns.

        `wall_s` includes an even share of the film's and the shared belief's time.
        """
        started = time.perf_counter()
        account = account_play(config, self._film, self._sightings)
        return {
            **config.row(),
            "version": care_sim.__version__,
            "digest": config.digest(),
            "film_hash": self._film_hash,
            **account,
            **self._shared_columns(config),
            "wall_s": time.perf_counter() - started + self._shared_s / sharers,
            "peak_rss_mb": peak_rss_mb(),
        }

    def _share(self, budgeted: Sequence[MechanismConfig]) -> SharedBelief:
        driver = budgeted[0].changed(policy=budgeted[0].driver, policy_parameters=())
        others = [config for config in budgeted if config.policy != driver.policy]
        return share_belief(driver, others, self._film, self._sightings)

    def _shared_columns(self, config: MechanismConfig) -> Row:
        """Return the columns of the policy on the shared belief; the driver's row describes that
        belief itself.
        """
        columns: Row = dict.fromkeys((*DIFFERING, RECEIVED, *BELIEF_SUMS, *BELIEF_MARKS))
        shared = self._shared
        if shared is None or config.policy == FULL:
            return columns
        columns[RECEIVED] = tuple(shared.received[config.policy])
        if config.policy != config.driver:
            moved = allocation_difference(shared.fired[config.policy], shared.fired[config.driver])
            return columns | dict(zip(DIFFERING, (moved.differing, moved.cells), strict=True))
        seen = [new.appearance for new in shared.entries]
        return (
            columns
            | {name: getattr(shared.reserve, name) for name in BELIEF_SUMS}
            | {
                "pictured": tuple(int(bool(each.wedges)) for each in seen),
                "falsely_explained": tuple(int(each.falsely_explained) for each in seen),
                "covered": tuple(int(new.covered) for new in shared.entries),
            }
        )

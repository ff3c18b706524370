"""Play the worlds of closed-loop environments: one of a single environment, many of a vector."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_sim.base.threads import ALONE, Threads
from care_sim.base.times import LAST_BITS_S
from care_sim.core.arrays import Floats, Integers, Mask, places
from care_sim.core.conditions import ClosedLoopConditions
from care_sim.core.rig import Rig
from care_sim.envs.reward import KEEP_CLEAR_M, Rewards
from care_sim.evaluation.outcomes import drive_outcome_of, outcome_of
from care_sim.loops.episode import Episode, EpisodeSeeds, most_keyframes
from care_sim.loops.false_box_pools import pool_of_another_drive
from care_sim.loops.loop import Loop
from care_sim.loops.records import Outcome, Records, Sight
from care_sim.loops.stages.choice import Choice
from care_sim.loops.stages.state import Fired
from care_sim.perception.points_only import Detector
from care_sim.scenarios.base import Scenario
from care_sim.scenarios.drive import DriveScenario
from care_sim.sensors.camera_profiles import invents_boxes
from care_sim.sensors.false_boxes import EMPTY_POOL, BoxPool
from care_sim.world.world import World


@dataclass(frozen=True)
class Setting:
    """Fixed settings of the episodes of a closed-loop environment. The `detector` is None for the
    paper's proxy; `weights` holds one of every term of the reward; `scoring_info` says whether
    infos hold what is for scoring alone.
    """

    scenario: Scenario
    rig: Rig
    conditions: ClosedLoopConditions
    detector: Detector | None
    weights: Mapping[str, float]
    secret: str
    scoring_info: bool

    def episode(self, entropy: int) -> Episode:
        """Build the beginning of an episode, without its pool. The caller closes its world."""
        seeds = EpisodeSeeds.of(entropy, self.secret)
        world = self.scenario.make_world(np.random.default_rng(seeds.scenario))
        return Episode(world, seeds.sensors, seeds.floor)

    def pool(self, entropy: int) -> BoxPool:
        """The boxes that false ones are drawn from, if there are any: those of another drive
        through this scenario.
        """
        if not invents_boxes(self.conditions):
            return EMPTY_POOL
        seeds = EpisodeSeeds.of(entropy, self.secret)
        world = self.scenario.make_world(np.random.default_rng(seeds.another))
        drive = world, self.scenario.duration_s, self.rig, self.conditions, seeds.sensors
        return pool_of_another_drive(*drive, self.detector)


class History:
    """The records of the running episodes of `worlds` worlds, of up to `keyframes` each."""

    def __init__(self, worlds: int, keyframes: int):
        # Any column is exact as a float. A row more, for worlds that rest after their last one.
        self._table = np.zeros((keyframes + 1, worlds, len(Records._fields)))
        self._all = np.arange(worlds)

    def note(self, keyframes: Integers, records: Records) -> None:
        """Keep the records of the `keyframes` (W,); a resting world keeps them until it plays
        again.
        """
        self._table[keyframes, self._all] = np.array(records, float).T

    def episode(self, world: int, keyframes: int) -> Records:
        """The first `keyframes` records of a world's episode, (keyframes,) floats each."""
        return Records(*self._table[:keyframes, world].T)


class Stepped(NamedTuple):
    """Result of a step of n worlds. Rewards, terminations and truncations (n,) are 0 and False for
    worlds that did not play. `columns` (n, ...) hold the part of `info` that all worlds have, by
    name. `single` holds the part of one world alone, by world.
    """

    rewards: Floats
    terminated: Mask
    truncated: Mask
    columns: dict[str, Any]
    single: dict[int, dict[str, Any]]


class Worlds:
    """A loop over a world for each of the `settings`, which differ at most in budget and camera.
    Each world writes the observation of its coming keyframe into its row of `observed`.

    Unless `exact`, clearances that no reward needs are bounds (`Loop`); outcomes are exact. Where
    all worlds have one budget, infos hold the cells as one array, else as one array per world.
    """

    records: Records
    """Records of the last keyframe."""

    def __init__(self, settings: Sequence[Setting], exact: bool = True, threads: Threads = ALONE):
        worlds = len(settings)
        # Settings that all worlds share are read from world 0.
        self._settings = settings
        self._first = first = settings[0]
        self._exact = exact
        rigs, conditions = [each.rig for each in settings], [each.conditions for each in settings]
        self.choice = Choice(rigs, first.conditions, threads)
        self._has_one_budget = len({rig.budget for rig in rigs}) == 1
        duration_s = first.scenario.duration_s
        detectors = [each.detector for each in settings]
        exact_below_m = np.inf if exact else KEEP_CLEAR_M
        given = detectors, exact_below_m, threads
        self.loop = Loop(rigs, conditions, duration_s, *given)
        self.observed = self.loop.observed
        self._rewards = Rewards(first.weights, worlds)
        self._history = History(worlds, most_keyframes(duration_s, first.rig.keyframe_s))
        self._is_drive = isinstance(first.scenario, DriveScenario)
        self._sights: list[list[tuple[Sight, ...]]] = [[] for _ in settings]
        self._built: dict[int, World] = {}

    def begin(self, seeds: Mapping[int, int]) -> dict[int, dict[str, Any]]:
        """Begin the episodes of `seeds`, by world; return the infos, by world."""
        episodes, infos = {}, {}
        for world, entropy in seeds.items():
            setting = self._settings[world]
            if world in self._built:
                self._built.pop(world).close()
            pool = setting.pool(entropy)
            episode = episodes[world] = setting.episode(entropy)._replace(pool=pool)
            built = self._built[world] = episode.world
            self.choice.begin(world, episode.floor)
            self._rewards.begin(world)
            self._sights[world] = []
            drawn = {"drawn": dict(built.drawn)} if built.drawn else {}
            infos[world] = {"seed": entropy, **drawn} if setting.scoring_info else {}
        self.loop.begin(episodes)
        return infos

    def fired(self, actions: NDArray[np.float32], who: Mask) -> Fired:
        """The cells that the worlds `who` (n,) fire by their rows of `actions` (n, E, A), until the
        next call. Raises InvalidInput for scores that are not finite.
        """
        return self.choice.fired(actions, who, self.loop.state.keyframes)

    def step(self, fired: Fired, who: Mask) -> Stepped:
        """Let the worlds `who` (n,) play with these cells."""
        stepped = self._played(fired, who)
        told = {
            world: {"fired": fired.cells[world, : fired.counts[world]]} | self.loop.told(world)
            for world in places(who)
        }
        if self._first.conditions.floor:
            return stepped._replace(columns=self._columns(told) | stepped.columns)
        # Cells of different numbers, as lists: they are no column.
        for world, own in told.items():
            lists = {name: values.tolist() for name, values in own.items()}
            stepped.single[world] = lists | stepped.single.get(world, {})
        return stepped

    def _columns(self, told: Mapping[int, Mapping[str, np.ndarray]]) -> dict[str, NDArray[Any]]:
        """Return the scan data `told` as columns: (W, B), or (W,) arrays of each world's own where
        budgets differ.
        """
        columns: dict[str, NDArray[Any]] = {}
        for world, own in told.items():
            for name, values in own.items():
                shape, kind = (values.shape, values.dtype) if self._has_one_budget else ((), object)
                if name not in columns:
                    columns[name] = np.zeros((len(self._settings), *shape), kind)
                # An array of objects would keep the reused table itself.
                columns[name][world] = values if self._has_one_budget else values.copy()
        return columns

    def _played(self, fired: Fired, who: Mask) -> Stepped:
        """Play the worlds `who` (n,) with these cells fired; the columns lack scan data."""
        # Asked before the keyframe, which moves the worlds on, and only while it is needed: it
        # costs rays.
        loop, first = self.loop, self._first
        needed = self._rewards.need_bound & who
        detectable = loop.detectable(needed) if needed.any() else needed
        keyframes = loop.state.keyframes.copy()
        self.records = records = loop.keyframe(fired, who)
        self._history.note(keyframes, records)
        if self._is_drive:
            for world in places(who):
                self._sights[world].append(loop.sights.get(world, ()))

        terminated = who & (~np.isnan(records.impact_speed_mps) | loop.motion.are_over(who))
        truncated = who & (loop.state.times >= first.scenario.duration_s - LAST_BITS_S)
        over = terminated | truncated
        rewards, earned = self._rewards.of(records, detectable, over, who)
        single: dict[int, dict[str, Any]] = {
            world: {"outcome": asdict(self._outcome(world, int(keyframes[world]) + 1))}
            for world in places(over)
        }
        columns: dict[str, Any] = {"braking": records.braking, "time_s": records.time_s}
        if first.scoring_info:
            columns |= {
                "detected": records.detected,
                "in_view": records.in_view,
                "clearance_m": records.clearance_m,
                "speed_mps": records.speed_mps,
                "reward_terms": earned,
            }
        return Stepped(rewards, terminated, truncated, columns, single)

    def close(self) -> None:
        """Free the simulators."""
        for built in self._built.values():
            built.close()
        self._built.clear()

    def _outcome(self, world: int, keyframes: int) -> Outcome:
        """The result of a world's episode of so many keyframes."""
        episode = self._history.episode(world, keyframes)
        impact = self.loop.impacts.get(world)
        if self._is_drive:
            built = self.loop.world(world)
            progress = built.along_m / built.goal_m
            sights = self._sights[world]
            result: Outcome = drive_outcome_of(episode, impact, sights, built.meetings, progress)
        else:
            result = outcome_of(episode, impact)
        if self._exact or result.clearance_m is None:
            return result
        appeared = float(episode.time_s[episode.in_view.argmax()])
        return replace(result, clearance_m=self.loop.motion.settle(world, appeared))

"""What plays some of the worlds of a vector environment, in one thread."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from typing import Any, NamedTuple, Protocol

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from care_sim.base.times import LAST_BITS_S
from care_sim.batch.loop import BatchLoop
from care_sim.core.arrays import Floats, Integers, Mask
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.sensing import Observed
from care_sim.envs.vector.arguments import Maker
from care_sim.envs.vector.steps import Rewards
from care_sim.evaluation.outcomes import outcome_of
from care_sim.loops.episode import most_keyframes
from care_sim.loops.records import Outcome, Records, kind_of


class History:
    """The records of the running episodes of `worlds` worlds, of up to `keyframes` each."""

    def __init__(self, worlds: int, keyframes: int):
        self._columns = Records(
            *(np.zeros((keyframes, worlds), kind_of(name)) for name in Records._fields)
        )

    def note(self, who: Mask, keyframes: Integers, records: Records) -> None:
        """Keep the records of the worlds `who` (W,), of their `keyframes` (W,)."""
        worlds = np.flatnonzero(who)
        for table, column in zip(self._columns, records, strict=True):
            table[keyframes[worlds], worlds] = column[worlds]

    def episode(self, world: int, keyframes: int) -> Records:
        """The first `keyframes` records of a world's episode, (keyframes,) each."""
        columns: Iterable[np.ndarray] = self._columns
        return Records(*(table[:keyframes, world] for table in columns))


class Stepped(NamedTuple):
    """What n worlds give at a step: rewards, terminations and truncations (n,), 0 and False of
    those that did not play; what `info` says of all in `columns` (n, ...), by name, which the next
    step may write over; and what it says of one alone in `single`, by world.
    """

    rewards: Floats
    terminated: Mask
    truncated: Mask
    columns: dict[str, Any]
    single: dict[int, dict[str, Any]]

    @classmethod
    def nothing(cls, worlds: int) -> "Stepped":
        """Of worlds of which none has played."""
        flags = np.zeros((2, worlds), np.bool_)
        return cls(np.zeros(worlds), flags[0], flags[1], {}, {})


class Worlds(Protocol):
    """Some of the worlds of a vector environment. Each writes the observation of its coming
    keyframe into its row of `observed`.
    """

    observed: Observed

    def begin(self, seeds: Mapping[int, int | None]) -> dict[int, dict[str, Any]]:
        """Begin an episode in those that have a seed or None here, as `reset` of the single
        environment does with it; their infos.
        """
        ...

    def step(self, actions: NDArray[np.float32], who: Mask) -> Stepped:
        """Let those play that are True in `who` (n,), with their rows of `actions` (n, E, A)."""
        ...

    def close(self) -> None:
        """Free what they hold."""
        ...


class CompiledWorlds:
    """A batch of worlds, one for every row of `observed`. World i is one of the environment
    `models[i]`; these differ at most in budget and camera (`BatchLoop`).

    Unless `exact`, clearances that no reward needs are bounds (`BatchLoop`); outcomes are exact.
    `one_budget` says whether all worlds of the vector environment, those of other threads too, fire
    equally many cells: infos then hold them as one array, else as one for each world.
    """

    def __init__(
        self,
        models: Sequence[ClosedLoopEnv],
        observed: Observed,
        exact: bool,
        one_budget: bool = True,
    ):
        worlds = len(models)
        # What is alike in all is asked of the first.
        self._model = model = models[0]
        self.observed = observed
        self._exact = exact
        rigs, conditions = [each.rig for each in models], [each.conditions for each in models]
        self._budgets = [rig.budget for rig in rigs]
        self._one_budget = one_budget
        duration_s = model.scenario.duration_s
        self._loop = BatchLoop(rigs, conditions, duration_s, observed, self._exact)
        self._rewards = Rewards(model.reward_weights, worlds)
        self._history = History(worlds, most_keyframes(duration_s, model.rig.keyframe_s))
        # Each world draws the seeds of its later episodes as a single environment does.
        self._generators: list[np.random.Generator | None] = [None] * worlds

    def begin(self, seeds: Mapping[int, int | None]) -> dict[int, dict[str, Any]]:
        """See `care_sim.envs.vector.worlds.Worlds`."""
        infos = dict[int, dict[str, Any]]()
        episodes = {}
        for world, seed in seeds.items():
            entropy = self._entropy(world, seed)
            episodes[world] = self._model.episode(entropy)
            self._rewards.begin(world)
            infos[world] = self._model.first_info(entropy, episodes[world].world)
        self._loop.begin(episodes)
        return infos

    def step(self, actions: NDArray[np.float32], who: Mask) -> Stepped:
        """See `care_sim.envs.vector.worlds.Worlds`."""
        # Asked before the keyframe, which moves the worlds on, and only while it is needed: it
        # costs rays.
        state = self._loop.state
        needed = self._rewards.need_bound & who
        detectable = self._loop.detectable(needed) if needed.any() else needed
        keyframes = state.keyframes.copy()
        records = self._loop.keyframe(actions, who)
        self._history.note(who, keyframes, records)

        terminated = who & ~np.isnan(records.impact_speed_mps)
        truncated = who & (state.times >= self._model.scenario.duration_s - LAST_BITS_S)
        over = terminated | truncated
        rewards, terms = self._rewards.of(records, detectable, over, who)
        single: dict[int, dict[str, Any]] = {
            world: {"outcome": asdict(self._outcome(world, keyframes[world] + 1))}
            for world in np.flatnonzero(over).tolist()
        }
        if not self._model.conditions.floor:
            self._list_fired(single, who)
        # There are columns even where nobody plays: they are joined with those of other threads.
        columns = self._columns(records, terms)
        return Stepped(rewards, terminated, truncated, columns, single)

    def boxes(self, world: int) -> Floats:
        """(n, 7) of the ego and then every actor of a world, in the world frame. Truth."""
        state = self._loop.state
        # Ids count up as bodies are added. Before the ego there is the ground alone.
        bodies = slice(state.egos.bodies[world], state.bodies.counts[world])
        boxes: Floats = state.bodies.boxes[world, bodies]
        return boxes

    def close(self) -> None:
        """Free what the loop holds."""
        self._loop.close()

    def _outcome(self, world: int, keyframes: int) -> Outcome:
        """The result of a world's episode of so many keyframes."""
        episode = self._history.episode(world, keyframes)
        result = outcome_of(episode, self._loop.impacts.get(world))
        if self._exact or result.clearance_m is None:
            return result
        appeared = float(episode.time_s[episode.in_view.argmax()])
        return replace(result, clearance_m=self._loop.least_clearance_m(world, appeared))

    def _columns(self, records: Records, terms: dict[str, Any]) -> dict[str, Any]:
        """What `info` says of all worlds, in the order of the single environment."""
        scan = {}
        if self._model.conditions.floor:
            scan["fired"] = self._all_fired()
        return self._model.keyframe_info(scan, records, terms)

    def _all_fired(self) -> NDArray[Any]:
        """(W, B) the cells of all worlds, or (W,) arrays of each world's own."""
        cells, budgets = self._loop.fired.cells, self._budgets
        if self._one_budget:
            return cells[:, : budgets[0]]
        fired = np.empty(len(budgets), object)
        fired[:] = [row[:budget].copy() for row, budget in zip(cells, budgets, strict=True)]
        return fired

    def _list_fired(self, single: dict[int, dict[str, Any]], who: Mask) -> None:
        """Cells of different numbers, as lists: they are no column."""
        counts, cells = self._loop.fired
        for world in np.flatnonzero(who).tolist():
            fired = cells[world, : counts[world]].tolist()
            single[world] = {"fired": fired, **single.get(world, {})}

    def _entropy(self, world: int, seed: int | None) -> int:
        if seed is not None:
            self._generators[world], _ = seeding.np_random(int(seed))
            return int(seed)
        generator = self._generators[world]
        if generator is None:
            generator, _ = seeding.np_random()
            self._generators[world] = generator
        return int(generator.integers(2**32))


class SeparateWorlds:
    """One environment, which one of `makers` makes, for every row of `observed`."""

    def __init__(self, makers: Sequence[Maker], observed: Observed):
        self.observed = observed
        self._envs = [make() for make in makers]

    def begin(self, seeds: Mapping[int, int | None]) -> dict[int, dict[str, Any]]:
        """See `care_sim.envs.vector.worlds.Worlds`."""
        infos = {}
        for world, seed in seeds.items():
            observation, infos[world] = self._envs[world].reset(seed=seed)
            self._show(world, observation)
        return infos

    def step(self, actions: NDArray[np.float32], who: Mask) -> Stepped:
        """See `care_sim.envs.vector.worlds.Worlds`."""
        stepped = Stepped.nothing(len(who))
        for world in np.flatnonzero(who).tolist():
            observation, reward, terminated, truncated, info = self._envs[world].step(
                actions[world]
            )
            self._show(world, observation)
            stepped.rewards[world] = reward
            stepped.terminated[world], stepped.truncated[world] = terminated, truncated
            stepped.single[world] = info
        return stepped

    def close(self) -> None:
        """Free the simulators."""
        for env in self._envs:
            env.close()

    def _show(self, world: int, observation: Observed) -> None:
        for name, values in observation.items():
            self.observed[name][world] = values

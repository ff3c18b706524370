"""One reward for both loops: chances of a first detection that were missed.

A newcomer is whom the episode is about: in the closed loop the first-sighting actor, of a drive
everybody whom it lets the ego meet; in the open loop the object of a first-sighting event, for the
keyframes after which the time to first detection is censored. At a keyframe there is a chance if
the newcomer has never been detected and a scan of every cell would give it the returns that the
proxy needs. A chance that is missed costs 1.

So a return is minus the time to first detection (paper, Remark 1) in keyframes, less what the full
scan needs: 0 is the full scan's, and the best. No term tells of collisions. They are rare, at most
one in an episode, and follow what is seen late.
"""

from typing import Any, Protocol

import gymnasium
import numpy as np

from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.envs.sensing import sensing
from care_sim.evaluation.recall import CENSORED_AT


class MissedChances(gymnasium.Wrapper[Any, Any, Any, Any]):
    """Pays minus the chances that a keyframe missed, in the place of the reward.

    It asks the truth, as every reward may. Observation and action stay as they are.
    """

    _count: "_Count"

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode."""
        begun = self.env.reset(seed=seed, options=options)
        inner = sensing(self.env)
        if isinstance(inner, OpenLoopEnv):
            self._count = _InScene(inner)
        else:
            assert isinstance(inner, ClosedLoopEnv)
            self._count = _InWorld(inner)
        return begun

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Go on to the next keyframe."""
        # Before the world moves on.
        self._count.look()
        observation, _, terminated, truncated, info = self.env.step(action)
        return observation, -float(self._count.missed()), terminated, truncated, info


class _Count(Protocol):
    """Counts the chances of the episodes of a loop."""

    def look(self) -> None:
        """See who could be detected, before the keyframe."""
        ...

    def missed(self) -> int:
        """How many of them were not, after it."""
        ...


class _InWorld:
    """Of the closed loop."""

    def __init__(self, env: ClosedLoopEnv):
        self._env = env
        world = env.loop.world
        first = world.first_sighting
        met = [one.body for one in world.meetings]
        self._unseen = {*(met or ([] if first is None else [first.body]))} & {*world.labels()}
        self._chances: list[int] = []

    def look(self) -> None:
        self._chances = [body for body in self._unseen if self._env.loop.would_detect(body)]

    def missed(self) -> int:
        record, world = self._env.keyframes[-1], self._env.loop.world
        if world.meetings:
            pairs = zip(world.meetings, record.sights, strict=True)
            seen = {one.body for one, sight in pairs if sight.detected}
        else:
            seen = self._unseen if record.detected else set()
        self._unseen = self._unseen - seen
        return sum(body in self._unseen for body in self._chances)


class _InScene:
    """Of the open loop."""

    def __init__(self, env: OpenLoopEnv):
        self._env = env
        self._ages: dict[int, int] = {}

    def look(self) -> None:
        pass

    def missed(self) -> int:
        last = self._env.last
        shot = self._env.loop.film.shots[last.index]
        objects = shot.annotations.objects
        for number in objects[last.appearing].tolist():
            self._ages[number] = 0
        for number in objects[last.found].tolist():
            self._ages.pop(number, None)
        waiting = np.isin(objects, [*self._ages]) & last.scored
        self._ages = {
            number: age + 1 for number, age in self._ages.items() if age + 1 < CENSORED_AT
        }
        if not waiting.any():
            return 0
        returns = shot.cloud.to_shots().objects
        return sum(
            int(np.count_nonzero(returns == number)) >= self._env.min_returns
            for number in objects[waiting].tolist()
        )

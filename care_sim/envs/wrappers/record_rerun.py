"""Record episodes of any agent for the Rerun viewer."""

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium

from care_sim.base.checks import check_path
from care_sim.base.errors import InvalidInput, shown
from care_sim.base.extras import import_rerun
from care_sim.core.types import Action
from care_sim.envs.closed_loop import ClosedLoopEnv
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.watcher import Watched, Watcher
from care_sim.policies.base import Policy


class Watching(gymnasium.Wrapper[Any, Action, Any, Action], ABC):
    """Records the keyframes of the loop under it.

    It may stand around or inside wrappers that change the action. With the `policy` that acts, the
    shares of exploitation and reserve are known. Raw actions show only the chosen cells and those
    of the floor.

    Raises InvalidInput for an environment that is no loop of CARE-Sim.
    """

    def __init__(self, env: gymnasium.Env[Any, Action], policy: Policy | None = None):
        inner = getattr(env, "unwrapped", None)
        name = type(self).__name__
        if not (isinstance(env, gymnasium.Env) and isinstance(inner, ClosedLoopEnv | OpenLoopEnv)):
            raise InvalidInput(f"{name} watches a loop of CARE-Sim, got {shown(env)}")
        if not isinstance(policy, Policy | None):
            raise InvalidInput(
                f"policy of {name} must be a care_sim.Policy or None, got {shown(policy)}"
            )
        super().__init__(env)
        self._inner: Any = inner
        self._policy = policy
        self._watcher: Watcher | None = None
        self._begun = False
        self._episodes = 0

    @abstractmethod
    def begin(self, loop: Any, episode: int) -> None:
        """An episode begins, number `episode` from 0: its first keyframe is about to be played."""

    def look(self, loop: Any) -> None:
        """A keyframe is about to be played."""

    @abstractmethod
    def keep(self, watched: Watched) -> None:
        """A keyframe was played."""

    @abstractmethod
    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """The episode is over.

        `outcome` is that of `info`; None for one that was left.
        """

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode. One that was left before its end is closed as it is."""
        self._leave(None)
        answer = super().reset(seed=seed, options=options)
        self._watcher = Watcher(self._inner.loop, self._inner.conditions.camera_confidence)
        return answer

    def step(self, action: Action) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Play a keyframe and keep its record."""
        if self._watcher is None:
            return super().step(action)
        loop = self._inner.loop
        # Not at the reset: one that is followed by another reset leaves no empty file.
        if not self._begun:
            self.begin(loop, self._episodes)
            self._begun = True
            self._episodes += 1
        # The situation is read before the step, which moves the world.
        situation = self._watcher.situation()
        self.look(loop)
        observation, reward, terminated, truncated, info = super().step(action)
        demand = self._policy.demanded if self._policy is not None else None
        inner = self._inner
        record = inner.last if isinstance(inner, OpenLoopEnv) else inner.keyframes[-1]
        self.keep(self._watcher.watched(situation, inner.acted, demand, record))
        if terminated or truncated:
            self._leave(info.get("outcome"))
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Close what is kept, then the environment."""
        try:
            self._leave(None)
        finally:
            super().close()

    def _leave(self, outcome: Mapping[str, Any] | None) -> None:
        begun = self._begun
        self._begun = False
        self._watcher = None
        if begun:
            self.end(outcome)


def numbered(path: Path, episode: int) -> Path:
    """Where an episode is kept.

    The first is kept in `path` itself, later ones beside it, with their number.
    """
    if not episode:
        return path
    # A path such as ".." has no name to number.
    path = path if path.stem.strip(".") else path.resolve()
    return path.with_stem(f"{path.stem}-{episode}")


if TYPE_CHECKING:
    from care_sim.viewer.recording.recording import RecordedEpisode, Recording


def _recording_class() -> "type[Recording]":
    """The class, imported when somebody records.

    Its module imports Rerun, of the optional extra 'viewer', and this wrapper can be imported
    without it. Raises MissingExtra without Rerun.
    """
    import_rerun()
    from care_sim.viewer.recording.recording import Recording

    return Recording


def recording(path: Path, lanes: Sequence[str], open_loop: bool = False) -> "Recording":
    """A file for several episodes, which `RecordRerun` takes in the place of a path; to be closed.

    `lanes` are the names of the episodes, all of the closed or of the open loop.
    Raises as `RecordRerun` does.
    """
    return _recording_class()(path, lanes, open_loop)


class RecordRerun(Watching):
    """Records every episode, of either loop, for the Rerun viewer: `care-sim view FILE`.

    The first episode becomes `path`, later ones `NAME-1.rrd`, `NAME-2.rrd` beside it. An episode
    that is left before its end is kept as far as it was played. A file appears whole or not at all,
    once its episode is over or the environment is closed. Action, observation, reward and episode
    stay as they are.

    ### Arguments
    `path` of the file; `policy`, the `care_sim.Policy` that acts, if one does. Its demands show
    which cells were exploitation and which reserve; without it only "chosen" and "floor" are known.
    `name` of the episode in the recording, the policy's by default. Environments of a vector need
    one file each, such as `f"out-{number}.rrd"`.

    ### What is recorded
    At every keyframe: the street, the returns, the camera's picture and detections, the cells, the
    measures. `care_sim.viewer.recording.entities.ENTITIES` lists each with unit and frame, and so
    does the page "About" of the recording. Timelines are `keyframe` and `seconds`.

    Raises `care_sim.MissingExtra` without the extra `viewer`. Raises `care_sim.InvalidInput` for an
    environment that is no loop of CARE-Sim and for a file that is a folder or is already being
    written. Raises OSError if the file cannot be written.

    ### Example
    ```python
    env = gymnasium.make("CARE-Dartout-v0")
    policy = care_sim.make_policy("history", env)
    with RecordRerun(env, "out.rrd", policy=policy) as env:
        observation, info = env.reset(seed=0)
        env.step(policy(observation))  # and so on, until terminated or truncated
    ```
    """

    _recording: "Recording"
    _episode: "RecordedEpisode"

    def __init__(
        self,
        env: gymnasium.Env[Any, Action],
        path: "str | PathLike[str] | Recording",
        policy: Policy | None = None,
        name: str | None = None,
    ):
        super().__init__(env, policy)
        if not isinstance(path, _recording_class()):
            check_path("path", path)
        if not isinstance(name, str | None):
            raise InvalidInput(f"name must be a text, got {shown(name)}")
        if isinstance(path, str | PathLike):
            self._path: Path | None = Path(fspath(path))
        else:
            self._path, self._recording = None, path
        self._name = name or (policy.name if policy is not None else "") or "agent"

    def begin(self, loop: OneWorld | OpenLoop, episode: int) -> None:
        """Open the file of this episode, or its lane in a file that was given."""
        if self._path is not None:
            self._recording = recording(
                numbered(self._path, episode), [self._name], isinstance(loop, OpenLoop)
            )
        self._episode = self._recording.episode(self._name, loop)

    def look(self, loop: Any) -> None:
        """Take the camera's picture."""
        self._episode.look(loop)

    def keep(self, watched: Watched) -> None:
        """Log the keyframe."""
        self._episode.keep(watched)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Finish the episode, and the file if it is its own."""
        with nullcontext() if self._path is None else self._recording:
            self._episode.end(outcome)

"""The wrapper that records episodes for the Rerun viewer, whoever acts in them."""

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
from care_sim.envs.wrappers.watching import Watching, numbered
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.watcher import Watched
from care_sim.policies.base import Policy

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
    `path` of the file; `policy`, the `care_sim.Policy` that acts, if one does. Its demands tell
    which cells were exploitation and which reserve; without it only "chosen" and "floor" are known.
    `name` of the episode in the recording, the policy's by default. Environments of a vector need
    one file each, such as `f"out-{number}.rrd"`.

    ### What is recorded
    At every keyframe: the street, the returns, the camera's picture and detections, the cells, the
    measures. `care_sim.viewer.recording.entities.ENTITIES` lists each with unit and frame, and so
    does the page "About" of the recording. Timelines are `keyframe` and `seconds`.

    Raises `care_sim.MissingExtra` without the extra `viewer`, `care_sim.InvalidInput` for an
    environment that is no loop of CARE-Sim and for a file that is a folder or is being
    written already, OSError where it cannot be written.

    ### Example
    ```python
    env = gymnasium.make("CARE-Dartout-v0")
    policy = care_sim.make_policy("history", env)
    with RecordRerun(env, "out.rrd", policy=policy) as env:
        observation, info = env.reset(seed=0)
        env.step(policy(observation))  # and so on, until terminated or truncated
    ```
    """

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
        self._path = Path(fspath(path)) if isinstance(path, str | PathLike) else None
        self._recording = None if isinstance(path, str | PathLike) else path
        self._name = name or (policy.name if policy is not None else "") or "agent"
        self._episode: RecordedEpisode | None = None

    def begin(self, loop: ClosedLoop | OpenLoop, episode: int) -> None:
        """Open the file of this episode, or its lane in a file that was given."""
        if self._path is not None:
            self._recording = recording(
                numbered(self._path, episode), [self._name], isinstance(loop, OpenLoop)
            )
        assert self._recording is not None
        self._episode = self._recording.episode(self._name, loop)

    def look(self, loop: Any) -> None:
        """Take the camera's picture."""
        if self._episode is not None:
            self._episode.look(loop)

    def keep(self, watched: Watched) -> None:
        """Log the keyframe."""
        if self._episode is not None:
            self._episode.keep(watched)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Finish the episode, and the file if it is its own."""
        episode = self._episode
        self._episode = None
        if episode is not None and self._recording is not None:
            with nullcontext() if self._path is None else self._recording:
                episode.end(outcome)

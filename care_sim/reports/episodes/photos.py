"""One picture of an episode: at its main moment, or at a given time."""

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from care_sim.base.checks import check_known, check_number
from care_sim.base.errors import InvalidInput
from care_sim.base.files import PNG, check_output, replacing
from care_sim.envs.wrappers.record_rerun import Watching
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.watcher import Watched
from care_sim.policies.base import Policy
from care_sim.reports.episodes.clips import view_of
from care_sim.study.episode_play import GymEnv
from care_sim.viewer.pictures.keyframe import draw_keyframe

_ROUNDING_S = 1e-6
"""Times are sums of keyframes."""


class Photo:
    """Writes one picture of an episode of either loop to `path`; without a path it does nothing.

    It shows the first keyframe at or after `at` seconds on its own clock. By default it shows the
    first keyframe at which the car brakes, in the open loop the first at which an object appears.
    Raises InvalidInput for a time without a path, a negative one and another ending than .png, and
    as `care_sim.base.files.check_output` does.
    """

    def __init__(self, path: Path | None, at: float | None = None):
        self._path = path
        self._at = at
        self._taken = False
        self._nobody = "the car never braked"
        if at is not None:
            check_number("at", at, least=0.0)
            if path is None:
                raise InvalidInput("--at has no meaning without --picture")
            self._nobody = f"no keyframe at {at:g} s or later"
        if path is not None:
            check_known("ending of a picture", path.suffix, (".png",))
            check_output(path, PNG)

    def watching(self, env: GymEnv, policy: Policy) -> GymEnv:
        """`env`, watched where there is a path."""
        return env if self._path is None else _Watched(env, policy, self)

    def show(self, loop: OneWorld | OpenLoop, watched: Watched) -> None:
        """Take the picture after a keyframe, if none is taken and the keyframe is the one."""
        if self._at is None and isinstance(loop, OpenLoop):
            self._nobody = "nobody appeared"
        view = view_of(loop, [watched.record], watched)
        wanted = view.is_moment if self._at is None else view.time_s > self._at - _ROUNDING_S
        if self._path is not None and wanted and not self._taken:
            with replacing(self._path, PNG) as unfinished:
                draw_keyframe(view).save(unfinished, "PNG")
            self._taken = True

    def report(self) -> None:
        """Report on stderr that there was no moment for a picture."""
        if self._path is not None and not self._taken:
            print(f"{self._nobody}: no picture", file=sys.stderr)


class _Watched(Watching):
    """Passes every keyframe to a photographer."""

    def __init__(self, env: GymEnv, policy: Policy, photo: Photo):
        super().__init__(env, policy)
        self._photo = photo

    def begin(self, loop: OneWorld | OpenLoop, episode: int) -> None:
        """Nothing: the picture is one for all."""

    def keep(self, watched: Watched) -> None:
        """Show it."""
        self._photo.show(self._inner.loop, watched)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Nothing: the picture is there already, if it is."""

"""One picture of an episode: of the moment that matters, or of a time."""

import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from PIL import Image

from care_sim.base.checks import check_known, check_number
from care_sim.base.errors import InvalidInput
from care_sim.base.files import PNG, check_output, replacing
from care_sim.envs.open_loop import OpenLoopEnv
from care_sim.envs.wrappers.watching import Watching
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.film_watcher import WatchedScene
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.records import Keyframe
from care_sim.policies.base import Policy
from care_sim.study.episode_play import GymEnv
from care_sim.viewer.pictures.keyframe import draw_keyframe
from care_sim.viewer.pictures.scene_keyframe import draw_scene_keyframe

ENDINGS = (".png",)
"""Of the file of a picture."""
_ROUNDING_S = 1e-6
"""Times are sums of keyframes."""


class Photo:
    """Writes one picture to `path`; without a path it does nothing.

    It shows the first keyframe that is `at` seconds or later, as its own clock tells; without `at`
    the first of the moment that the picture is about, whose absence is told as `otherwise`. Raises
    InvalidInput for a time without a path and a negative one, and for a file whose ending is none
    of ENDINGS; InvalidInput and OSError at once where no picture can be written:
    `care_sim.base.files.check_output`.
    """

    otherwise: str

    def __init__(self, path: Path | None, at: float | None = None):
        self._path = path
        self._at = at
        # Without a path there is nothing to do and nothing to tell at the end.
        self._done = path is None
        if at is not None:
            check_number("at", at, least=0.0)
            if path is None:
                raise InvalidInput("--at has no meaning without --picture")
        if path is not None:
            check_known("ending of a picture", path.suffix, ENDINGS)
            check_output(path, PNG)

    def report(self) -> None:
        """Tell on stderr that there was nothing to take a picture of."""
        if not self._done:
            why = self.otherwise if self._at is None else f"no keyframe at {self._at:g} s or later"
            print(f"{why}: no picture", file=sys.stderr)

    def _take(self, time_s: float, moment: bool, draw: Callable[[], Image.Image]) -> None:
        """Take the picture, if none is taken and the keyframe is the one."""
        wanted = moment if self._at is None else time_s > self._at - _ROUNDING_S
        if self._path is not None and not self._done and wanted:
            with replacing(self._path, PNG) as unfinished:
                draw().save(unfinished, "PNG")
            self._done = True


class BrakePhoto(Photo):
    """Watches an episode of the closed loop, to take the moment at which the brake goes on."""

    otherwise = "the car never braked"

    def __call__(self, loop: ClosedLoop, frame: Keyframe) -> None:
        """A keyframe was played; the picture shows the world after it."""
        self._take(
            loop.world.time, frame.braking, lambda: Image.fromarray(draw_keyframe(loop, frame))
        )


class SightingPhoto(Photo):
    """Watches a play of the open loop, to take the first keyframe at which somebody appears."""

    otherwise = "nobody appeared"

    def watching(self, env: GymEnv, policy: Policy) -> GymEnv:
        """`env`, watched."""
        return env if self._done else _Watched(env, policy, self)

    def keep(self, loop: OpenLoop, watched: WatchedScene) -> None:
        """A keyframe was played."""
        record = watched.record
        self._take(
            record.time_s,
            bool(record.entries),
            lambda: draw_scene_keyframe(loop.film.name, loop.rig, watched),
        )


class _Watched(Watching):
    """Hands every keyframe to a photographer."""

    watches = "the open loop"
    kinds = (OpenLoopEnv,)

    def __init__(self, env: GymEnv, policy: Policy, photo: SightingPhoto):
        super().__init__(env, policy)
        self._photo = photo

    def begin(self, loop: OpenLoop, episode: int) -> None:
        """Nothing: the picture is one for all."""

    def keep(self, watched: WatchedScene) -> None:
        """Show it."""
        self._photo.keep(self._inner.loop, watched)

    def end(self, outcome: Mapping[str, Any] | None) -> None:
        """Nothing: the picture is there already, if it is."""

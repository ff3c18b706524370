"""Episodes on film: one as its picture shows it, or the same seed under several policies side by side."""

from collections.abc import Sequence
from itertools import zip_longest
from pathlib import Path

from PIL import Image

from care_sim.envs.drawing import PAPER
from care_sim.envs.panel import draw_panel
from care_sim.envs.picture import draw_keyframe
from care_sim.loop import ClosedLoop
from care_sim.study.clip_files import check_clip, write_clip
from care_sim.study.episode import Watcher
from care_sim.types import Keyframe

LAST_PICTURE_S = 2.5
"""How long the end of a film stays."""
_GAP = 8


class Filming:
    """Watches an episode and writes its pictures to `path`; without a path it does nothing.

    Raises InvalidInput for an ending that no clip has, MissingExtra for one whose library is not installed.
    """

    def __init__(self, path: Path | None):
        self._path = path
        self._pictures: list[Image.Image] = []
        if path is not None:
            check_clip(path)

    def __call__(self, loop: ClosedLoop, frame: Keyframe) -> None:
        """Take the picture of a keyframe."""
        if self._path is not None:
            self._keyframe_s = loop.rig.keyframe_s
            self._pictures.append(Image.fromarray(draw_keyframe(loop, frame)))

    def write(self) -> None:
        """Write the film, once the episode is over: a picture a keyframe, at the speed of the world."""
        if self._path is not None:
            write_clip(self._path, self._pictures, self._keyframe_s, LAST_PICTURE_S)


class SideBySide:
    """The same seed under several policies on one film, at `path`; without a path it does nothing.

    Errors are those of `Filming`.
    """

    def __init__(self, path: Path | None):
        self._path = path
        self._films: list[list[Image.Image]] = []
        if path is not None:
            check_clip(path)

    def panel(self, name: str) -> Watcher:
        """What watches the next episode, of the policy `name`."""
        frames: list[Keyframe] = []
        film: list[Image.Image] = []
        self._films.append(film)

        def watch(loop: ClosedLoop, frame: Keyframe) -> None:
            if self._path is not None:
                self._keyframe_s = loop.rig.keyframe_s
                frames.append(frame)
                film.append(draw_panel(name, loop, frames))

        return watch

    def write(self) -> None:
        """Write the film; an episode that ends before the others keeps its last picture."""
        if self._path is not None:
            write_clip(self._path, _side_by_side(self._films), self._keyframe_s, LAST_PICTURE_S)


def _side_by_side(films: Sequence[Sequence[Image.Image]]) -> list[Image.Image]:
    moments = zip_longest(*films)
    last = [film[-1] for film in films]
    return [_row([now or end for now, end in zip(moment, last, strict=True)]) for moment in moments]


def _row(pictures: Sequence[Image.Image]) -> Image.Image:
    width, height = pictures[0].size
    canvas = Image.new("RGB", (len(pictures) * (width + _GAP) - _GAP, height), PAPER)
    for number, picture in enumerate(pictures):
        canvas.paste(picture, (number * (width + _GAP), 0))
    return canvas

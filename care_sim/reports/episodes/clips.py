"""Episodes in pictures: a clip of one or of several side by side."""

from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from PIL import Image

from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.records import Keyframe
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.viewer.pictures.clip_files import check_clip, write_clip
from care_sim.viewer.pictures.drawing import BACKGROUND
from care_sim.viewer.pictures.keyframe import draw_keyframe
from care_sim.viewer.pictures.scene_from_above import draw_plan

_LAST_PICTURE_S = 2.5
"""Seconds for which the last picture stays."""
_GAP = 8

Draw = Callable[[str, Any, Sequence[Any]], Image.Image]
"""Draws where a loop, closed or open, stands after its keyframes so far, under the name of its
policy.
"""


def draw_whole(_name: str, loop: ClosedLoop, frames: Sequence[Keyframe]) -> Image.Image:
    """The picture of an episode on its own."""
    return Image.fromarray(draw_keyframe(loop, frames[-1]))


def draw_scene(_name: str, loop: OpenLoop, frames: Sequence[SceneKeyframe]) -> Image.Image:
    """The picture of a play of the open loop on its own."""
    return Image.fromarray(draw_plan(loop, frames[-1]))


class Clip:
    """Episodes side by side in one clip at `path`, drawn by `draw`; without a path it does nothing.

    Raises InvalidInput for a folder and for an ending that no clip has, MissingExtra for one whose
    library is not installed.
    """

    def __init__(self, path: Path | None, draw: Draw = draw_whole):
        self._path = path
        self._draw = draw
        self._films: list[list[Image.Image]] = []
        if path is not None:
            check_clip(path)

    def episode(self, name: str) -> Callable[[Any, Any], None]:
        """What watches the next episode, of the policy `name`."""
        frames: list[Keyframe | SceneKeyframe] = []
        film: list[Image.Image] = []
        self._films.append(film)

        def watch(loop: ClosedLoop | OpenLoop, frame: Keyframe | SceneKeyframe) -> None:
            if self._path is not None:
                # Episodes of one clip have the same keyframe, because they meet the same world.
                self._keyframe_s = loop.rig.keyframe_s
                frames.append(frame)
                film.append(self._draw(name, loop, frames))

        return watch

    def write(self) -> bool:
        """Write the clip, one picture per keyframe, at the speed of the world. Says whether there
        was anything to write.

        An episode that ends before the others keeps its last picture. One without a keyframe is
        left out.
        """
        films = [film for film in self._films if film]
        if self._path is not None and films:
            write_clip(self._path, _side_by_side(films), self._keyframe_s, _LAST_PICTURE_S)
        return bool(films)


def _side_by_side(films: Sequence[Sequence[Image.Image]]) -> Iterator[Image.Image]:
    # An episode that has ended keeps showing how it ended.
    last = [film[-1] for film in films]
    for moment in zip_longest(*films):
        yield _row([now or end for now, end in zip(moment, last, strict=True)])


def _row(pictures: Sequence[Image.Image]) -> Image.Image:
    # All pictures are of one kind and have one size.
    width, height = pictures[0].size
    canvas = Image.new("RGB", (len(pictures) * (width + _GAP) - _GAP, height), BACKGROUND)
    for number, picture in enumerate(pictures):
        canvas.paste(picture, (number * (width + _GAP), 0))
    return canvas

"""Episodes in pictures: a clip of one or of several side by side."""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput
from care_sim.loops.closed_loop import ClosedLoop
from care_sim.loops.open_loop import OpenLoop
from care_sim.loops.records import Keyframe
from care_sim.loops.scene_records import SceneKeyframe
from care_sim.study.run_config import Row
from care_sim.viewer.pictures.clip_files import check_clip, write_clip
from care_sim.viewer.pictures.drawing import BACKGROUND, Colour, font
from care_sim.viewer.pictures.keyframe import draw_keyframe
from care_sim.viewer.pictures.scene_from_above import draw_plan
from care_sim.viewer.pictures.sought import DETECTED, HIT

_LAST_PICTURE_S = 2.5
"""Seconds for which the last picture stays."""
_GAP = 8
_OUTCOME_TOP = 32
"""Pixel row of the outcome: in the sky of the chase view, above everything that moves."""

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

    The clip begins `start` seconds after the episodes do. Raises InvalidInput for a negative start
    or a start without a path, for a folder and for an ending that no clip has, MissingExtra for one
    whose library is not installed.
    """

    def __init__(self, path: Path | None, draw: Draw = draw_whole, start: float | None = None):
        self._path = path
        self._draw = draw
        self._start = start or 0.0
        self._films: list[list[Image.Image]] = []
        if start is not None:
            check_number("video-start", start, least=0.0)
            if path is None:
                raise InvalidInput("--video-start has no meaning without --video")
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

    def show_outcome(self, row: Row) -> None:
        """Write the outcome of the episode just played in large letters on its last picture.

        `row` is the row of a closed-loop episode.
        """
        if self._films and self._films[-1]:
            _write_outcome(self._films[-1][-1], row)

    def write(self) -> bool:
        """Write the clip, one picture per keyframe, at the speed of the world. Says whether there
        was anything to write.

        An episode that ends before the others, or before the clip starts, keeps its last picture.
        One without a keyframe is left out.
        """
        films = [film for film in self._films if film]
        if self._path is not None and films:
            # A start that is a whole number of keyframes may be a last bit above it.
            first = math.ceil(self._start / self._keyframe_s - 1e-6)
            films = [film[first:] or film[-1:] for film in films]
            write_clip(self._path, _side_by_side(films), self._keyframe_s, _LAST_PICTURE_S)
        return bool(films)


def outcome_words(row: Row) -> tuple[str, Colour]:
    """Return how a closed-loop episode ended, in words, and the colour of that outcome."""
    if row["collision"]:
        hit = f"collision at {3.6 * row['impact_speed_mps']:.0f} km/h"
        return (hit if row["hit_at_front"] else f"hit by {row['hit_kind']}"), HIT.colour
    clearance = row["clearance_m"]
    # Without a clearance the actor never came into view.
    clear = "no collision" if clearance is None else f"clear by {clearance:.1f} m"
    return clear, DETECTED.colour


def _write_outcome(picture: Image.Image, row: Row) -> None:
    text, colour = outcome_words(row)
    draw = ImageDraw.Draw(picture)
    size = picture.width // 14
    middle = picture.width / 2, _OUTCOME_TOP + size
    left, top, right, bottom = draw.textbbox(middle, text, font(size), anchor="mm")
    draw.rounded_rectangle((left - 12, top - 8, right + 12, bottom + 8), 8, colour)
    draw.text(middle, text, BACKGROUND, font(size), anchor="mm")


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

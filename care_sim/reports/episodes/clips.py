"""Episodes in pictures: a clip of one or of several side by side."""

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw

from care_sim.base.checks import check_number
from care_sim.base.errors import InvalidInput
from care_sim.loops.one_world import OneWorld
from care_sim.loops.open_loop import OpenLoop, SceneKeyframe
from care_sim.loops.records import Keyframe
from care_sim.loops.watcher import Watched
from care_sim.study.run_config import Row
from care_sim.viewer.palette import BACKGROUND, DETECTED, HIT, State
from care_sim.viewer.pictures.clip_files import check_clip, write_clip
from care_sim.viewer.pictures.drawing import plate
from care_sim.viewer.pictures.episode_view import episode_view
from care_sim.viewer.pictures.keyframe import View, draw_keyframe, draw_panel
from care_sim.viewer.pictures.scene_view import scene_view

_LAST_PICTURE_S = 2.5
"""Seconds for which the last picture stays."""
_GAP = 8
_OUTCOME_TOP = 32
"""Pixel row of the outcome: in the sky of the chase view, above everything that moves."""


def view_of(
    loop: OneWorld | OpenLoop, frames: Sequence[Any], watched: Watched | None = None
) -> View:
    """Return the view after the keyframes `frames` of a loop, the last of which may be
    `watched`.
    """
    if isinstance(loop, OpenLoop):
        return scene_view(loop, frames, watched)
    return episode_view(loop, frames)


class Clip:
    """One episode, or with `panels` several side by side, in one clip at `path`; without a path it
    does nothing.

    The clip begins `start` seconds after the episodes do. Raises InvalidInput for a negative start
    or a start without a path, for a folder and for another ending. Raises MissingExtra for an
    ending whose library is not installed.
    """

    def __init__(self, path: Path | None, start: float | None = None, panels: bool = False):
        self._path = path
        self._panels = panels
        self._start = start or 0.0
        self._films: list[list[Image.Image]] = []
        if start is not None:
            check_number("video-start", start, least=0.0)
            if path is None:
                raise InvalidInput("--video-start has no meaning without --video")
        if path is not None:
            check_clip(path)

    def episode(self, name: str) -> Callable[[Any, Any], None]:
        """Return the watcher of the next episode, of the policy `name`."""
        frames: list[Keyframe | SceneKeyframe] = []
        film: list[Image.Image] = []
        self._films.append(film)

        def watch(loop: OneWorld | OpenLoop, frame: Keyframe | SceneKeyframe) -> None:
            if self._path is not None:
                # Episodes of one clip have the same keyframe, because they meet the same world.
                self._keyframe_s = loop.rig.keyframe_s
                frames.append(frame)
                view = view_of(loop, frames)
                film.append(draw_panel(name, view) if self._panels else draw_keyframe(view))

        return watch

    def show_outcome(self, row: Row) -> None:
        """Write the outcome of the episode just played in large letters on its last picture.

        `row` is the row of a closed-loop episode.
        """
        if self._films and self._films[-1]:
            _write_outcome(self._films[-1][-1], row)

    def write(self) -> bool:
        """Write the clip, one picture per keyframe, at the speed of the world. Returns False if
        there was nothing to write.

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


def outcome_words(row: Row) -> State:
    """Return how a closed-loop episode ended, in words, and the colour of that outcome."""
    if row["collision"]:
        hit = f"collision at {3.6 * row['impact_speed_mps']:.0f} km/h"
        return State(hit if row["hit_at_front"] else f"hit by {row['hit_kind']}", HIT.colour)
    clearance = row["clearance_m"]
    # Without a clearance the actor never came into view.
    clear = "no collision" if clearance is None else f"clear by {clearance:.1f} m"
    return State(clear, DETECTED.colour)


def _write_outcome(picture: Image.Image, row: Row) -> None:
    text, colour = outcome_words(row)
    size = picture.width // 14
    plate(ImageDraw.Draw(picture), (picture.width / 2, _OUTCOME_TOP + size), text, colour, size)


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

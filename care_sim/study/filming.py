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
from care_sim.study.config import EpisodeConfig
from care_sim.study.episode import trace
from care_sim.study.task import Row
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


class Panels:
    """Watches an episode and keeps the narrow picture of every keyframe, under the name of its policy."""

    def __init__(self, name: str):
        self.name = name
        self.pictures: list[Image.Image] = []
        self._frames: list[Keyframe] = []

    def __call__(self, loop: ClosedLoop, frame: Keyframe) -> None:
        """Take the picture of a keyframe."""
        self.keyframe_s = loop.rig.keyframe_s
        self._frames.append(frame)
        self.pictures.append(draw_panel(self.name, loop, self._frames))


def film_side_by_side(configs: Sequence[EpisodeConfig], path: Path) -> list[Row]:
    """Play episodes that differ in their policy, write them side by side, and return their rows.

    An episode that ends before the others keeps its last picture. Errors are those of `check_clip`.
    """
    check_clip(path)
    panels = [Panels(config.policy) for config in configs]
    rows = [trace(config, panel)[0] for config, panel in zip(configs, panels, strict=True)]
    write_clip(path, _side_by_side([panel.pictures for panel in panels]), panels[0].keyframe_s, LAST_PICTURE_S)
    return rows


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

"""Clips as files: MP4 through FFmpeg, animated GIF, WebP and PNG through Pillow."""

import errno
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from itertools import chain
from pathlib import Path

import numpy as np
from PIL import Image

from care_sim.base.checks import check_known
from care_sim.base.extras import import_extra
from care_sim.base.files import GIF, MP4, PNG, WEBP, check_output, replacing, why_unwritable

_FFMPEG = "imageio_ffmpeg", "A film as MP4", "video"
"""FFmpeg from imageio-ffmpeg, and the extra to install."""
_GIF_COLOURS = 96
"""Colours of a GIF, shared by all its pictures: enough for flat surfaces, at half the size."""


def check_clip(path: Path) -> None:
    """Raise InvalidInput for a file whose ending is none of ENDINGS, MissingExtra for MP4 without
    its library, and what `care_sim.base.files.check_output` raises.
    """
    check_known("ending of a clip", path.suffix, ENDINGS)
    if path.suffix == ".mp4":
        import_extra(*_FFMPEG)
    check_output(path, _CLIP_KINDS[path.suffix])


def write_clip(
    path: Path, pictures: Iterable[Image.Image], picture_s: float, hold_s: float
) -> None:
    """Write pictures of one size as a clip: each is shown for `picture_s` seconds, the last for
    `hold_s`. An animation starts over at its end.

    The ending of `path`, which `check_clip` has accepted, decides the form. The file is written
    whole or not at all.
    """
    with replacing(path, _CLIP_KINDS[path.suffix]) as unfinished:
        ENDINGS[path.suffix](unfinished, pictures, picture_s, hold_s)


def _write_mp4(
    path: Path, pictures: Iterable[Image.Image], picture_s: float, hold_s: float
) -> None:
    # FFmpeg needs the size of the pictures first, so the first picture is read before the writer
    # opens.
    shown = iter(pictures)
    first = next(shown)
    ffmpeg = import_extra(*_FFMPEG)
    settings = {
        "fps": 1 / picture_s,
        "macro_block_size": 2,  # H.264 needs even sizes; larger blocks would scale the picture
        "quality": 7,
        "ffmpeg_log_level": "quiet",
    }
    sent = 0
    try:
        with closing(ffmpeg.write_frames(str(path), first.size, **settings)) as film:
            film.send(None)
            for picture in chain([first], shown):
                film.send(picture.tobytes())
                sent += 1
            # A film has one rate for all pictures, so the last picture is held by repeating it.
            for _ in range(round(hold_s / picture_s) - 1):
                film.send(picture.tobytes())
                sent += 1
        written, _ = ffmpeg.count_frames_and_secs(str(path))
    except (OSError, RuntimeError):
        written = 0
    # FFmpeg reports no failure, but its film then lacks pictures.
    if written != sent:
        raise OSError(errno.EIO, why_unwritable(path) or "FFmpeg could not write it", str(path))


def _write_animation(
    path: Path, pictures: Iterable[Image.Image], picture_s: float, hold_s: float
) -> None:
    first, *others = pictures
    durations = [round(1000 * picture_s)] * len(others) + [round(1000 * hold_s)]
    first.save(path, save_all=True, append_images=others, duration=durations, loop=0)


def _write_gif(
    path: Path, pictures: Iterable[Image.Image], picture_s: float, hold_s: float
) -> None:
    _write_animation(path, _in_few_colours(list(pictures)), picture_s, hold_s)


def _in_few_colours(pictures: Sequence[Image.Image]) -> list[Image.Image]:
    """Return the pictures in one palette, chosen for a dozen of them."""
    sample = np.concatenate(
        [np.asarray(picture) for picture in pictures[:: max(1, len(pictures) // 12)]]
    )
    common = Image.fromarray(sample).quantize(_GIF_COLOURS, Image.Quantize.MEDIANCUT)
    # Without dithering, pixels that stand still have one colour, and are stored once.
    return [picture.quantize(palette=common, dither=Image.Dither.NONE) for picture in pictures]


_CLIP_KINDS = {".mp4": MP4, ".gif": GIF, ".webp": WEBP, ".png": PNG}
ENDINGS: dict[str, Callable[[Path, Iterable[Image.Image], float, float], None]] = {
    ".mp4": _write_mp4,
    ".gif": _write_gif,
    ".webp": _write_animation,
    ".png": _write_animation,
}
"""How a clip is written, by the ending of its file."""
